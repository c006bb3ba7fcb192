"""
Measure a scan with a template
==============================

The places to measure, waist and thighs, are marked once on a template. After
:func:`unbend.register` the template lies on the scan of another body and measures it.
"""

import matplotlib.pyplot as plt
import numpy as np

from unbend import match, register
from unbend.datasets import make_biped
from unbend.report import draw_mesh, view

template = make_biped("standing", n_vertices=1500)
scan = make_biped("walking", n_vertices=2000, meshing=1, girth=1.25, torso=1.05)
fitted = register(template.mesh, scan.mesh, match(template.mesh, scan.mesh))
print(f"{fitted.coverage:.0%} of the template lies on the scan")

# %%
# A tape is a cut through the template at rest: points on its edges. Their order around the body
# does not change, so their length can be measured on the fitted template too.


def tape(body, height, part):
    """Cut a part level at rest: ends of the edges, and how far along, in order around it."""
    edges = np.sort(body.mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges = np.unique(edges[(body.labels[edges] == body.parts.index(part)).all(axis=1)], axis=0)
    low, high = body.rest[edges, 1].T - height
    edges, share = edges[low * high < 0], (low / (low - high))[low * high < 0, None]
    x, _, z = (body.rest[edges[:, 0]] * (1 - share) + body.rest[edges[:, 1]] * share).T
    order = np.argsort(np.arctan2(z - z.mean(), x - x.mean()))
    return edges[order], share[order]


def length(vertices, edges, share):
    """Length of a closed tape."""
    points = vertices[edges[:, 0]] * (1 - share) + vertices[edges[:, 1]] * share
    return np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1).sum()


colors = np.full((template.mesh.n_vertices, 3), 0.8)
for name, height, part in (("waist", 1.05, "torso"), ("left thigh", 0.7, "left_leg")):
    marked = tape(template, height, part)
    colors[marked[0]] = (0.84, 0.2, 0.0)
    before, after = (length(v, *marked) for v in (template.mesh.vertices, fitted.mesh.vertices))
    print(f"{name:10s}  template {before:.3f}  scan {after:.3f}")

# %%
fig, axes = plt.subplots(1, 3, figsize=(9, 4.2))
draw_mesh(axes[0], template.mesh, colors=colors)
draw_mesh(axes[1], scan.mesh)
draw_mesh(axes[2], fitted.mesh, colors=colors)
for ax, title in zip(axes, ("template", "scan", "template on the scan"), strict=True):
    ax.set_title(title)

# %%
# The template on the scan:
view(fitted.mesh)
