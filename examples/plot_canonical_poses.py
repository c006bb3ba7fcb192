"""
Canonical forms of three poses
==============================

A canonical form is a pose-invariant version of a shape: its straight distances approximate the
distances along the surface. A standing, galloping or sitting dog has nearly the same form.
"""

import matplotlib.pyplot as plt

from unbend import Mesh, canonical_form
from unbend.alignment import procrustes
from unbend.datasets import make_quadruped
from unbend.report import draw_mesh, form_page, position_colors

poses = ("standing", "galloping", "sitting")
dogs = [make_quadruped(pose, n_vertices=2000).mesh for pose in poses]
forms = [canonical_form(dog) for dog in dogs]

# %%
# A form is unique up to a rotation or reflection, so all are aligned with the first one. The
# remaining differences are in units of the square root of the surface's area.
first = forms[0].points
fig, axes = plt.subplots(2, 3, figsize=(9, 5.6))
for column, pose, dog, form in zip(axes.T, poses, dogs, forms, strict=True):
    rotation, translation = procrustes(form.points, first)
    turned = form.points @ rotation.T + translation
    apart = ((turned - first) ** 2).sum(axis=1).mean() ** 0.5
    colors = position_colors(dogs[0].vertices)
    draw_mesh(column[0], dog, colors=colors)
    draw_mesh(column[1], Mesh(turned, dog.faces), colors=colors, view=(30, 20))
    column[0].set_title(pose)
    column[1].set_title(f"form, {apart:.3f} from the first", fontsize=10)

# %%
# Drag to turn the galloping dog and its form. Choose "distance" and click a point to see the
# distances from it.
form_page(dogs[1], forms[1])
