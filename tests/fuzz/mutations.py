"""Small meshes, broken step by step, through forms, distances, matches and transfer."""

import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from corpus.good import stone
from unbend import Mesh, canonical_form, distance, match, transfer
from unbend.errors import UnbendError, UnbendWarning
from unbend.spectral import use_cache

_Array = npt.NDArray[Any]
_Arrays = tuple[_Array, _Array]


@use_cache(gib=0)
def shapes(data: bytes) -> None:
    """Break a mesh as the bytes say, four a step, and compute with what is left."""
    vertices, faces = stone().vertices.copy(), stone().faces.copy()
    for i in range(0, min(len(data) - 3, 64), 4):
        step, *numbers = data[i : i + 4]
        vertices, faces = _STEPS[step % len(_STEPS)](vertices, faces, *numbers)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", UnbendWarning)
        try:
            mesh = Mesh(vertices, faces if len(faces) else None)
        except UnbendError:
            return
        _check_form(mesh)
        _check_distance(mesh)
        _check_match(mesh)


def seeds(family: str) -> Iterator[bytes]:
    """Give some steps at random, more and more of them."""
    for i in range(48):
        yield np.random.default_rng(i).bytes(4 * (1 + i % 12))


def _check_form(mesh: Mesh) -> None:
    try:
        form = canonical_form(mesh, component="largest")
    except UnbendError:
        return
    assert form.points.shape == (mesh.n_vertices, 3)
    assert np.isfinite(form.points).all(axis=1).sum() >= 4
    assert (form.eigenvalues >= 0).all()
    assert np.isfinite(form.stress)


def _check_distance(mesh: Mesh) -> None:
    sources = [0, mesh.n_vertices - 1]
    try:
        rows = distance(mesh, sources, distance="biharmonic", component="largest")
    except UnbendError:
        return
    largest = np.nanmax(rows)
    assert np.isfinite(largest)
    assert np.nanmin(rows) >= 0
    # The square is computed: what is 0 may be the root of its rounding.
    assert np.allclose(rows[[0, 1], sources], 0, atol=1e-6 * largest)
    assert np.isclose(rows[0, sources[1]], rows[1, sources[0]], atol=1e-6 * largest)


def _check_match(mesh: Mesh) -> None:
    try:
        found = match(mesh, stone(), n_eigenpairs=10, refine=False)
        carried = transfer(np.linspace(0, 1, mesh.n_vertices), found, source=mesh, target=stone())
    except UnbendError:
        return
    assert found.source_to_target.shape == (mesh.n_vertices,)
    assert found.source_to_target.max() < stone().n_vertices
    assert np.nanmin(carried, initial=0) >= -1e-9
    assert np.nanmax(carried, initial=1) <= 1 + 1e-9


def _vertex(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    """Move a vertex onto another."""
    v[i % len(v)] = v[j % len(v)]
    return v, f


def _edge(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    """Move a vertex onto the line between two others, or next to one of them."""
    share = 0.5 if k < 128 else 10.0 ** -(k % 17)
    v[i % len(v)] = v[j % len(v)] + share * (v[k % len(v)] - v[j % len(v)])
    return v, f


def _scale(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    """Scale one axis, or all, by a power of ten."""
    factor = 10.0 ** ((i % 81) - 40)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        v[:, (j % 3 if k % 2 else slice(None))] *= factor
    return v, f


def _shift(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    v[:, j % 3] += 10.0 ** (i % 12)
    return v, f


def _index(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    """Let a corner be another vertex, at times one that is not there."""
    if len(f):
        f[i % len(f), j % 3] = k - 2 if k < 4 else k % len(v)
    return v, f


def _turn(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    f[i % max(len(f), 1) :: j % 5 + 1] = f[i % max(len(f), 1) :: j % 5 + 1, ::-1]
    return v, f


def _drop(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    start = i % max(len(f), 1)
    return v, np.delete(f, slice(start, start + j % 80), axis=0)


def _double(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    return v, np.concatenate([f, f[i % max(len(f), 1) :][: j % 20]])[:400]


def _weld(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    """Let faces use another vertex in place of one."""
    f[f == i % len(v)] = j % len(v)
    return v, f


def _tear(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    """Give a face its own copy of a corner."""
    if len(f) and len(v) < 200:
        v = np.concatenate([v, v[f[i % len(f), j % 3]][None]])
        f[i % len(f), j % 3] = len(v) - 1
    return v, f


def _add(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    """Add vertices that no face uses, NaN at times, or a tetrahedron."""
    if len(v) > 200:
        return v, f
    if i % 3 == 0:
        return np.concatenate([v, np.full((1, 3), np.nan if j % 2 else j)]), f
    corners = np.eye(4, 3) * 10.0 ** (j % 9 - 4) + k
    sides = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]) + len(v)
    return np.concatenate([v, corners]), np.concatenate([f, sides])


def _fin(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    """Add a face between any three vertices."""
    return v, np.concatenate([f, [[i % len(v), j % len(v), k % len(v)]]])[:400]


def _flat(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    v[:, i % 3] = 0
    return v, f


def _noise(v: _Array, f: _Array, i: int, j: int, k: int) -> _Arrays:
    size = 10.0 ** -(i % 17) * np.nanmax(np.abs(v))
    if np.isfinite(size):
        v += size * np.random.default_rng(j).standard_normal(v.shape)
    return v, f


_STEPS: tuple[Callable[..., _Arrays], ...] = (
    _vertex,
    _edge,
    _scale,
    _shift,
    _index,
    _turn,
    _drop,
    _double,
    _weld,
    _tear,
    _add,
    _fin,
    _flat,
    _noise,
)
