"""Which hypothesis is right: how nearly it moves the surface as locally rigid pieces would.

Intrinsic residuals cannot tell a person from the same person turned front to back and left to
right. The surfaces can: pulled back through the right map, every patch of the target is close to
a rotated copy of the source's patch. A reflected or reversed patch is not.
"""

from __future__ import annotations

import numpy as np

from unbend._types import FloatArray, IntArray
from unbend.matching._shape import Shape

_CENTERS = 300
# Patch sizes, in samples of 300: from a paw to half a body.
_PATCH_SIZES = (12, 30, 80)


def rigidity_score(source: Shape, target: Shape, functional_map: FloatArray) -> float:
    """Mean log share of patch shape that no rotation explains; both directions; lower is better.

    Positions of both shapes are smoothed to the map's own eigenfunctions first, so that
    triangulation and fine detail do not count. 0.1 per direction and scale, say, means that
    a tenth of a patch's variance is left after the best rotation (Kabsch 1976).
    """
    forward = _misfits(source, target, functional_map)
    backward = _misfits(target, source, functional_map.T)
    return float(np.mean(np.log(np.maximum((forward + backward) / 2, 1e-12))))


def orientation_score(source: Shape, target: Shape, functional_map: FloatArray) -> float:
    """Area share of the source that the map keeps right side out, less the rest: -1 to 1.

    The target's positions and normals are pulled back through the map, smooth; each source
    triangle then has a normal of its own, and the one it was given.
    """
    k = len(functional_map)
    position = source.basis[:, :k] @ (functional_map @ target.position_coefficients[:k])
    normal = source.basis[:, :k] @ (functional_map @ target.normal_coefficients[:k])
    faces = source.faces
    corners, own = position[faces], source.vertices[faces]
    pulled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0]), axis=1)
    agreement = np.sign(np.einsum("ij,ij->i", pulled, normal[faces].sum(axis=1)))
    return float(agreement @ area / area.sum())


def _misfits(source: Shape, target: Shape, functional_map: FloatArray) -> FloatArray:
    """Mean share of patch variance that no rotation explains, one per patch size."""
    k = len(functional_map)
    centers = source.samples[:_CENTERS]
    basis = source.basis[centers, :k]
    rest = basis @ source.position_coefficients[:k]
    posed = basis @ (functional_map @ target.position_coefficients[:k])
    order = _nearby(basis / source.eigenvalues[:k])
    sizes = [min(size, len(centers)) for size in _PATCH_SIZES]
    return np.array([_patch_misfit(rest, posed, order[:, :size]) for size in sizes])


def _nearby(form: FloatArray) -> IntArray:
    """Order all samples by biharmonic distance from each, (m, m)."""
    squares = (form**2).sum(axis=1)
    order: IntArray = np.argsort(squares - 2 * form @ form.T, axis=1, kind="stable")
    return order


def _patch_misfit(rest: FloatArray, posed: FloatArray, patches: IntArray) -> float:
    left, right = rest[patches], posed[patches]
    left = left - left.mean(axis=1, keepdims=True)
    right = right - right.mean(axis=1, keepdims=True)
    cross = np.matmul(left.transpose(0, 2, 1), right)
    values = np.linalg.svd(cross, compute_uv=False)
    values[:, 2] *= np.sign(np.linalg.det(cross))
    size = (left**2).sum(axis=(1, 2)) + (right**2).sum(axis=(1, 2))
    misfit = 1 - 2 * values.sum(axis=1) / np.maximum(size, np.finfo(float).tiny)
    return float(misfit.mean())
