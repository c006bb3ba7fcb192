"""
Give a new mesh the skinning weights of an old one
==================================================

A character has skinning weights. A new version of it has another pose and another mesh. A match
transfers the weights; each row sums to one.
"""

import matplotlib.pyplot as plt
import numpy as np

from unbend import match, transfer
from unbend.datasets import make_biped
from unbend.report import draw_mesh, match_page

rigged = make_biped("spread", n_vertices=1200)
fresh = make_biped("walking", n_vertices=1000, meshing=1)


def weights_of(body):
    """Weigh bones by closeness at rest, as many tools bind a skin."""
    head, tail = (np.array([getattr(b, end) for b in body.bones]) for end in ("head", "tail"))
    along = tail - head
    beyond = body.rest[:, None] - head
    share = np.clip((beyond * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    gap = np.linalg.norm(beyond - share[..., None] * along, axis=2)
    weights = 1 / (gap**4 + 1e-9)
    return weights / weights.sum(axis=1, keepdims=True)


# %%
# Here the true weights of the new body are known, for comparison.
found = match(rigged.mesh, fresh.mesh, barycentric=True)
weights = transfer(weights_of(rigged), found, kind="weights", source=rigged.mesh, target=fresh.mesh)
off = np.abs(weights - weights_of(fresh)).sum(axis=1) / 2
print(
    f"rows sum to {weights.sum(axis=1).min():.6f}; share of weight on the wrong bone: "
    f"{off.mean():.1%} on average"
)

# %%
bone = [one.name for one in rigged.bones].index("left_thigh")
fig, axes = plt.subplots(1, 2, figsize=(8, 4.6))
for ax, body, shown in zip(axes, (rigged, fresh), (weights_of(rigged), weights), strict=True):
    draw_mesh(ax, body.mesh, colors=shown[:, bone])
axes[0].set_title("left thigh, as it was rigged")
axes[1].set_title("left thigh, carried")

# %%
match_page(rigged.mesh, fresh.mesh, found)
