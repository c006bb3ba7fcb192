"""Topology by arrays is that by definition, on random faces."""

from collections import defaultdict
from itertools import product

import numpy as np
import pytest

from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.mesh import _topology as topology
from unbend.mesh import edge_ends, faces_around, minimum_cut

NOTHING = np.empty((0, 3), dtype=np.int64)


def soups(count=40):
    """Yield random faces of three different vertices each, and how many vertices there are."""
    for seed in range(count):
        draw = np.random.default_rng(seed)
        n = int(draw.integers(3, 12))
        m = int(draw.integers(0, 16))
        yield np.array([draw.permutation(n)[:3] for _ in range(m)], np.int64).reshape(-1, 3), n
    sphere = make_sphere(1).faces  # edges of two faces, and fans that are apart
    for seed in range(count):
        draw = np.random.default_rng(seed)
        some = sphere[draw.random(len(sphere)) < 0.6]
        yield some, 42
        yield np.where(draw.random((len(some), 1)) < 0.1, some[:, ::-1], some), 42


def sides_of(faces):
    for i, face in enumerate(faces.tolist()):
        for k in range(3):
            yield 3 * i + k, face[k], face[(k + 1) % 3]


def test_each_edge_is_named_once_and_loops_are_none():
    faces = np.array([[2, 1, 0], [1, 2, 3], [3, 3, 4]])
    np.testing.assert_array_equal(
        edge_ends(faces, 6), [[0, 1], [0, 2], [1, 2], [1, 3], [2, 3], [3, 4]]
    )
    assert edge_ends(NOTHING, 6).shape == (0, 2)
    assert edge_ends(NOTHING, 0).shape == (0, 2)


def test_edges_and_their_faces():
    for faces, n in soups():
        sides = defaultdict(list)
        for side, a, b in sides_of(faces):
            sides[min(a, b), max(a, b)].append((side, a < b))
        found = topology.find_edges(faces, n)
        assert [tuple(ends) for ends in found.ends.tolist()] == sorted(sides)
        for i, (_, there) in enumerate(sorted(sides.items())):
            assert found.n_faces[i] == len(there)
            assert found.n_upward[i] == sum(upward for _, upward in there)
            assert all(found.of_side[side] == i for side, _ in there)


def fans_at(vertex, faces):
    """Count groups of faces at a vertex that edges there join."""
    groups = [set(face) - {vertex} for face in faces.tolist() if vertex in face]
    for _ in groups:
        for i, one in enumerate(groups):
            for other in groups[:i]:
                if one & other:
                    one |= other
                    other |= one
    return len({frozenset(group) for group in groups})


def test_vertices_of_several_fans():
    for faces, n in soups():
        by_definition = sum(fans_at(vertex, faces) > 1 for vertex in range(n))
        edges = topology.find_edges(faces, n)
        assert topology.count_non_manifold_vertices(faces, edges) == by_definition


def test_components_largest_first():
    for faces, n in soups():
        groups = [{vertex} for vertex in range(n)]
        for face in faces.tolist():
            joined = set().union(*(group for group in groups if group & set(face)))
            groups = [group for group in groups if not group & joined] + [joined]
        used = [
            (-len(group), -sum(face[0] in group for face in faces.tolist()), min(group), group)
            for group in groups
            if group & set(faces.ravel().tolist())
        ]
        found = topology.find_components(np.vstack([[[0, 0, 1]], faces]), n)
        expected = np.full(n, -1)
        for i, (*_, group) in enumerate(sorted(used, key=lambda one: one[:3])):
            expected[list(group)] = i
        np.testing.assert_array_equal(found.of_vertex, expected)
        sizes = sorted(one[:3] for one in used)
        assert found.n_vertices.tolist() == [-size for size, _, _ in sizes]
        assert found.n_faces.tolist() == [-count for _, count, _ in sizes]


def test_of_components_of_as_many_vertices_that_of_more_faces_comes_first():
    faces = np.array([[0, 1, 2], [1, 3, 2], [4, 5, 6], [4, 6, 7], [4, 7, 5], [5, 7, 6]])
    found = topology.find_components(faces, 8)
    assert found.of_vertex.tolist() == [1] * 4 + [0] * 4
    assert found.n_faces.tolist() == [4, 2]


