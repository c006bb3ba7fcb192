"""Spectral interpolation: from values at samples to smooth functions on the whole surface.

With eigenfunctions Phi (n, k), eigenvalues Lambda, p samples and smoothness weight mu: Phi_P are
the rows of Phi at the samples, S = Phi_P^T Phi_P. The equations are those of Yang, Obaseki and Chen
(GRAPP 2019), Eq. 8 to 15, without the slips of the printed ones, after Aflalo and Kimmel (2013).
"""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import numpy.typing as npt
import scipy.linalg
from scipy.sparse.linalg import LinearOperator, cg

from unbend._arrays import check_choice, is_number, numbers_of
from unbend._types import FloatArray, IntArray
from unbend.choices import Interpolation
from unbend.errors import InputError, SolverError
from unbend.mesh import vertex_ids
from unbend.spectral import Spectrum

# Eq. 14 is solved until its residual is this small, relative to its right-hand side.
_TOLERANCE = 1e-12
_CONSTANT = 1e-6  # a constant must be reproduced up to this error
_SINGULAR = 1e-12  # a pivot below this share of its diagonal entry is lost in rounding
_UNDETERMINED = (
    "the samples do not determine the interpolation; "
    "use more samples than eigenpairs, or a smaller mu"
)


def interpolation_operator(spectrum: Spectrum, samples: IntArray, mu: float) -> FloatArray:
    """M (k, p) of Eq. 11, from values at samples to coefficients of eigenfunctions.

    ``M = mu (Lambda + mu S)^-1 Phi_P^T`` minimises ``a^T Lambda a + mu |Phi_P a - f|^2``.
    """
    at_samples, gram = _at_samples(spectrum, samples, mu)
    system = mu * gram + np.diag(spectrum.eigenvalues)
    operator: FloatArray = mu * scipy.linalg.cho_solve(_factor(system), at_samples.T)
    ones = np.ones(len(samples))
    missed = float(np.abs(at_samples @ (operator @ ones) - ones).max())
    if not missed <= _CONSTANT:
        raise SolverError(
            f"interpolation misses a constant by {missed:.1e}: these are not the eigenpairs of a "
            "surface, or the samples do not determine it"
        )
    return operator


def interpolate(
    values: npt.ArrayLike, samples: npt.ArrayLike, spectrum: Spectrum, *, mu: float = 1e4
) -> FloatArray:
    """Smooth functions on the whole surface from their values at samples (Eq. 8 to 11).

    Parameters
    ----------
    values : (p,) or (p, c) array_like of float
        One column per function.
    samples : (p,) array_like of int
        Vertex ids of the values.
    spectrum : Spectrum
        Eigenpairs of the surface.
    mu : float, default=1e4
        Weight of the values against smoothness, at unit area: larger follows them closer.

    Returns
    -------
    (n,) or (n, c) ndarray of float64

    Raises
    ------
    InputError
        If `spectrum` is not a Spectrum, `mu` is not positive, a sample is not a vertex in use, or
        there is not one row of finite numbers for each.
    SolverError
        If the samples do not determine the functions, or a constant is not reproduced.

    Examples
    --------
    A constant is reproduced from any samples:

    >>> import numpy as np
    >>> from unbend import spectrum
    >>> from unbend.canonical import interpolate
    >>> from unbend.datasets import make_sphere
    >>> found = interpolate(np.full(12, 7.0), np.arange(12), spectrum(make_sphere(2), 9))
    >>> bool(np.allclose(found, 7.0))
    True
    """
    if not isinstance(spectrum, Spectrum):
        raise InputError(f"interpolate needs a Spectrum, not {type(spectrum).__name__}")
    area = spectrum.areas.sum()
    unit = replace(
        spectrum,
        eigenvalues=spectrum.eigenvalues * area,
        eigenfunctions=spectrum.eigenfunctions * np.sqrt(area),
        areas=spectrum.areas / area,
    )
    ids = vertex_ids(samples, len(spectrum.areas), "samples")
    operator = interpolation_operator(unit, ids, mu)
    rows = numbers_of(values, "values to interpolate")
    if rows.ndim not in (1, 2):
        raise InputError(f"values must have one row for each sample, not shape {rows.shape}")
    if len(rows) != len(ids):
        raise InputError(f"there are {len(rows)} values for {len(ids)} samples")
    finite = np.isfinite(rows.reshape(len(ids), -1)).all(axis=1)
    if not finite.all():
        raise InputError(f"value {int(finite.argmin())} is not finite; leave its sample out")
    return np.asarray(unit.eigenfunctions @ (operator @ rows))


