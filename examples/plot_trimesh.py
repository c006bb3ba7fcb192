"""
With trimesh
============

Whatever takes a mesh here takes a `trimesh <https://trimesh.org>`_ object too, and results are
arrays in the order of its vertices. (Load with ``process=False`` where vertices must stay as they
are in the file: trimesh merges them otherwise.)
"""

import matplotlib.pyplot as plt
import trimesh

from unbend import Mesh, canonical_form, diagnose, distance, lay_into_pose
from unbend.datasets import make_octopus
from unbend.report import draw_mesh

animal = make_octopus("crawling", n_vertices=1500).mesh
body = trimesh.Trimesh(animal.vertices, animal.faces, process=False)
health = diagnose(body)
print(body, f"closed: {health.closed}, genus {health.genus}", sep="\n")

# %%
# The octopus in its canonical form, as a trimesh object again, that trimesh's own tools take.
form = canonical_form(body)
unbent = trimesh.Trimesh(lay_into_pose(body, form), body.faces, process=False)
print(f"sides of the box: {body.extents.round(2)} as it crawls, {unbent.extents.round(2)} unbent")

# %%
# Distances from the tip of the mantle, as vertex colours of the trimesh object.
(field,) = distance(body, int(body.vertices[:, 1].argmax()))
body.visual.vertex_colors = trimesh.visual.interpolate(field, "viridis")
fig, axes = plt.subplots(1, 2, figsize=(8, 4))
draw_mesh(axes[0], body, colors=field)
draw_mesh(axes[1], unbent, colors=field, view=(0, 60))

# %%
Mesh(unbent.vertices, unbent.faces, name="octopus, unbent")
