"""Decimation: truths about what a coarser mesh must share with the fine one."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sheets import make_sheet
from unbend.datasets import make_biped, make_sphere
from unbend.mesh import Mesh, find_components, find_edges, vertex_areas
from unbend.mesh.decimation import _costs, _quadrics, _turns_over, decimate


def _euler(faces: np.ndarray, n: int) -> int:
    return n - len(find_edges(faces, n).ends) + len(faces)


def test_a_closed_surface_stays_one() -> None:
    mesh = make_biped("running", n_vertices=3000).mesh
    kept, faces, parents = decimate(mesh.vertices, mesh.faces, 500)
    assert len(kept) == 500
    assert (find_edges(faces, 500).n_faces == 2).all()
    assert _euler(faces, 500) == 2
    assert (np.unique(faces) == np.arange(500)).all()
    assert (parents[kept] == np.arange(500)).all()
    area = vertex_areas(Mesh(mesh.vertices[kept], faces)).sum()
    assert 0.93 < area / vertex_areas(mesh).sum() < 1.01
    # Nobody is moved far: not out of a limb into the one beside it.
    moved = np.linalg.norm(mesh.vertices[kept][parents] - mesh.vertices, axis=1)
    assert moved.max() < 0.1 * np.ptp(mesh.vertices, axis=0).max()


@pytest.mark.parametrize("turn", range(4))
def test_a_ball_keeps_its_outside_and_its_evenness(turn: int) -> None:
    ball = make_sphere(4)
    points = ball.vertices @ Rotation.random(random_state=turn).as_matrix()
    kept, faces, _ = decimate(points, ball.faces, 200)
    corners = points[kept][faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # No collapse turns a face by 90 degrees, but several may.
    assert ((normals * corners.mean(axis=1)).sum(axis=1) < 0).sum() <= 2
    areas = np.linalg.norm(normals, axis=1) / 2
    assert areas.max() < 6 * np.median(areas)


def test_a_boundary_is_not_eaten_into() -> None:
    sheet = make_sheet(21)
    vertices, faces = sheet.vertices, sheet.faces
    kept, coarse, _ = decimate(vertices, faces, 60)
    assert len(kept) == 60
    assert _euler(coarse, 60) == 1
    corners = vertices[kept][coarse]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (normals[:, 2] > 0).all()
    assert np.linalg.norm(normals, axis=1).sum() / 2 > 0.97


def test_what_is_small_enough_is_left_alone() -> None:
    ball = make_sphere(1)
    kept, faces, parents = decimate(ball.vertices, ball.faces, 1000)
    assert (kept == np.arange(ball.n_vertices)).all()
    assert (faces == ball.faces).all()
    assert (parents == kept).all()


@pytest.mark.kernels
@pytest.mark.parametrize("twice", [False, True])
def test_what_hangs_by_its_corners_is_not_cut_off(twice: bool) -> None:
    # A chain of triangles, single or back to back, that share one corner each.
    ball = make_sphere(2)
    n = ball.n_vertices
    links = np.arange(0, 12, 2)[:, None] + [n - 1, n, n + 1]
    links[0, 0] = 5
    step = np.array([[0.02, 0.01, 0.0], [0.04, 0.0, 0.0]])
    chain = ball.vertices[5] * (1 + np.arange(6)[:, None, None] * 0.04) + step
    vertices = np.vstack([ball.vertices, chain.reshape(-1, 3)])
    faces = np.vstack([ball.faces, links, *([links[:, ::-1]] if twice else [])])
    assert len(find_components(faces, len(vertices)).n_vertices) == 1
    for count in (100, 40, 10):
        kept, coarse, _ = decimate(vertices, faces, count)
        assert (np.unique(coarse) == np.arange(len(kept))).all()
        assert len(find_components(coarse, len(kept)).n_vertices) == 1


@pytest.mark.kernels
def test_a_small_ball_is_decimated_to_a_tetrahedron() -> None:
    ball = make_sphere(1)
    kept, faces, parents = decimate(ball.vertices, ball.faces, 4)
    assert len(kept) == len(faces) == 4
    assert (find_edges(faces, 4).n_faces == 2).all()
    assert (parents[kept] == np.arange(4)).all()


@pytest.mark.kernels
def test_the_cost_of_a_collapse_is_the_sum_of_squared_distances() -> None:
    ball = make_sphere(1)
    points = ball.vertices + 0.1 * np.random.default_rng(0).normal(size=ball.vertices.shape)
    quadrics = _quadrics(points, ball.faces, find_edges(ball.faces, ball.n_vertices))
    corners = points[ball.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(normals, axis=1)

    def cost(u: int, v: int) -> float:
        expected = 0.0
        for end in (u, v):
            around = (ball.faces == end).any(axis=1)
            heights = ((points[v] - corners[:, 0]) * normals).sum(axis=1) / double
            expected += (double / 6 * heights**2)[around].sum()
        area = double[(ball.faces == u).any(axis=1)].sum() / 6
        expected += 0.1 * area * ((points[u] - points[v]) ** 2).sum()
        return float(expected)

    ends, costs = np.empty((ball.faces.size, 2), int), np.empty(ball.faces.size)
    _costs(points, ball.faces, quadrics, ends, costs)
    sides = np.stack([ball.faces, ball.faces[:, [1, 2, 0]]], axis=2).reshape(-1, 2)
    np.testing.assert_array_equal(np.sort(ends), np.sort(sides))
    for (u, v), found in zip(ends[::7], costs[::7], strict=True):
        assert found == pytest.approx(cost(u, v))
        assert found <= cost(v, u) * (1 + 1e-9)


@pytest.mark.kernels
def test_a_face_turns_over_when_a_corner_crosses_the_opposite_side() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0.5], [0.8, 0.8, 0.1]])
    face = np.array([[0, 1, 2]])
    assert not _turns_over(points, face, 0, 0, 3)
    assert _turns_over(points, face, 0, 0, 4)
    assert _turns_over(points, face, 0, 0, 1)  # nothing is left of it


def _sides(face: tuple[int, ...]) -> list[tuple[int, int]]:
    return list(zip(face, face[1:] + face[:1], strict=True))


def _by_planes(points: np.ndarray, faces: np.ndarray, count: int) -> tuple[list, np.ndarray]:
    """The same collapses, of sets of vertices and planes: parents of all, and the faces left."""
    n = len(points)
    left = [tuple(face) for face in faces.tolist()]
    sides = [frozenset(side) for face in left for side in _sides(face)]
    rim = {end for side in sides if sides.count(side) == 1 for end in side}
    planes: list[list] = [[] for _ in range(n)]
    areas = np.zeros(n)
    for face in left:
        a, b, c = points[list(face)]
        normal = np.cross(b - a, c - a)
        double = np.linalg.norm(normal)
        areas[list(face)] += double / 6
        for corner in face:
            planes[corner].append((normal / double, a, double / 6))
        for u, v in _sides(face):
            if sides.count(frozenset((u, v))) == 1:
                side = points[v] - points[u]
                out = np.cross(normal / double, side)
                long = np.linalg.norm(side)
                for end in (u, v):
                    planes[end].append((out / long, points[u], long**2))
    parents = list(range(n))

    def cost(u: int, v: int) -> float:
        off = sum(by * ((points[v] - at) @ normal) ** 2 for normal, at, by in planes[u] + planes[v])
        return off + 0.1 * areas[u] * ((points[u] - points[v]) ** 2).sum()

    def allowed(u: int, v: int) -> bool:
        around = [{w for face in left if end in face for w in face} - {u, v} for end in (u, v)]
        mine = [face for face in left if u in face]
        tips = {w for face in mine if v in face for w in face} - {u, v}
        for face in mine:
            moved = points[[v if w == u else w for w in face]]
            turns = [
                np.cross(one[1] - one[0], one[2] - one[0]) for one in (points[list(face)], moved)
            ]
            if v not in face and turns[0] @ turns[1] <= 0:
                return False
        for tip in tips:
            if not any(tip in face and len({u, v} & set(face)) == 1 for face in left):
                return False
        shared = sum(v in face for face in mine)
        if u in rim and v not in rim:
            return False
        return shared == len(around[0] & around[1]) == (1 if u in rim else 2)

    n_left = n
    while n_left > count:
        ways = []
        for face in left:
            for u, v in _sides(face):
                ways.append(min((cost(u, v), u, v), (cost(v, u), v, u)))
        most = sorted(ways)[min(int(0.4 * len(ways)) + 1, len(ways) - 1)][0]
        touched: set[int] = set()
        before = n_left
        for price, u, v in sorted(ways):
            ring = {w for face in left if u in face for w in face}
            if price > most or n_left == count or ring & touched or v in touched:
                continue
            if not allowed(u, v):
                continue
            touched |= ring | {w for face in left if v in face for w in face}
            left = [tuple(v if w == u else w for w in face) for face in left]
            left = [face for face in left if len(set(face)) == 3]
            planes[v] += planes[u]
            areas[v] += areas[u]
            parents = [v if one == u else one for one in parents]
            n_left -= 1
        if n_left == before:
            break
    return parents, np.array(left)


@pytest.mark.kernels
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("closed", [True, False])
def test_the_cheapest_collapses_that_leave_a_surface_are_made(closed: bool, seed: int) -> None:
    """The same ones as where every distance from every plane is measured."""
    chance = np.random.default_rng(seed)
    mesh = make_sphere(1) if closed else make_sheet(6)
    points = mesh.vertices * (1 + closed) + 0.12 * chance.normal(size=mesh.vertices.shape)
    for count in (mesh.n_vertices - 1, 20, 4):
        kept, faces, parents = decimate(points, mesh.faces, count)
        expected, left = _by_planes(points, mesh.faces, count)
        np.testing.assert_array_equal(kept[parents], expected)
        np.testing.assert_array_equal(kept[faces], left)
