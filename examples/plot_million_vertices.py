"""
A million vertices
==================

The time and memory of a canonical form are proportional to the number of vertices. Here a dog of
5,000 vertices is subdivided twice, to 80,000. Twice more would give 1.3 million.
:doc:`/benchmarks` has times for large meshes.
"""

import time

import matplotlib.pyplot as plt
import numpy as np

from unbend import Mesh, canonical_form
from unbend.datasets import make_quadruped


def subdivide(mesh):
    """Split each face into four at the middles of its edges."""
    sides = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    a, b, c = mesh.faces.T
    ab, bc, ca = (number.reshape(-1, 3) + mesh.n_vertices).T
    faces = np.concatenate([np.stack(f, 1) for f in
                            ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])  # fmt: skip
    return Mesh(np.concatenate([mesh.vertices, mesh.vertices[edges].mean(axis=1)]), faces)


# %%
dog = make_quadruped("walking", n_vertices=5000).mesh
sizes, seconds = [], []
for _ in range(3):
    start = time.process_time()
    form = canonical_form(dog)
    sizes.append(dog.n_vertices)
    seconds.append(time.process_time() - start)
    print(f"{sizes[-1]:,} vertices: {seconds[-1]:.1f} s of processor time")
    dog = subdivide(dog)

# %%
fig, ax = plt.subplots(figsize=(5, 3.4), layout="constrained")
ax.loglog(sizes, seconds, "o-")
ax.set_xticks(sizes, [f"{one:,}" for one in sizes])
ax.tick_params(axis="x", which="minor", labelbottom=False)
ax.set(xlabel="vertices", ylabel="seconds of processor time")
ax.grid(which="both", alpha=0.3)
