"""
Noise, holes and remeshing
==========================

Scans are noisy and have holes, and every tool makes another mesh. Each copy below is of one person
in another pose, so the true map is known and the error of the match can be measured.
"""

import matplotlib.pyplot as plt
import numpy as np

from unbend import Mesh, evaluate, match
from unbend.correspondence import THRESHOLDS
from unbend.datasets import make_biped, rest_map
from unbend.report import draw_mesh, position_colors

whole = make_biped("standing", n_vertices=700)
other = make_biped("walking", n_vertices=700, meshing=1)
truth = rest_map(whole, other)
vertices, faces = other.mesh.vertices, other.mesh.faces
chance = np.random.default_rng(0)

# %%
# Noise moves every vertex. Around each of four points a hole takes all faces within 8 cm. Vertices
# of a hole stay, but no face uses them, and nothing is matched to them.
noise = 0.005 * chance.standard_normal(vertices.shape)
middles = vertices[chance.choice(len(vertices), 4)]
lost = (np.linalg.norm(vertices[:, None] - middles, axis=2) < 0.08).any(axis=1)
copies = {
    "remeshed": other.mesh,
    "noise": Mesh(vertices + noise, faces),
    "holes": Mesh(vertices, faces[~lost[faces].any(axis=1)]),
}

# %%
# One match each, with default options. Errors are geodesic distances to the ground truth, over
# the square root of the area.
results, images = {}, {}
for name, mesh in copies.items():
    found = match(whole.mesh, mesh)
    left = np.isin(truth, mesh.faces)
    results[name] = evaluate(found, mesh, np.flatnonzero(left), truth[left])
    images[name] = mesh, np.full(mesh.vertices.shape, 0.6)
    has = found.target_to_source >= 0
    images[name][1][has] = position_colors(whole.mesh.vertices)[found.target_to_source[has]]
    print(f"{name:12s} mean error {results[name].mean():.3f}, confidence {found.confidence:.2f}")

# %%
fig, axes = plt.subplots(1, 3, figsize=(9, 3.6))
for ax, (name, (mesh, colors)) in zip(axes, images.items(), strict=True):
    draw_mesh(ax, mesh, colors=colors)
    ax.set_title(name)

# %%
fig, ax = plt.subplots(figsize=(6, 3.6), layout="constrained")
for name, result in results.items():
    ax.plot(THRESHOLDS, result.curve(), label=name)
ax.set(xlabel="geodesic error", ylabel="vertices within it, %", ylim=(0, 101))
ax.legend()