@pytest.mark.parametrize("at_once", [1, 7, 2**14])
@pytest.mark.parametrize("scale", [1e-100, 1.0, 1e100])
def test_areas_in_any_unit(blob: Mesh, monkeypatch, at_once, scale):
    monkeypatch.setattr(topology, "FACES_AT_ONCE", at_once)
    faces = blob.faces[:50]
    a, b, c = blob.vertices[faces].transpose(1, 0, 2)
    sides = [np.linalg.norm(one, axis=1) for one in (a - b, b - c, c - a)]
    half = sum(sides) / 2  # Heron's formula
    areas = np.sqrt(half * np.prod([half - side for side in sides], axis=0))
    degenerate, area = topology.measure_faces(blob.vertices * scale, faces)
    assert not degenerate.any()
    assert area / scale / scale == pytest.approx(areas.sum())


def test_a_height_counts_in_units_of_the_longest_side():
    heights = np.array([0, 0.9e-8, 1.1e-8, 1.0])
    for base in ([0, 0, 0], [0.3, 0, 0], [7.0, 0, 0]):
        for order in ([0, 1, 2], [1, 2, 0], [2, 0, 1]):
            for scale in (1e-30, 1.0, 1e30):
                for height in heights:
                    points = np.array([[0, 0, 0], [0, 0, 10.0], base])
                    points[2, 1] = height * max(10, np.hypot(10, base[0]))
                    points *= scale
                    longest = max(np.linalg.norm(points - points[[1, 2, 0]], axis=1))
                    twice = np.linalg.norm(np.cross(points[1] - points[0], points[2] - points[0]))
                    expected = twice / longest <= 1e-8 * longest
                    found, _ = topology.measure_faces(points, np.array([order]))
                    assert found[0] == expected
    points = np.array([[0, 0, 0], [1.0, 0, 0], [0, 1, 0]])
    found, area = topology.measure_faces(points, np.array([[0, 1, 2], [1, 1, 2], [2, 0, 2]]))
    assert found.tolist() == [False, True, True]
    assert area == 0.5
    assert topology.measure_faces(np.ones((3, 3)), np.array([[0, 1, 2]]))[0].all()


def test_a_far_too_large_difference_does_not_overflow():
    points = np.array([[-1e308, 0, 0], [1e308, 0, 0], [0, 1e308, 0]])
    with np.errstate(over="ignore"):  # the area itself does
        degenerate, _ = topology.measure_faces(points, np.array([[0, 1, 2]]))
    assert not degenerate.any()


def test_twins_have_the_same_vertices_in_any_order():
    faces = np.array([[0, 1, 2], [1, 3, 2], [2, 1, 0], [1, 2, 0], [1, 2, 3], [0, 1, 3]])
    assert topology.has_earlier_twin(faces).tolist() == [False, False, True, True, True, False]
    assert topology.has_repeated_index(faces[:, [0, 1, 1]]).all()
    assert topology.proper_faces(faces) is faces


def test_every_vertex_has_the_faces_around_it():
    faces = make_sphere(0).faces
    n = faces.max() + 2  # the last vertex has no face
    start, around = faces_around(faces, n)
    assert start[-1] == len(around) == faces.size
    for i in range(n):
        mine = np.flatnonzero((faces == i).any(axis=1))
        np.testing.assert_array_equal(around[start[i] : start[i + 1]], mine)


def test_a_minimum_cut_is_the_best_of_all_choices():
    chance = np.random.default_rng(1)
    for _ in range(20):
        gains = chance.integers(-9, 10, 8).astype(float)
        links, costs = chance.integers(8, size=(2, 14)), chance.integers(10, size=14).astype(float)
        choices = np.array(list(product((False, True), repeat=8)))
        cuts = choices[:, links[0]] & ~choices[:, links[1]]
        worth = choices @ gains - cuts @ costs
        found = minimum_cut(gains, links, costs, 1.0)
        assert worth[(choices == found).all(axis=1)] == worth.max()
