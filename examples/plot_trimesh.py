"""
With trimesh
============

All functions accept `trimesh <https://trimesh.org>`_ objects, and results are
arrays in the order of their vertices. (Load with ``process=False`` to keep the vertices of the
file; otherwise trimesh merges them.)
"""

import matplotlib.pyplot as plt
import trimesh

from unbend import Mesh, canonical_form, diagnose, distance, lay_into_pose
from unbend.datasets import make_octopus
from unbend.report import draw_mesh, view

animal = make_octopus("crawling", n_vertices=1500).mesh
body = trimesh.Trimesh(animal.vertices, animal.faces, process=False)
health = diagnose(body)
print(body, f"closed: {health.closed}, genus {health.genus}", sep="\n")

# %%
# The canonical form of the octopus is a trimesh object again, for trimesh's own tools.
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
view(Mesh(unbent.vertices, unbent.faces, name="octopus, unbent"))
