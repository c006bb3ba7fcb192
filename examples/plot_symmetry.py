"""
Left and right of a body
========================

A walking person is not symmetric in space, but its surface has a symmetry.
:func:`unbend.symmetry` finds for each vertex the one on the other side, in any pose.
"""

import matplotlib.pyplot as plt
import numpy as np

from unbend import symmetry
from unbend.datasets import make_biped
from unbend.report import draw_mesh, match_page

person = make_biped("walking", n_vertices=1000)
found = symmetry(person.mesh)
other = found.source_to_target
print(f"{(other == person.mirror).mean():.1%} of the vertices have exactly the right partner")

# %%
# Use it to copy labels to the other side: the left arm, in orange, gives the right
# one, in blue.
left = person.labels == person.parts.index("left_arm")
colors = np.full((1000, 3), 0.85)
colors[left] = (0.84, 0.37, 0.0)
colors[other[left]] = (0.0, 0.45, 0.7)
fig, axes = plt.subplots(1, 2, figsize=(8, 4.6))
draw_mesh(axes[0], person.mesh, colors=colors, view="front")
draw_mesh(axes[1], person.mesh, colors=colors, view=(210, 15))

# %%
match_page(person.mesh, person.mesh, found)
