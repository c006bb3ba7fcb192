"""
In a scikit-learn pipeline
==========================

``descriptor`` turns each mesh into a row of numbers, and scikit-learn predicts its class. Needs
scikit-learn.
"""

import matplotlib.pyplot as plt
import numpy as np
from sklearn.decomposition import PCA
from sklearn.model_selection import cross_val_score
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from unbend.canonical import SpectralMDS
from unbend.collection import descriptor
from unbend.datasets import make_biped, make_quadruped

meshes, kinds = [], []
for species in ("dog", "cat", "human", "ape"):
    make = make_quadruped if species in ("dog", "cat") else make_biped
    for i in range(4):  # a pose drawn at random, and a mesh of its own
        body = make(None, species=species, n_vertices=800, meshing=i, random_state=i)
        meshes.append(body.mesh)
        kinds.append(species)

# %%
describe = FunctionTransformer(lambda shapes: np.array([descriptor(one) for one in shapes]))
features = describe.transform(meshes)
scores = cross_val_score(KNeighborsClassifier(1), features, kinds, cv=4)
print(f"right in cross-validation: {scores.mean():.0%}")

classifier = make_pipeline(describe, KNeighborsClassifier(1)).fit(meshes, kinds)
print(classifier.predict([make_quadruped("galloping", species="cat", n_vertices=900).mesh]))

# %%
flat = PCA(2).fit_transform(features)
fig, ax = plt.subplots(figsize=(6, 4), layout="constrained")
for species in dict.fromkeys(kinds):
    ax.plot(*flat[np.array(kinds) == species].T, "o", label=species)
ax.set(xlabel="first principal component", ylabel="second")
ax.legend()

# %%
# Canonical forms are an estimator too, with the parameters of ``canonical_form`` and
# ``sampled_canonical_form``.
SpectralMDS(n_components=3, distance="biharmonic").fit_transform(meshes[0]).shape
