"""
A scan from one side
====================

A camera sees one side of an animal. The other side of the model must get no partner: ``-1``, grey
in the pictures. ``Match.overlap_target`` is the share of the model that was seen.
"""

import matplotlib.pyplot as plt
import numpy as np

from unbend import Mesh, match, transfer
from unbend.datasets import make_quadruped
from unbend.report import draw_mesh, match_page, position_colors

model = make_quadruped("standing", n_vertices=1000)
whole = make_quadruped("walking", n_vertices=1600, meshing=1).mesh

# %%
# The camera sees the faces that are turned towards it.
corners = whole.vertices[whole.faces]
normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
towards = normals @ (1, 0.2, 0.3) > 0.1 * np.linalg.norm(normals, axis=1)
used, faces = np.unique(whole.faces[towards], return_inverse=True)
scan = Mesh(whole.vertices[used], faces.reshape(-1, 3), name="scan")
print(scan)

# %%
# A surface with a boundary may be partial. ``partial="source"`` says that this one is.
found = match(scan, model.mesh, partial="source")
print(found, f"{found.overlap_target:.0%} of the model has a partner on the scan", sep="\n")

# %%
colors = position_colors(model.mesh.vertices)
onto_scan = np.full((scan.n_vertices, 3), 0.6)
has = found.source_to_target >= 0
onto_scan[has] = colors[found.source_to_target[has]]
lost = found.target_to_source < 0
fig, axes = plt.subplots(1, 3, figsize=(10, 3.6))
draw_mesh(axes[0], scan, colors=onto_scan, view=(70, 15))
draw_mesh(axes[1], model.mesh, colors=np.where(lost[:, None], 0.6, colors), view=(70, 15))
draw_mesh(axes[2], model.mesh, colors=np.where(lost[:, None], 0.6, colors), view=(250, 15))
for ax, title in zip(axes, ("scan", "model", "model, from behind"), strict=True):
    ax.set_title(title)

# %%
# Values are transferred only where there is a partner. Elsewhere they are NaN.
height = transfer(scan.vertices[:, 1], found)
print(f"{np.isnan(height).mean():.0%} of the model's vertices have no height")
match_page(scan, model.mesh, found)
