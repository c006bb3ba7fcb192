"""
Search a collection by shape
============================

The meshes of a folder are described once. Then the collection finds the shapes most similar to a
query, in any pose, and groups its shapes without labels. Needs the extra ``collection``.
"""

import io
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

from unbend import write_mesh
from unbend.collection import Collection, find_groups
from unbend.datasets import make_biped, make_quadruped

folder = Path(tempfile.mkdtemp())
for pose in ("standing", "walking", "sitting"):
    for species in ("dog", "cat", "horse"):
        mesh = make_quadruped(pose, species=species, n_vertices=700).mesh
        write_mesh(folder / f"{species} {pose}.ply", mesh)
    write_mesh(folder / f"human {pose}.ply", make_biped(pose, n_vertices=700).mesh)

# %%
# ``workers=0`` works in this process; by default each core gets one.
shapes = Collection(folder / "shapes")
print(shapes.add(folder, workers=0).added, "shapes were added")

# %%
# The query is a dog that is not in the collection, with another pose and another mesh.
query = make_quadruped("galloping", n_vertices=900, meshing=2).mesh
hits = shapes.search(query, n=5)
fig, axes = plt.subplots(1, 5, figsize=(10, 2.6), layout="constrained")
for ax, hit in zip(axes, hits, strict=True):
    ax.imshow(plt.imread(io.BytesIO(shapes.thumbnail(hit.id))))
    ax.set_title(f"{Path(hit.path).stem}\n{hit.distance:.2f}", fontsize=9)
    ax.set_axis_off()

# %%
# The number of groups is chosen automatically:
entries, distances = shapes.distances()
for group, entry in sorted(zip(find_groups(distances), entries, strict=True), key=lambda x: x[0]):
    print(group, Path(entry.path).stem)
