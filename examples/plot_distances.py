"""
Biharmonic, geodesic and other distances
========================================

The geodesic distance is the length of the shortest path on the surface. The biharmonic distance
depends on all paths, and is smooth. Both are nearly independent of the pose.
"""

import matplotlib.pyplot as plt
import numpy as np

from unbend import canonical_form, distance, farthest_point_sampling
from unbend.datasets import make_quadruped
from unbend.report import draw_mesh, form_page

dog = make_quadruped("standing", n_vertices=3000)
nose = int(dog.rest[:, 2].argmax())
kinds = ("biharmonic", "geodesic", "commute-time", "diffusion")
fields = {kind: distance(dog.mesh, nose, distance=kind)[0] for kind in kinds}

# %%
# Stripes are lines of equal distance from the nose.
fig, axes = plt.subplots(2, 2, figsize=(8.4, 6))
for ax, (kind, field) in zip(axes.ravel(), fields.items(), strict=True):
    share = field / field.max()
    draw_mesh(ax, dog.mesh, colors=share + 0.06 * np.sign(np.sin(2 * np.pi * 12 * share)))
    ax.set_title(kind)

# %%
# How much they change with the pose: the same vertices, sitting.
sitting = make_quadruped("sitting", n_vertices=3000).mesh
for kind, field in fields.items():
    change = distance(sitting, nose, distance=kind)[0] - field
    print(f"{kind:13s} changes by {abs(change).mean() / field.mean():.1%} on average")

# %%
# Farthest-point samples are spread evenly with each of them.
samples = farthest_point_sampling(dog.mesh, 12, distance="biharmonic")
print(sorted({dog.parts[label] for label in dog.labels[samples]}))

# %%
# Choose the distance as colour, and click a point. The colours show biharmonic distances on the
# dog, and straight distances in its canonical form.
form_page(dog.mesh, canonical_form(dog.mesh))
