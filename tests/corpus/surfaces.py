"""Meshes that are read, but are no closed surface in one piece with proper triangles."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from unbend import write_mesh

from .case import Answer, Case, Refused, Seen
from .good import Command, beside, stone

Array = npt.NDArray[Any]
Compare = Callable[[Seen, Seen], str]
_FIELD = "distance bad.off --from 0 --from 30 --distance biharmonic -o field.npy --no-cache"
_FORM = "canonical bad.off --json --no-cache"
_LARGEST = "--component largest"
_ROBUST = "--laplacian robust"


def cases() -> Iterator[Case]:
    """Give a case for each kind of surface."""
    yield from _refused()
    yield from _left_out()
    yield from _kept()
    yield from _scaled()
    yield from _points()
    yield from _matched()


def _mesh(vertices: Any, faces: Any, name: str = "bad.off") -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        beside(folder)
        write_mesh(folder / name, (np.asarray(vertices, float), np.asarray(faces, int)))

    return make


def _stone(name: str = "bad.off") -> Callable[[Path], None]:
    return _mesh(stone().vertices, stone().faces, name)


# Comparisons. What is compared is the distances from two vertices to all others, which neither
# sign nor turn of the form changes, or the eigenvalues and the stress of the form.


def _same_field(tolerance: float, *, scale: float = 1.0) -> Compare:
    """Compare distances on the vertices that the mended mesh has; the others must be NaN."""

    def compare(seen: Seen, truth: Seen) -> str:
        found, right = (np.load(one.folder / "field.npy") for one in (seen, truth))
        assert np.isnan(found[len(right) :]).all(), "vertices that were left out have numbers"
        # Squares: what is computed is the square, whose error the root of a small one enlarges.
        return _near((found[: len(right)] / scale) ** 2, right**2, tolerance)

    return compare


def _same_form(tolerance: float) -> Compare:
    """Compare eigenvalues and stress; both are of the surface at unit area."""

    def compare(seen: Seen, truth: Seen) -> str:
        found, right = (
            np.array([*told["eigenvalues"], told["stress"]])
            for told in (json.loads(one.out)["files"][0] for one in (seen, truth))
        )
        return _near(found, right, tolerance)

    return compare


def _near(found: Array, right: Array, tolerance: float) -> str:
    np.testing.assert_array_equal(np.isnan(found), np.isnan(right))
    off = float(np.nanmax(np.abs(found - right)) / np.nanmax(np.abs(right)))
    assert off <= tolerance, f"differs by {off:.2g}, more than {tolerance:g}"
    return "the same to the last bit" if off == 0 else f"differs by {off:.0e}"


def _refused() -> Iterator[Case]:
    v, f = stone().vertices, stone().faces
    line = np.outer(np.arange(5.0), (1, 2, 3))
    fan = np.array([[0, i, i + 1] for i in range(1, 4)])
    for name, vertices, faces, sentence in (
        ("a single triangle", v[:3], [[0, 1, 2]], "only 3 vertices"),
        ("a point", np.zeros((1, 3)), [[0, 0, 0]], "every face is degenerate"),
        ("a segment", line[:2], [[0, 1, 0]], "every face is degenerate"),
        ("coordinates of 1e-170", v * 1e-170, f, "it is 3e-170 across"),
        ("coordinates of 1e+170", v * 1e170, f, r"it is 3e\+170 across"),
        ("all vertices on a line", line, fan, "every face is degenerate"),
        ("all vertices at one point", np.ones((5, 3)), fan, "every face is degenerate"),
        ("all faces name a vertex twice", v, f[:, [0, 0, 1]], "every face is degenerate"),
        ("two components", *_copies(2), "2 separate components"),
        ("five hundred components", *_copies(500), "500 separate components"),
    ):
        yield Case(f"surface, {name}", _mesh(vertices, faces), (_FORM, _FIELD), Refused(sentence))


def _copies(n: int) -> tuple[Array, Array]:
    """Give the stone and tetrahedra in a row, so many in all."""
    corners, sides = np.eye(4, 3), np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    shapes = [stone().vertices] + [corners + np.array([4.0 * i, 0, 0]) for i in range(1, n)]
    faces = [stone().faces] + [sides + 42 + 4 * i for i in range(n - 1)]
    return np.concatenate(shapes), np.concatenate(faces)


def _left_out() -> Iterator[Case]:
    """Give meshes of which a part is left out; the rest is as if that part were not there."""
    v, f = stone().vertices, stone().faces
    far = np.concatenate([v, [[9, 9, 9], [9, 9, 9]]])
    nowhere = np.concatenate([v, [[np.nan, 0, 0], [0, np.inf, 0]]])
    for name, vertices in (("isolated vertices", far), ("isolated vertices, NaN", nowhere)):
        answer = Answer(_stone(), _same_field(1e-12), "the answer without them, NaN for them")
        yield Case(f"surface, {name}", _mesh(vertices, f), (_FIELD,), answer)
    for n in (2, 500):
        yield Case(
            f"surface, the largest of {n} components",
            _mesh(*_copies(n)),
            (f"{_FIELD} {_LARGEST}",),
            Answer(_stone(), _same_field(1e-12), "the answer of it alone, NaN for the others"),
        )
    yield Case(
        "surface, vertices doubled along every edge",
        _mesh(v[np.sort(f.ravel())], np.argsort(np.argsort(f.ravel())).reshape(-1, 3)),
        (_FORM,),
        Answer(_stone(), _same_form(1e-6), "the form of the surface, joined"),
    )


def _kept() -> Iterator[Case]:
    """Give surfaces that are worked on as they are."""
    v, f = stone().vertices, stone().faces
    turned = np.where(np.arange(len(f))[:, None] % 3 == 0, f[:, ::-1], f)
    alike = Answer(_stone(), _same_field(1e-10))
    exact = f"{_FIELD} --distance geodesic-exact"
    geodesics = (_FIELD, f"{_FIELD} --distance geodesic", exact)
    repeated = np.concatenate([[[0, 0, 1]], f, [[5, 5, 5]]])
    for name, faces in (
        ("mixed winding", turned),
        ("faces inside out", f[:, ::-1]),
        ("faces in another order", f[::-1]),
        ("faces that name a vertex twice", repeated),
        ("a face twice", np.concatenate([f, f[:1]])),
        ("every face twice, inside out", np.concatenate([f, f[:, ::-1]])),
    ):
        yield Case(f"surface, {name}", _mesh(v, faces), geodesics, alike)
    yield from _slivers()
    yield from _odd_surfaces()


def _slivers() -> Iterator[Case]:
    """Cut an edge of the stone: the surface is the same, the triangles at the cut are not."""
    v, f = stone().vertices, stone().faces
    i, j, k = f[0]
    for name, at, tolerance in (
        ("a vertex on an edge, a face without area", 0.5, 1e-3),
        ("a needle of 1e-9 of its length", 1e-9, 1e-6),
    ):
        point = v[i] + at * (v[j] - v[i])
        vertices = np.concatenate([v, [point]])
        # The face beyond the edge keeps it: between the two lies a triangle without area.
        faces = np.concatenate([f[1:], [[i, 42, k], [42, j, k], [i, j, 42]]])
        yield Case(
            f"surface, {name}",
            _mesh(vertices, faces),
            (f"{_FIELD} {_ROBUST}",),
            Answer(_cut(at), _same_field(tolerance), "the answer of the mesh without it"),
        )


def _cut(at: float) -> Callable[[Path], None]:
    """Write the stone with the edge cut on both sides, as it should have been."""
    v, f = stone().vertices, stone().faces
    i, j, k = f[0]
    beyond = next(n for n, face in enumerate(f) if n and {i, j} <= set(face.tolist()))
    other = next(corner for corner in f[beyond] if corner not in (i, j))
    point = v[i] + at * (v[j] - v[i])
    kept = np.delete(f, [0, beyond], axis=0)
    faces = np.concatenate([kept, [[i, 42, k], [42, j, k], [j, 42, other], [42, i, other]]])
    return _mesh(np.concatenate([v, [point]]), faces)


def _odd_surfaces() -> Iterator[Case]:
    v, f = stone().vertices, stone().faces
    strip = _moebius()
    turned = strip[1].copy()
    turned[::2] = turned[::2, ::-1]
    yield Case(
        "surface, one-sided",
        _mesh(*strip),
        (_FIELD, _FORM),
        Answer(_mesh(strip[0], turned), _same(1e-9), "the same however its faces are turned"),
    )
    cap = f[(v[f][:, :, 2] > -0.2).all(axis=1)]
    used = np.unique(cap)
    number = np.full(42, -1)
    number[used] = np.arange(len(used))
    yield Case(
        "surface, open, with vertices that no face uses",
        _mesh(np.concatenate([v[used], v]), number[cap]),
        ("distance bad.off --from 0 -o field.npy --no-cache",),
        Answer(_mesh(v[used], number[cap]), _same_field(1e-10), "the answer without them"),
    )
    fin = np.concatenate([v, [v[f[0, 0]] * 1.5]])
    finned = np.concatenate([f, [[f[0, 0], f[0, 1], 42]]])
    yield Case(
        "surface, an edge of three faces",
        _mesh(fin, finned),
        (_FIELD,),
        Answer(_mesh(fin, finned[::-1]), _same_field(1e-9), "the same whatever the faces' order"),
    )
    twins, wings = _bow_tie()
    yield Case(
        "surface, two halves that share a vertex",
        _mesh(twins, wings),
        (_FORM,),
        Answer(_mesh(twins, wings[::-1, [1, 2, 0]]), _same_form(1e-9), "the same in another order"),
    )


def _same(tolerance: float) -> Compare:
    """Compare whichever the command gave."""

    def compare(seen: Seen, truth: Seen) -> str:
        how = _same_form if seen.out.startswith("{") else _same_field
        return how(tolerance)(seen, truth)

    return compare


def _moebius(n: int = 40) -> tuple[Array, Array]:
    """Give a strip with one side: three rows of vertices around, joined after half a turn."""
    angle = np.linspace(0, 2 * np.pi, n, endpoint=False)[:, None]
    across = np.array([-0.4, 0.0, 0.4])
    radius = 1 + across * np.cos(angle / 2)
    points = [radius * np.cos(angle), radius * np.sin(angle), across * np.sin(angle / 2)]
    faces = []
    for i in range(n):
        here, there = 3 * i + np.arange(3), 3 * ((i + 1) % n) + np.arange(3)
        if i == n - 1:
            there = there[::-1]
        for k in range(2):
            faces += [[here[k], there[k], here[k + 1]], [here[k + 1], there[k], there[k + 1]]]
    return np.stack(points, axis=2).reshape(-1, 3), np.array(faces)


def _bow_tie() -> tuple[Array, Array]:
    """Give two stones that have one vertex in common."""
    v, f = stone().vertices, stone().faces
    mirrored = 2 * v[0] - v[1:]
    faces = np.where(f == 0, 0, f + 41)
    return np.concatenate([v, mirrored]), np.concatenate([f, faces])


def _scaled() -> Iterator[Case]:
    v, f = stone().vertices, stone().faces
    for name, size in (("1e-30", 1e-30), ("1e+30", 1e30)):
        yield Case(
            f"surface, coordinates of {name}",
            _mesh(v * size, f),
            (_FORM,),
            Answer(_stone(), _same_form(1e-9), "the form of the mesh at size 1"),
        )
    # A biharmonic distance is measured in the unit of area.
    for name, size in (("1e-50", 1e-50), ("1e-30", 1e-30), ("1e+30", 1e30), ("1e+50", 1e50)):
        yield Case(
            f"surface, distances at coordinates of {name}",
            _mesh(v * size, f),
            (
                _FIELD,
                f"{_FIELD} --distance geodesic",
                f"{_FIELD} --distance geodesic-exact",
            ),
            Answer(
                _stone(),
                _same_field(1e-9, scale=size),
                "the distances at size 1, times the size",
            ),
        )
    yield Case(
        "surface, a million sizes away from the origin",
        _mesh(v + 1e6, f),
        (_FORM,),
        Answer(_stone(), _same_form(1e-6), "the form of the mesh at the origin"),
    )


def _points() -> Iterator[Case]:
    v = stone().vertices
    for name, vertices, sentence in (
        ("three points", v[:3], "only 3 different positions"),
        ("four points in one place", np.ones((4, 3)), "only 1 different position"),
        ("on one line", np.outer(np.arange(42.0), [1, 2, 3]), "span no surface"),
    ):
        yield Case(f"point cloud, {name}", _cloud(vertices), _clouds(), Refused(sentence))
    yield Case(
        "point cloud, points that repeat",
        _cloud(np.concatenate([v, v[:5]])),
        (f"{_clouds()[0]} --weighting area",),
        Answer(_cloud(v), _same_form(0.01), "about the form of the points without repetitions"),
    )
    yield Case(
        "point cloud, a million sizes away from the origin",
        _cloud(v + 1e6),
        _clouds()[:1],
        Answer(_cloud(v), _same_form(1e-6), "the form of the cloud at the origin"),
    )
    yield Case(
        "point cloud, coordinates of 1e+30",
        _cloud(v * 1e30),
        _clouds()[:1],
        Answer(_cloud(v), _same_form(1e-6), "the form of the cloud at size 1"),
    )


def _matched() -> Iterator[Case]:
    """Match the stone to itself, damaged: the vertices left out have no partner."""
    v, f = stone().vertices, stone().faces
    command = "match good.off bad.off -o out.txt --no-cache"
    strip = _moebius()
    yield Case("match, one-sided", _mesh(*strip), (command,), Refused("only one side"))
    turned = np.where(np.arange(len(f))[:, None] % 3 == 0, f[:, ::-1], f)
    n = len(v)
    small = np.concatenate([v, stone().vertices[:12] / 9 + 7]), [[0, 1, 2], [0, 2, 3], [0, 3, 1]]
    for name, vertices, faces in (
        ("mixed winding", v, turned),
        ("isolated vertices and doubled faces", small[0], np.concatenate([f, f[:9], [[3, 3, n]]])),
        ("a second component", small[0], np.concatenate([np.add(small[1], n), f])),
    ):
        yield Case(
            f"match, {name}",
            _mesh(vertices, faces),
            (command,),
            Answer(_stone(), _same_text("out.txt"), "the map to the mended mesh"),
        )


def _same_text(name: str) -> Compare:
    def compare(seen: Seen, truth: Seen) -> str:
        assert (seen.folder / name).read_text() == (truth.folder / name).read_text()
        return "the same map"

    return compare


def _cloud(points: Array) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        beside(folder)
        write_mesh(folder / "bad.xyz", points)

    return make


def _clouds() -> tuple[Command, ...]:
    return (
        "canonical bad.xyz --json --no-cache",
        "distance bad.xyz --from 0 -o field.npy --no-cache",
    )
