"""
Carry a coat from one pose to another
=====================================

A standing cat has painted stripes. Another cat gallops, and its mesh has other
vertices and faces. A match finds the corresponding points, and :func:`unbend.transfer` transfers
the colours.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from unbend import match, transfer, write_mesh
from unbend.datasets import make_quadruped
from unbend.report import draw_mesh, match_page

standing = make_quadruped("standing", species="cat", n_vertices=2500)
galloping = make_quadruped("galloping", species="cat", n_vertices=2000, meshing=1)
across, up, along = standing.rest.T
stripe = 0.5 + 0.5 * np.tanh(3 * np.sin(75 * along + 4 * np.abs(across)))
coat = stripe[:, None] * (232, 160, 84) + (1 - stripe[:, None]) * (92, 56, 30)
coat[standing.labels == standing.parts.index("head")] = (240, 200, 150)

# %%
# No landmarks are given. The confidence is the estimated probability that the map is right.
found = match(standing.mesh, galloping.mesh)
carried = transfer(coat.astype(np.uint8), found)
print(found)

fig, axes = plt.subplots(1, 2, figsize=(9, 4))
draw_mesh(axes[0], standing.mesh, colors=coat / 255, view=(60, 15))
draw_mesh(axes[1], galloping.mesh, colors=carried / 255, view=(60, 15))

# %%
# MeshLab and Blender can open the file with its colours. To transfer texture coordinates, use
# ``kind="uv"``.
write_mesh(Path(tempfile.mkdtemp(), "galloping.ply"), galloping.mesh, colors=carried)

# %%
# Point at one cat to see the corresponding point on the other. Move the slider to morph.
match_page(standing.mesh, galloping.mesh, found)
