"""
In Blender's Python
===================

Run in Blender's own Python console, with unbend installed into it (``path/to/blender/python -m pip
install path/to/unbend``, a clone of the repository). It transfers the vertex groups of the active
object to the other selected one, which may have another pose and another mesh. The site
is built without Blender, so this page only shows the code. It was run with the ``bpy`` package of
Blender 5.0.1.
"""

import bpy
import numpy as np

import unbend


def as_mesh(item):
    """Vertices in world space, and triangles."""
    data = item.data
    data.calc_loop_triangles()
    vertices = np.empty(3 * len(data.vertices))
    data.vertices.foreach_get("co", vertices)
    faces = np.empty(3 * len(data.loop_triangles), dtype=np.int32)
    data.loop_triangles.foreach_get("vertices", faces)
    world = np.array(item.matrix_world)
    vertices = vertices.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
    return unbend.Mesh(vertices, faces.reshape(-1, 3), name=item.name)


# %%
source = bpy.context.active_object
(target,) = [one for one in bpy.context.selected_objects if one is not source]
found = unbend.match(as_mesh(source), as_mesh(target))
print(found)

# %%
weights = np.zeros((len(source.data.vertices), len(source.vertex_groups)))
for vertex in source.data.vertices:
    for entry in vertex.groups:
        weights[vertex.index, entry.group] = entry.weight
for group, column in zip(source.vertex_groups, unbend.transfer(weights, found).T, strict=True):
    new = target.vertex_groups.new(name=group.name)
    for vertex in np.flatnonzero(column > 0):
        new.add([int(vertex)], float(column[vertex]), "REPLACE")
