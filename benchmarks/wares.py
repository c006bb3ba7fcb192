"""Wares with exact surfaces: turned, toothed, and put together of boxes, some of them open."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import CubicSpline

from unbend._types import FloatArray, IntArray

Part = tuple[FloatArray, IntArray]
_STEP = 0.045


def _merged(points: FloatArray, faces: IntArray) -> Part:
    points, number = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    faces = number.ravel()[faces]
    proper = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    return points, faces[proper]


def _sheet(n_rows: int, n_columns: int, *, ring: bool) -> IntArray:
    """Triangles between rows of points; columns go round, rows too if they are a ring."""
    i, j = np.divmod(np.arange((n_rows if ring else n_rows - 1) * n_columns), n_columns)
    below, beside = (i + 1) % n_rows, (j + 1) % n_columns
    a, b = i * n_columns + j, i * n_columns + beside
    c, d = below * n_columns + j, below * n_columns + beside
    return np.concatenate([np.column_stack([a, b, c]), np.column_stack([b, d, c])])


def turned(profile: Sequence[tuple[float, float]], n: int = 36) -> Part:
    """Turn a profile of radii and heights about the y axis; open where it ends off the axis."""
    line = np.array(profile, float)
    along = np.append(0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    steps = np.linspace(0, along[-1], max(8, int(along[-1] / _STEP)))
    radius, height = (np.interp(steps, along, column)[:, None] for column in line.T)
    angle = np.arange(n) * 2 * np.pi / n
    rows = np.broadcast_arrays(radius * np.cos(angle), height, radius * np.sin(angle))
    points = np.stack(rows, axis=-1).reshape(-1, 3)
    return _merged(points, _sheet(len(steps), n, ring=False))


def tube(line: FloatArray, radius: float, n: int = 10) -> Part:
    """Make a tube, open at its ends, along a line in the plane z = 0."""
    ways = np.gradient(line, axis=0)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    sides = np.cross(ways, [0, 0, 1.0])
    angle = np.arange(n) * 2 * np.pi / n
    across = np.cos(angle)[:, None] * sides[:, None] + np.sin(angle)[:, None] * [0, 0, 1.0]
    return (line[:, None] + radius * across).reshape(-1, 3), _sheet(len(line), n, ring=False)


def block(size, middle=(0.0, 0.0, 0.0), n: int = 9) -> Part:
    """Make a box, each side a grid of n by n points."""
    step = np.linspace(-0.5, 0.5, n)
    grid = np.stack(np.meshgrid(step, step, indexing="ij"), axis=-1).reshape(-1, 2)
    corner = np.add.outer(np.arange(n - 1) * n, np.arange(n - 1)).ravel()
    sides = [corner, corner + 1, corner + n], [corner + 1, corner + n + 1, corner + n]
    one = np.concatenate([np.column_stack(side) for side in sides])
    points = [np.insert(grid, axis, s, axis=1) for axis in range(3) for s in (-0.5, 0.5)]
    faces = [one + k * n * n for k in range(6)]
    points, faces = _merged(np.concatenate(points), np.concatenate(faces))
    return points * size + middle, faces


def mug(chance: np.random.Generator) -> list[Part]:
    r, h, foot = chance.uniform(0.3, 0.45), chance.uniform(0.6, 1.0), chance.uniform(0.8, 1.15)
    inner = [(r, h), (r - 0.04, h), (r * foot - 0.04, 0.04), (0, 0.04)]
    angle, high = np.linspace(-np.pi / 2, np.pi / 2, 16), h * 0.35 * chance.uniform(0.6, 0.8)
    handle = [r * 0.97 + h * 0.3 * np.cos(angle), h / 2 + high * np.sin(angle), 0 * angle]
    body = turned([(0, 0), (r * foot, 0), *inner])
    return [body, tube(np.column_stack(handle), chance.uniform(0.035, 0.05))]


def vase(chance: np.random.Generator) -> list[Part]:
    h, foot = chance.uniform(0.8, 1.4), chance.uniform(0.15, 0.3)
    belly, neck = chance.uniform(0.25, 0.5), chance.uniform(0.1, 0.22)
    share = np.linspace(0, 1, 9)
    radii = CubicSpline([0, 0.35, 0.8, 1], [foot, belly, neck, 1.5 * neck])(share)
    outside = [(0.0, 0.0), *zip(radii, h * share, strict=True)]
    if chance.uniform() < 0.5:
        return [turned(outside)]
    inside = [*zip(radii[:0:-1] - 0.03, h * share[:0:-1], strict=True), (0, 0.03)]
    return [turned([*outside, *inside])]


def bottle(chance: np.random.Generator) -> list[Part]:
    r, h = chance.uniform(0.18, 0.3), chance.uniform(0.9, 1.3)
    neck = r * chance.uniform(0.3, 0.45)
    return [turned([(0, 0), (r, 0), (r, h * 0.6), (neck, h * 0.75), (neck, h), (0, h)])]


def gear(chance: np.random.Generator) -> list[Part]:
    teeth, r, width = chance.integers(8, 16), chance.uniform(0.4, 0.6), chance.uniform(0.1, 0.25)
    hole, depth = chance.uniform(0.1, 0.2), chance.uniform(0.06, 0.1)
    angle = np.arange(8 * teeth) * np.pi / 4 / teeth
    outer = r + depth * np.clip(2 * np.sin(teeth * angle), -1, 1)
    in_out, across = np.linspace(0, 1, 6), np.linspace(-0.5, 0.5, 4)
    rows = [(share, -0.5) for share in in_out] + [(1, y) for y in across[1:]]
    rows += [(share, 0.5) for share in in_out[-2::-1]] + [(0, y) for y in across[-2:0:-1]]
    points = []
    for share, y in rows:
        radius = hole + (outer - hole) * share
        height = np.full(len(angle), y * width)
        points.append(np.column_stack([radius * np.cos(angle), height, radius * np.sin(angle)]))
    return [(np.concatenate(points), _sheet(len(rows), len(angle), ring=True))]


def box(chance: np.random.Generator) -> list[Part]:
    return [block(chance.uniform(0.4, 1, 3), n=16)]


def shelf(chance: np.random.Generator) -> list[Part]:
    w, h, d = chance.uniform(0.6, 1), chance.uniform(1, 1.6), chance.uniform(0.25, 0.4)
    parts = [block((0.04, h, d), (s * w / 2, h / 2, 0)) for s in (-1, 1)]
    parts += [block((w, 0.04, d), (0, y, 0)) for y in np.linspace(0, h, chance.integers(4, 6))]
    if chance.uniform() < 0.5:
        parts.append(block((w, h, 0.02), (0, h / 2, -d / 2)))
    return parts


def car(chance: np.random.Generator) -> list[Part]:
    length, w, h = chance.uniform(1.4, 2), chance.uniform(0.6, 0.8), chance.uniform(0.25, 0.4)
    r, cabin = chance.uniform(0.15, 0.22), length * chance.uniform(0.45, 0.6)
    parts = [block((length, h, w), (0, h / 2, 0), 14)]
    parts.append(block((cabin, h * 0.9, w * 0.9), (-0.05 * length, h * 1.45, 0), 10))
    wheel, faces = turned([(0, -0.06), (r, -0.06), (r, 0.06), (0, 0.06)], 24)
    for x in (-1, 1):
        for z in (-1, 1):
            parts.append((wheel[:, [0, 2, 1]] + [x * length * 0.32, 0, z * w / 2], faces[:, ::-1]))
    return parts


WARES: dict[str, Callable[[np.random.Generator], list[Part]]] = {
    one.__name__: one for one in (mug, vase, bottle, gear, box, shelf, car)
}
