"""
What noise, holes, welds and other meshings do
==============================================

Scans are noisy and have holes, hands get glued to hips, and no two tools mesh alike. Each copy
below is of one person in another pose, so the true map is known, and the error of the match can
be told.
"""

import matplotlib.pyplot as plt

from unbend import evaluate, match
from unbend.correspondence import THRESHOLDS
from unbend.datasets import add_noise, cut_discs, damaged_truth, make_biped, rest_map, weld
from unbend.report import draw_mesh, position_colors

whole = make_biped("standing", n_vertices=700)
other = make_biped("walking", n_vertices=700, meshing=1)
copies = {
    "meshed anew": None,
    "noise": add_noise(other.mesh, 0.1, random_state=0),
    "holes": cut_discs(other.mesh, 0.06, 4, random_state=1),
    "welded": weld(other.mesh, 1, random_state=2),
}

# %%
# One match each, everything at its default. Errors are geodesic distances to where a point
# belongs, over the square root of the area.
results, images = {}, {}
for name, copy in copies.items():
    mesh = other.mesh if copy is None else copy.mesh
    truth = damaged_truth(rest_map(whole, other), target=copy)
    found = match(whole.mesh, mesh)
    results[name] = evaluate(found, mesh, range(len(truth)), truth)
    images[name] = mesh, position_colors(whole.mesh.vertices)[found.target_to_source]
    print(f"{name:12s} mean error {results[name].mean():.3f}, confidence {found.confidence:.2f}")

# %%
fig, axes = plt.subplots(1, 4, figsize=(10, 3.6))
for ax, (name, (mesh, colors)) in zip(axes, images.items(), strict=True):
    draw_mesh(ax, mesh, colors=colors)
    ax.set_title(name)

# %%
fig, ax = plt.subplots(figsize=(6, 3.6), layout="constrained")
for name, result in results.items():
    ax.plot(THRESHOLDS, result.curve(), label=name)
ax.set(xlabel="geodesic error", ylabel="vertices within it, %", ylim=(0, 101))
ax.legend()
