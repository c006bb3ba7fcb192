"""
A dog and a giraffe, with a few landmarks
=========================================

A map from a dog to a giraffe must stretch the surface. A few roughly placed landmarks help to
find it.
"""

import matplotlib.pyplot as plt
import numpy as np

from unbend import evaluate, match, transfer
from unbend.datasets import make_quadruped, rest_map
from unbend.report import draw_mesh, match_page, position_colors

dog = make_quadruped("standing", n_vertices=800)
giraffe = make_quadruped("walking", species="giraffe", n_vertices=800, meshing=1)

# %%
# The tips of the nose and the tail, and the left hind paw.
truth = rest_map(dog, giraffe)
x, y, z = dog.rest.T
picked = [z.argmax(), (x - 3 * y - z).argmax(), z.argmin()]
landmarks = [(i, truth[i]) for i in picked]
found = match(dog.mesh, giraffe.mesh, landmarks=landmarks)
rows = np.arange(dog.mesh.n_vertices)
errors = evaluate(found, giraffe.mesh, rows, truth)
print(found, f"mean error {errors.mean():.3f} of the square root of the area", sep="\n")

# %%
colors = position_colors(dog.rest)
fig, axes = plt.subplots(1, 2, figsize=(9, 4.4))
draw_mesh(axes[0], dog.mesh, colors=colors, view=(60, 15))
draw_mesh(axes[1], giraffe.mesh, colors=transfer(colors, found), view=(60, 15))

# %%
match_page(dog.mesh, giraffe.mesh, found, truth=(rows, truth))
