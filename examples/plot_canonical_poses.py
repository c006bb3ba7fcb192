"""
Canonical forms of three poses
==============================

A canonical form is what is left of a shape when its pose is taken out: straight distances within
it are distances along the surface. A dog that stands, gallops or sits has one and the same.
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
# A form is unique up to a rotation or reflection, so all are turned to the first one. What is left
# between two poses is told in units of the square root of the surface's area.
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
# Turn the galloping dog and its form. Pick "distance" to see how far all points are from the one
# that you click.
form_page(dogs[1], forms[1])
