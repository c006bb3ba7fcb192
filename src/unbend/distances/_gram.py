"""Distances of the form d_ij^2 = g_ii + g_jj - 2 g_ij: biharmonic, commute-time, diffusion.

Over the non-constant eigenpairs, ``g = sum_i h(lambda_i) phi_i phi_i^T``, with ``h = lambda^-2``,
``lambda^-1`` and ``exp(-2 t lambda)``.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from unbend._memory import check_memory
from unbend._parallel import by_columns, one_blas_thread, slices
from unbend._types import FloatArray, IntArray
from unbend.choices import DistanceKind
from unbend.errors import InputError, SolverError
from unbend.linalg.pseudoinverse import green_and_diagonal, green_operator
from unbend.linalg.tall import inner
from unbend.spectral import Spectrum, Surface, eigenpairs, named

# exp(-2 t (lambda - lambda_1)) below this no longer changes a diffusion distance in float64.
_NEGLIGIBLE = 1e-16
# A kernel below this is rounded like numbers too small for float64, or is 0.
_VANISHING = 1e-290
# What two ways to one number may differ by, and squared distances may fall below zero, as shares of
# the largest entry on the kernel's diagonal.
_ROUNDING = 1e-8
# Columns solved for at once: a chunk for each of a few threads, and little memory.
_AT_ONCE = 32
# Eigenpairs beyond which a diffusion time is called too short to be computed.
_MOST_EIGENPAIRS = 2000


@dataclass(frozen=True, eq=False)
class Metric:
    """One distance on one surface of unit area."""

    from_sources: Callable[[IntArray], FloatArray]  # (s,) to (s, n), if they were asked for
    between: Callable[[IntArray], FloatArray]  # (p,) to (p, p)
    gram: Callable[[FloatArray], FloatArray] | None = None  # (n, r) to products with g, (n, r)


def spectral_filter(kind: DistanceKind, eigenvalues: FloatArray, time: float) -> FloatArray:
    """h(lambda) of a kernel, 0 for the constant eigenfunction."""
    values = eigenvalues[1:]
    if kind == "diffusion":
        weights = np.exp(-2 * time * values)
        if len(values) and weights.max() < _VANISHING:
            longest = _two_digits(-np.log(_VANISHING) / (2 * values[0]), np.floor)
            raise InputError(
                f"after a diffusion time of {time:.2g} of the area all distances vanish; use "
                f"{longest:g} or less"
            )
    else:
        weights = values**-2.0 if kind == "biharmonic" else 1 / values
    return np.append(0.0, weights)


def truncated_metric(kind: DistanceKind, spectrum: Spectrum, time: float) -> Metric:
    """Set up the distance through a spectrum's eigenpairs alone (Eq. 1 to 3)."""
    from scipy.spatial.distance import cdist  # slow to import, and exact forms do without it

    filtered = spectral_filter(kind, spectrum.eigenvalues, time)
    embedding = spectrum.eigenfunctions * np.sqrt(filtered)
    return Metric(
        from_sources=lambda sources: cdist(embedding[sources], embedding),
        between=lambda samples: cdist(embedding[samples], embedding[samples]),
        gram=lambda block: embedding @ (embedding.T @ block),
    )


def gram_metric(
    kind: DistanceKind, surface: Surface, time: float, *, sources: bool = False
) -> Metric:
    """Set up the distance with nothing left out (Eq. 6 and 7); see :func:`make_metric`."""
    if kind == "diffusion":
        return truncated_metric(kind, _diffusion_spectrum(surface, time), time)
    stiffness, areas = surface.operator.stiffness, surface.operator.areas
    biharmonic = kind == "biharmonic"
    check_memory(surface.mesh.name, len(areas), 2 * _AT_ONCE)

    with named(surface):
        if sources:
            green, diagonal = green_and_diagonal(stiffness, areas, biharmonic=biharmonic)
        else:
            green, diagonal = green_operator(stiffness, areas), None

    def product(block: FloatArray) -> FloatArray:
        once = green(block)
        return green((once.T * areas).T) if biharmonic else once

    gram = functools.partial(by_columns, product)

    def between(samples: IntArray) -> FloatArray:
        n = len(areas)
        column = np.empty((n if biharmonic else len(samples), len(samples)))
        for part in slices(len(samples), _AT_ONCE):
            some = by_columns(green, _indicators(samples[part], n))
            # K A K = (sqrt(A) K)^T (sqrt(A) K) needs the weights once.
            column[:, part] = some * np.sqrt(areas)[:, None] if biharmonic else some[samples]
        with one_blas_thread():
            kernel = inner(column, column) if biharmonic else column
        return _distances(kernel, kernel.diagonal(), kernel.diagonal())

    def from_sources(sources: IntArray) -> FloatArray:
        assert diagonal is not None  # these distances were asked for
        kernel, own = gram(_indicators(sources, len(areas))).T, np.arange(len(sources))
        # The kernel comes from solves. Its diagonal comes from the entries of the factor or, on a
        # small mesh, from other products.
        apart = float(np.abs(kernel[own, sources] - diagonal[sources]).max() / diagonal.max())
        if not apart <= _ROUNDING:
            raise SolverError(
                f"{surface.mesh.name}: two computations of the {kind} kernel differ by {apart:.1e} "
                "of its largest entry"
            )
        distances = _distances(kernel, diagonal[sources], diagonal)
        distances[own, sources] = 0.0  # but for rounding
        return distances

    return Metric(from_sources, between, gram)


def _distances(kernel: FloatArray, rows: FloatArray, columns: FloatArray) -> FloatArray:
    squared = rows[:, None] + columns[None, :] - 2 * kernel
    least, largest = float(squared.min()), float(columns.max())
    if not least >= -_ROUNDING * largest:
        raise SolverError(
            f"a squared distance came out at {least / largest:.1e} of the kernel's largest entry: "
            "the kernel is not positive semi-definite"
        )
    return np.asarray(np.sqrt(np.maximum(squared, 0.0)))


def _indicators(vertices: IntArray, n: int) -> FloatArray:
    block = np.zeros((n, len(vertices)))
    block[vertices, np.arange(len(vertices))] = 1.0
    return block


def _diffusion_spectrum(surface: Surface, time: float) -> Spectrum:
    """As many eigenpairs as a diffusion time can tell from zero."""
    most = min(surface.n_vertices, _MOST_EIGENPAIRS)
    # Weyl's law: eigenvalue number k of a surface of unit area is about 4 pi k.
    needed = float(-np.log(_NEGLIGIBLE)) / 2
    reach = needed / float(time)
    reached = (_MOST_EIGENPAIRS - 16) * 4 * np.pi / 1.2
    k = int(min(surface.n_vertices, 1.2 * reach / (4 * np.pi) + 16))
    while k <= most:
        spectrum = eigenpairs(surface, k)
        reached = spectrum.eigenvalues[-1] - spectrum.eigenvalues[1]
        if k == surface.n_vertices or reached > reach:
            return spectrum
        k = most if k < most < 2 * k else 2 * k
    raise InputError(
        f"a diffusion time of {time:.2g} of the area needs over {_MOST_EIGENPAIRS} eigenpairs; use "
        f"{_two_digits(needed / reached, np.ceil):g} of the area or more, or truncate with "
        "n_eigenpairs"
    )


def _two_digits(number: float, rounded: Callable[[float], float]) -> float:
    digit = 10.0 ** (np.floor(np.log10(number)) - 1)
    return float(rounded(number / digit) * digit)
