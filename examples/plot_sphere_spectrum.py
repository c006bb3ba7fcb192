"""
Eigenfunctions of a sphere and an animal
========================================

On a sphere the eigenvalues of the Laplacian are known: l (l + 1), each of them 2 l + 1 times.
This shows how accurate those of a mesh are.
"""

import matplotlib.pyplot as plt
import numpy as np

from unbend import canonical_form, spectrum
from unbend.datasets import make_quadruped, make_sphere
from unbend.report import draw_mesh, form_page

sphere = make_sphere(4)  # 2,562 vertices, radius 1
found = spectrum(sphere, 49)
truth = np.repeat([degree * (degree + 1) for degree in range(7)], [2 * d + 1 for d in range(7)])
values = found.eigenvalues
error = np.abs(values[1:] - truth[1:]) / truth[1:]
print(f"relative error: {error[:8].max():.2%} up to l = 2, {error.max():.2%} up to l = 6")

# %%
fig, ax = plt.subplots(figsize=(7, 3.6), layout="constrained")
ax.step(range(49), truth, where="mid", color="0.6", label="l (l + 1)")
ax.plot(range(49), values, ".", label="found")
ax.set(xlabel="number of the eigenvalue", ylabel="eigenvalue")
ax.legend()

# %%
# On an animal the first ones distinguish head from tail and limb from limb.
dog = make_quadruped("walking", n_vertices=2000).mesh
functions = spectrum(dog, 9).eigenfunctions
fig, axes = plt.subplots(2, 4, figsize=(10, 4.6))
for i, ax in enumerate(axes.ravel(), start=1):
    draw_mesh(ax, dog, colors=functions[:, i])
    ax.set_title(f"eigenfunction {i}", fontsize=9)

# %%
# Choose one of the first twelve as colour:
form_page(dog, canonical_form(dog))