def distance_coefficients(
    squared: FloatArray,
    samples: IntArray,
    spectrum: Spectrum,
    *,
    mu: float = 1e4,
    interpolation: Interpolation = "projection",
) -> FloatArray:
    """Interpolate squared distances (p, p): alpha (k, k) of ``D = Phi alpha Phi^T``.

    ``"projection"`` is Eq. 15, rows and columns interpolated one after the other.
    ``"least-squares"`` is Eq. 14, both at once, where the whole energy is stationary:
    ``Lambda alpha + alpha Lambda + mu S alpha S = mu Phi_P^T D Phi_P``. The spectrum is at unit
    area.
    """
    check_choice(interpolation, "interpolation", get_args(Interpolation))
    if interpolation == "projection":
        operator = interpolation_operator(spectrum, samples, mu)
        coefficients: FloatArray = operator @ squared @ operator.T
    else:
        coefficients = _least_squares(squared, samples, spectrum, mu)
    return (coefficients + coefficients.T) / 2


def _least_squares(
    squared: FloatArray, samples: IntArray, spectrum: Spectrum, mu: float
) -> FloatArray:
    """Conjugate gradients on the (k, k) matrix equation, in O(k^3) a step."""
    at_samples, gram = _at_samples(spectrum, samples, mu)
    values, shape = spectrum.eigenvalues, gram.shape
    smoothness = values[:, None] + values[None, :]

    def apply(flat: FloatArray) -> FloatArray:
        alpha = flat.reshape(shape)
        return (smoothness * alpha + mu * (gram @ alpha @ gram)).ravel()

    # A Kronecker product close to the operator: exact but for Lambda Lambda / mu where the
    # samples are spread so evenly that S is a multiple of the identity.
    evenness = gram.trace() / len(gram)
    factor = _factor(np.sqrt(mu) * gram + np.diag(values) / (np.sqrt(mu) * evenness))

    def precondition(residual: FloatArray) -> FloatArray:
        once = scipy.linalg.cho_solve(factor, residual.reshape(shape))
        return np.asarray(scipy.linalg.cho_solve(factor, once.T).ravel())

    target = (mu * (at_samples.T @ squared @ at_samples)).ravel()
    system, inverse = (
        LinearOperator((len(target),) * 2, work, dtype=float) for work in (apply, precondition)
    )
    steps = {"rtol": _TOLERANCE, "atol": 0.0, "maxiter": 20 * len(values)}
    alpha, unsettled = cg(system, target, precondition(target), M=inverse, **steps)
    if unsettled:
        raise SolverError(_UNDETERMINED)
    return np.asarray(alpha.reshape(shape))


def _factor(system: FloatArray) -> tuple[FloatArray, bool]:
    try:
        factor: tuple[FloatArray, bool] = scipy.linalg.cho_factor(system)
    except scipy.linalg.LinAlgError:
        raise SolverError(_UNDETERMINED) from None
    if (factor[0].diagonal() ** 2 < _SINGULAR * system.diagonal()).any():
        raise SolverError(_UNDETERMINED)
    return factor


def _at_samples(spectrum: Spectrum, samples: IntArray, mu: float) -> tuple[FloatArray, FloatArray]:
    if not is_number(mu) or not 0 < mu < np.inf:
        raise InputError(f"mu must be positive, not {mu!r}")
    at_samples = spectrum.eigenfunctions[samples]
    if not np.isfinite(at_samples).all():
        raise InputError("a sample is a vertex that no face uses")
    return at_samples, at_samples.T @ at_samples
