"""
Forms that still look like the animal
=====================================

In a canonical form limbs become thin threads and details are lost. :func:`unbend.lay_into_pose`
deforms the surface itself, as rigidly as possible, into the form's pose.
"""

import matplotlib.pyplot as plt

from unbend import Mesh, canonical_form, lay_into_pose
from unbend.alignment import procrustes
from unbend.datasets import make_biped
from unbend.report import draw_mesh, position_colors, view

people = [make_biped(pose, n_vertices=3000).mesh for pose in ("standing", "running", "sitting")]
unbent = [lay_into_pose(one, canonical_form(one)) for one in people]

# %%
# Three poses of a person become nearly the same surface.
upright = people[0].vertices
fig, axes = plt.subplots(2, 3, figsize=(9, 6.4))
for column, person, surface in zip(axes.T, people, unbent, strict=True):
    rotation, translation = procrustes(surface, upright, reflect=False)
    upright = surface @ rotation.T + translation
    colors = position_colors(people[0].vertices)
    draw_mesh(column[0], person, colors=colors)
    draw_mesh(column[1], Mesh(upright, person.faces), colors=colors)
axes[0, 0].set_title("as they stand", loc="left")
axes[1, 0].set_title("unbent", loc="left")

# %%
# The last one, which was sitting:
view(Mesh(upright, people[2].faces, name="a sitting person, unbent"))
