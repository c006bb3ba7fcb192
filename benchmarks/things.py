"""Things of 22 kinds, each of its own random proportions: for descriptors, not for matching.

Creatures and furniture are rounded cones, grown together to one closed surface or, one time in
four, left as pieces that overlap; turned ware, gears, boxes and what is put together of them are
exact. Sizes and directions are random. Nothing here follows a public collection's shapes.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import fast_simplification
import numpy as np
import scipy.sparse as sp

from unbend import Mesh
from unbend._types import FloatArray, IntArray
from unbend.datasets._cones import Cones
from unbend.datasets._surface import surface_net
from unbend.mesh import edge_ends

Part = tuple[FloatArray, IntArray]
PIECES = 0.25  # share of the bodies that are left in pieces
_BLEND, _FINEST = 0.012, 0.012


class Body:
    """Rounded cones, and the chance that they are drawn with."""

    def __init__(self, chance: np.random.Generator) -> None:
        self.chance = chance
        self.draw = chance.uniform
        self.rows: list[tuple[FloatArray, FloatArray, float, float, FloatArray, float, int]] = []
        self.chain = 0

    def path(self, points, radii, flat=(1.0, 0.0, 0.0), factor: float = 1.0) -> None:
        """Cones along points, flattened along a direction by a factor."""
        flat = np.array(flat) / np.linalg.norm(flat)
        for (a, b), (p, q) in zip(pairwise(points), pairwise(radii), strict=True):
            ends = np.array(a, float), np.array(b, float)
            self.rows.append((*ends, p, q, flat, factor - 1, self.chain))
        self.chain += 1

    def cone(self, head, tail, radius, end=None, flat=(1.0, 0.0, 0.0), factor=1.0) -> None:
        """Make a single cone."""
        self.path([head, tail], [radius, radius if end is None else end], flat, factor)

    def limb(self, start, way, length, n, radius, end, bend, axis=None) -> None:
        """`n` cones in a row, each bent from the one before about an axis."""
        way = np.array(way, float) / np.linalg.norm(way)
        if axis is None:
            axis = self.chance.normal(size=3)
            axis -= axis @ way * way
            axis /= np.linalg.norm(axis)
        axis, points = np.array(axis, float), [np.array(start, float)]
        for i in range(n):
            angle = bend * self.draw(0.5, 1.2) * (i > 0)
            cross = np.cross(axis, way)
            way = (
                way * np.cos(angle)
                + cross * np.sin(angle)
                + axis @ way * (1 - np.cos(angle)) * axis
            )
            points.append(points[-1] + way * length / n)
        self.path(points, np.linspace(radius, end, n + 1))

    def ring(self, middle, radius, thick, n=20, squeeze=1.0) -> None:
        """Make a ring in the plane z = 0."""
        angle = np.linspace(0, 2 * np.pi, n + 1)
        round_ = np.column_stack([np.cos(angle), squeeze * np.sin(angle), 0 * angle])
        self.path(np.add(middle, radius * round_), [thick] * (n + 1))


def hand(b: Body) -> None:
    w, length = b.draw(0.2, 0.26), b.draw(0.35, 0.5)
    b.cone((0, 0, 0), (0, 0.3, 0), w * 0.8, w, (0, 0, 1), 2.2)
    b.cone((0, -0.35, 0), (0, 0, 0), 0.1, 0.12)
    for x, share in zip(np.linspace(-w, w, 4) * 0.8, (1, 1.12, 1.05, 0.8), strict=True):
        way = (0.6 * x + b.draw(-0.05, 0.05), 1, b.draw(-0.1, 0.1))
        b.limb((x, 0.42, 0), way, length * share, 3, 0.06, 0.045, b.draw(0, 0.8), (1, 0, 0))
    way = (0.9, 0.7, b.draw(0, 0.6))
    b.limb((w * 0.8, 0.05, 0), way, 0.8 * length, 2, 0.07, 0.055, b.draw(0, 0.6))


def ant(b: Body) -> None:
    g, length = b.draw(0.8, 1.3), b.draw(0.7, 1)
    for z, end, r, q in ((-0.55, -0.4, 0.2, 0.17), (-0.1, 0.12, 0.1, 0.12), (0.4, 0.5, 0.14, 0.12)):
        b.cone((0, 0, z), (0, 0, end), r * g, q * g)
    b.cone((0, 0, -0.4), (0, 0, 0.4), 0.05)
    for s in (-1, 1):
        for z in np.linspace(-0.12, 0.15, 3):
            way = (s, b.draw(0.2, 0.5), 2 * z + b.draw(-0.2, 0.2))
            b.limb((s * 0.08, 0, z), way, length, 3, 0.035, 0.022, b.draw(0.3, 0.7), (0, 0, -s))
        way = (s * 0.5, 0.4, 1)
        b.limb((s * 0.05, 0.05, 0.55), way, length / 2, 2, 0.025, 0.018, b.draw(0.1, 0.5))


def spider(b: Body) -> None:
    b.cone((0, 0, -0.4), (0, 0, -0.3), 0.25, 0.22)
    b.cone((0, 0, 0), (0, 0, 0.1), 0.14, 0.13)
    b.cone((0, 0, -0.3), (0, 0, 0), 0.07)
    length = b.draw(0.9, 1.2)
    for s in (-1, 1):
        for z in np.linspace(-0.1, 0.15, 4):
            way = (s, b.draw(0.4, 0.7), 4 * z)
            b.limb((s * 0.1, 0, z), way, length, 3, 0.035, 0.02, b.draw(0.5, 0.9), (0, 0, -s))


def octopus(b: Body) -> None:
    b.cone((0, 0.1, 0), (0, 0.4, 0), 0.2, 0.25)
    length = b.draw(0.9, 1.3)
    for angle in np.arange(8) * np.pi / 4:
        x, z = np.cos(angle), np.sin(angle)
        way = (x, b.draw(-0.6, 0.1), z)
        b.limb((0.12 * x, 0, 0.12 * z), way, length, 6, 0.07, 0.025, b.draw(-0.35, 0.35))


def bird(b: Body) -> None:
    g, rise = b.draw(0.8, 1.2), b.draw(-0.5, 0.6)
    b.cone((0, 0, -0.25), (0, 0.02, 0.2), 0.1 * g, 0.15 * g)
    b.cone((0, 0.1, 0.42), (0, 0.1, 0.45), 0.1)
    b.cone((0, 0.02, 0.2), (0, 0.1, 0.42), 0.1, 0.08)
    b.cone((0, 0.1, 0.5), (0, 0.08, 0.68), 0.04, 0.012)
    b.cone((0, 0, -0.3), (0, 0, -0.65), 0.07, 0.13, (0, 1, 0), 3)
    for s in (-1, 1):
        w = b.draw(0.8, 1)
        tip = (s * w, 0.6 * np.sin(rise), -0.1 + b.draw(-0.2, 0.1))
        wing = [(s * 0.05, 0.05, 0.05), (s * 0.45 * w, 0.45 * np.sin(rise), 0.1), tip]
        b.path(wing, [0.12, 0.12, 0.05], (0, 1, -0.1), 3.5)


def plane(b: Body) -> None:
    length, r = b.draw(0.8, 1.1), b.draw(0.07, 0.11)
    swept, span, engines = b.draw(0, 0.6), b.draw(0.7, 1.1), b.draw(0, 1) > 0.5
    b.cone((0, 0, -length), (0, 0, length), r * 0.7, r)
    for s in (-1, 1):
        b.cone((s * 0.03, 0, 0.1), (s * span, 0.04, 0.1 - swept), 0.16, 0.07, (0, 1, 0), 4)
        tail = (s * span * 0.35, 0, -length * 0.95 - swept * 0.3)
        b.cone((s * 0.03, 0, -length * 0.9), tail, 0.09, 0.05, (0, 1, 0), 3)
        if engines:
            b.cone((s * span * 0.4, -0.09, 0.15), (s * span * 0.4, -0.09, -0.1), 0.06, 0.05)
    b.cone((0, 0.03, -length * 0.9), (0, 0.35, -length), 0.1, 0.05, (1, 0, 0), 3)


def fish(b: Body) -> None:
    high, bend, flat = b.draw(0.16, 0.3), b.draw(-0.5, 0.5), b.draw(1.5, 2.2)
    angles = np.arange(1, 6) * bend / 4
    steps = 0.25 * np.column_stack([-np.sin(angles), 0 * angles, -np.cos(angles)])
    spine = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    b.path(spine, high * np.array([0.35, 0.9, 1, 0.7, 0.4, 0.2]), (1, 0, 0), flat)
    for s in (-1, 1):
        b.cone(spine[-1], spine[-1] + [0, s * 0.22, -0.22], 0.06, 0.07, (1, 0, 0), 2.5)
        fin = [s * high * 0.4, -high * 0.3, 0], [s * high * 0.9, -high * 0.7, -0.15]
        b.cone(spine[1] + fin[0], spine[1] + fin[1], 0.05, 0.06, (0, 1, 0), 2)
    b.cone(spine[2] + [0, high * 0.8, 0], spine[3] + [0, high * 1.1, 0], 0.1, 0.06, (1, 0, 0), 3)


def teddy(b: Body) -> None:
    g = b.draw(0.85, 1.2)
    b.cone((0, 0, 0), (0, 0.3, 0), 0.3 * g, 0.25 * g)
    b.cone((0, 0.72, 0), (0, 0.76, 0.02), 0.24 * g, 0.22 * g)
    b.cone((0, 0.7, 0.2), (0, 0.7, 0.28), 0.1, 0.08)
    for s in (-1, 1):
        b.cone((s * 0.2 * g, 0.95, 0), (s * 0.22 * g, 0.98, 0), 0.09, 0.09, (0, 0, 1), 1.6)
        way = (s, b.draw(-0.8, 0.4), b.draw(0, 0.8))
        b.limb((s * 0.22 * g, 0.4, 0), way, b.draw(0.35, 0.45), 2, 0.12, 0.1, 0.2)
        way = (s * 0.4, b.draw(-1, -0.2), b.draw(0, 1))
        b.limb((s * 0.18 * g, -0.15, 0), way, b.draw(0.35, 0.5), 2, 0.14, 0.12, 0.2)


def chair(b: Body) -> None:
    w, low, high = b.draw(0.35, 0.5), b.draw(0.5, 0.8), b.draw(0.5, 0.9)
    r, t, style = b.draw(0.035, 0.05), 0.05 * b.draw(0.7, 1.2), b.chance.integers(3)
    slats = np.linspace(-w, w, 7)
    for x in slats:
        b.cone((x, 0, -w), (x, 0, w), t)
    for x in (-w, w):
        for z in (-w, w):
            b.cone((x * 0.95, 0, z * 0.95), (x, -low, z), r)
    posts = {0: slats, 1: (-w, 0, w), 2: (-w, w)}[int(style)]
    for x in posts:
        b.cone((x, 0, -w), (x, high, -w * 1.1), t if style == 0 else r)
    for y in {0: [], 1: [high], 2: np.linspace(high * 0.4, high, 3)}[int(style)]:
        b.cone((-w, y, -w * 1.09), (w, y, -w * 1.09), r * 1.3)


def table(b: Body) -> None:
    w, d, h = b.draw(0.5, 0.9), b.draw(0.35, 0.6), b.draw(0.4, 0.7)
    r, t = b.draw(0.03, 0.06), b.draw(0.04, 0.06)
    for x in np.arange(-d, d + 0.01, 0.08):
        b.cone((x, 0, -w), (x, 0, w), t)
    if b.draw(0, 1) < 0.75:
        for x in (-d, d):
            for z in (-w, w):
                b.cone((x * 0.9, 0, z * 0.9), (x * 0.9, -h, z * 0.9), r)
        return
    b.cone((0, 0, 0), (0, -h, 0), r * 1.6)
    for x, z in ((1, 0), (0, 1), (-1, 0), (0, -1)):
        b.cone((0, -h, 0), (0.6 * d * x, -h * 1.05, 0.6 * d * z), r)


def glasses(b: Body) -> None:
    radius, r, gap = b.draw(0.22, 0.3), b.draw(0.025, 0.04), b.draw(0.08, 0.14)
    length, squeeze, fold = b.draw(0.9, 1.2), b.draw(0.7, 1), b.draw(0, 0.5)
    deep = length * np.sqrt(1 - 0.5 * fold**2)
    for s in (-1, 1):
        b.ring((s * (radius + gap / 2 + 0.02), 0, 0), radius, r, squeeze=squeeze)
        x = s * (2 * radius + gap / 2 + 0.02)
        ends = [(x, 0.05, 0), (x - s * fold * 0.9, 0.05, -0.9 * deep), (x - s * fold, -0.1, -deep)]
        b.path(ends, [r, r, r * 1.2])
    b.cone((-gap / 2 - 0.02, 0.06, 0), (gap / 2 + 0.02, 0.06, 0), r)


def pliers(b: Body) -> None:
    angle, length, r = b.draw(0.1, 0.5), b.draw(0.7, 1), b.draw(0.05, 0.07)
    for s in (-1, 1):
        way, z = np.array([s * np.sin(angle), -np.cos(angle), 0]), (0, 0, s * 0.015)
        grip = [z, 0.35 * length * way + [s * 0.08, 0, 0], length * way + [s * 0.04, 0, 0]]
        b.path(grip, [r, r * 0.9, r * 0.8], (0, 0, 1), 1.3)
        jaw = -0.4 * length * way * b.draw(0.8, 1.1) + [s * 0.03, 0, 0]
        b.cone(z, jaw, r * 1.3, r * 0.5, (0, 0, 1), 1.2)
    b.cone((0, 0, -0.03), (0, 0, 0.03), 0.1)


def lamp(b: Body) -> None:
    h = b.draw(0.8, 1.3)
    b.cone((0, 0, 0), (0, 0.02, 0), b.draw(0.25, 0.35), None, (0, 1, 0), 4)
    b.path([(0, 0, 0), (b.draw(-0.2, 0.2), h / 2, 0), (0, h, 0)], [0.035] * 3)
    b.cone((0, h, 0), (0, h - 0.25, 0), 0.12, b.draw(0.25, 0.33))


def spring(b: Body) -> None:
    turns, radius, h = b.draw(3, 5), b.draw(0.25, 0.35), b.draw(0.8, 1.3)
    angle = np.linspace(0, 2 * np.pi * turns, int(14 * turns))
    y = h * np.linspace(-0.5, 0.5, len(angle))
    coil = np.column_stack([radius * np.cos(angle), y, radius * np.sin(angle)])
    b.path(coil, [b.draw(0.035, 0.05)] * len(coil))


def bearing(b: Body) -> None:
    radius = b.draw(0.3, 0.5)
    b.ring((0, 0, 0), radius, b.draw(0.08, 0.13), 24)
    for s in (-1, 1):
        b.cone((s * radius, 0, 0), (s * (radius + b.draw(0.2, 0.35)), 0, 0), b.draw(0.08, 0.12))
    b.cone((-radius, -radius * 1.1, 0), (radius, -radius * 1.1, 0), 0.09)


BODIES: dict[str, Callable[[Body], None]] = {
    one.__name__: one
    for one in (
        hand, ant, spider, octopus, bird, plane, fish, teddy,
        chair, table, glasses, pliers, lamp, spring, bearing,
    )
}  # fmt: skip


def make_thing(kind: str, number: int, n_vertices: int = 2500) -> Mesh:
    """Make the thing of this number and kind."""
    from wares import WARES

    kinds = [*BODIES, *WARES]
    chance = np.random.default_rng([kinds.index(kind), number])
    pieces = chance.uniform() < PIECES
    if kind in WARES:
        vertices, faces = join(WARES[kind](chance))
    else:
        body = Body(chance)
        BODIES[kind](body)
        vertices, faces = _pieces(body) if pieces else _grown(body)
    if len(vertices) > 1.2 * n_vertices:
        few = np.asarray(vertices, np.float32), np.asarray(faces, np.int32)
        vertices, faces = fast_simplification.simplify(*few, target_count=2 * n_vertices)
    turn = np.linalg.qr(chance.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    placed = np.asarray(vertices, float) @ turn.T * chance.uniform(0.5, 20)
    return Mesh(placed, np.asarray(faces, np.int64), name=f"{kind}{number}")


def join(parts: Sequence[Part]) -> Part:
    """Put parts beside each other, joined to nothing."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
    faces = [faces + start for (_, faces), start in zip(parts, starts, strict=True)]
    return np.concatenate([vertices for vertices, _ in parts]), np.concatenate(faces)


