"""
The mean of several bodies
==========================

Scans of people of different proportions have different meshes. A template is registered to each
of them, so that their vertices correspond. Then they have a mean and principal components.
"""

import matplotlib.pyplot as plt

from unbend import register
from unbend.collection import mean_shape
from unbend.datasets import make_biped
from unbend.report import draw_mesh, same_scale, view

template = make_biped("standing", n_vertices=600).mesh
girths = (0.8, 1.0, 1.3)
people = [
    make_biped("standing", n_vertices=600, meshing=i, girth=girth, legs=legs).mesh
    for i, (girth, legs) in enumerate(zip(girths, (1.1, 0.95, 1.0), strict=True))
]
found = mean_shape([register(template, one) for one in people], template)
share = found.statistics.variances / found.statistics.total_variance
print(f"shares of the variance: {', '.join(f'{one:.0%}' for one in share)}")

# %%
# The first component: from slender and tall to stout and short. Colours show where bodies vary
# most.
fig, axes = plt.subplots(1, 3, figsize=(8, 4.2))
for ax, deviations in zip(axes, (-1.5, 0, 1.5), strict=True):
    draw_mesh(ax, found.at(0, deviations), colors=found.statistics.variability, view="front")
    ax.set_title(f"{deviations:+g} deviations" if deviations else "mean")
same_scale(axes)

# %%
view(found.mean)
