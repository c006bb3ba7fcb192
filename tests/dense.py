"""Dense oracles: the definitions, spelled out with full matrices."""

import numpy as np
import scipy.linalg


def eigenpairs(operator):
    """All eigenpairs of a Laplacian."""
    root = 1 / np.sqrt(operator.areas)
    values, vectors = scipy.linalg.eigh(root[:, None] * operator.stiffness.toarray() * root)
    return values, root[:, None] * vectors


def kernel(operator, filtered):
    """g = sum over the non-constant eigenpairs of filtered(lambda) phi phi^T."""
    values, functions = eigenpairs(operator)
    return (functions[:, 1:] * filtered(values[1:])) @ functions[:, 1:].T


def distances(gram):
    """d_ij from d_ij^2 = g_ii + g_jj - 2 g_ij."""
    diagonal = np.diag(gram)
    return np.sqrt(np.maximum(diagonal[:, None] + diagonal[None, :] - 2 * gram, 0))


def classical_scaling(squared, d):
    """Leading d eigenpairs of -1/2 J D J, as points and eigenvalues."""
    n = len(squared)
    centre = np.eye(n) - 1 / n
    gram = -0.5 * centre @ squared @ centre
    values, vectors = scipy.linalg.eigh(gram, subset_by_index=[n - d, n - 1])
    leading = np.argsort(-values)
    return vectors[:, leading] * np.sqrt(np.maximum(values[leading], 0)), values[leading]


def aligned(points, onto):
    """Points turned onto others by the best orthogonal matrix."""
    left, _, right = np.linalg.svd(points.T @ onto)
    return points @ (left @ right)


def relative_error(points, onto):
    """Size of what is left after the best alignment, relative to the size of the target."""
    return np.linalg.norm(aligned(points, onto) - onto) / np.linalg.norm(onto)