def _grown(body: Body) -> Part:
    """One smooth closed surface around all cones."""
    heads, tails, first, last, flats, extra, chains = map(np.array, zip(*body.rows, strict=True))
    thin = 0.4 * min(first.min(), last.min()) / (1 + 0.4 * extra.max())
    spacing = max(min(0.02, thin), _FINEST)
    cones = Cones(heads, tails, first, last, flats, extra, chains, _BLEND)
    # The net is that of the side x >= 0, where all of the body has to be.
    start = np.minimum(heads, tails)[:, 0] - np.maximum(first, last) - 5 * _BLEND
    aside = np.array([2.5 * spacing - start.min(), 0, 0])
    vertices, faces = surface_net(cones.turned(np.eye(3), aside), spacing)
    vertices -= aside
    ends = edge_ends(faces, len(vertices))
    near = sp.coo_array((np.ones(len(ends)), ends.T), shape=(len(vertices),) * 2).tocsr()
    near = near + near.T
    for _ in range(3):  # the net's steps
        vertices = (vertices + (near @ vertices) / near.sum(axis=1)[:, None]) / 2
    return vertices, faces


def _pieces(body: Body) -> Part:
    """Each cone as a surface of its own."""
    from wares import turned

    parts = []
    for head, tail, first, last, flat, extra, _ in body.rows:
        length = float(np.linalg.norm(tail - head))
        ends = np.linspace(-1.2, 0, 4), np.linspace(0, 1.2, 4)
        profile = [(0, -first), *zip(first * np.cos(ends[0]), first * np.sin(ends[0]), strict=True)]
        profile += [*zip(last * np.cos(ends[1]), length + last * np.sin(ends[1]), strict=True)]
        points, faces = turned([*profile, (0, length + last)], 16)
        axis = (tail - head) / max(length, 1e-9)
        frame = np.linalg.qr(np.column_stack([axis, np.eye(3)]))[0]
        points = points @ np.stack([frame[:, 1], axis, frame[:, 2]])
        parts.append((head + points - np.outer(points @ flat, flat) * extra / (1 + extra), faces))
    return join(parts)
