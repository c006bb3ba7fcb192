"""
Similarity of many shapes
=========================

:func:`unbend.collection.descriptor` describes a shape by 206 numbers, independent of its pose and
its mesh. Their distances are enough to cluster shapes.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.cluster.hierarchy import dendrogram, linkage
from scipy.spatial.distance import pdist, squareform

from unbend import similarity
from unbend.collection import descriptor
from unbend.datasets import make_biped, make_octopus, make_quadruped

makers = {
    "dog": lambda pose, i: make_quadruped(pose, n_vertices=900, meshing=i),
    "bear": lambda pose, i: make_quadruped(pose, species="bear", n_vertices=900, meshing=i),
    "human": lambda pose, i: make_biped(pose, n_vertices=900, meshing=i),
    "octopus": lambda pose, i: make_octopus(None, n_vertices=900, meshing=i, random_state=i),
}
poses = ("standing", "walking", "sitting")
shapes = {f"{kind} {i + 1}": make(poses[i], i).mesh for kind, make in makers.items()
          for i in range(3)}  # fmt: skip
distances = pdist([descriptor(mesh) for mesh in shapes.values()])

# %%
# Poses of one animal are neighbours, and each kind has its own branch.
fig, (left, right) = plt.subplots(1, 2, figsize=(10, 4.4), layout="constrained")
tree = dendrogram(linkage(distances, "average"), labels=list(shapes), orientation="left", ax=left)
order = [list(shapes).index(name) for name in tree["ivl"]]
picture = right.imshow(
    squareform(distances)[np.ix_(order, order)], origin="lower", cmap="viridis_r"
)
right.set_xticks([])
right.set_yticks([])
fig.colorbar(picture, label="distance of descriptors")

# %%
# If vertices correspond already, as in an animation, compare canonical forms by their cosine, the
# measure of the paper. In three dimensions the sitting dog differs a little from the others: its
# third and fourth eigenvalues are nearly equal, and two poses keep different ones. In two or four
# dimensions this does not happen.
dogs = [make_quadruped(pose, n_vertices=900).mesh for pose in poses]
for d in (2, 3, 4):
    cosines = [similarity(dogs[0], dog, n_components=d) for dog in dogs]
    print(d, "dimensions:", ", ".join(f"{one:.4f}" for one in cosines))
