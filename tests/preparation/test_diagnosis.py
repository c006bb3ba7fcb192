"""The health of a mesh, on shapes whose every number is known."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from unbend import Mesh, laplacian
from unbend.datasets import make_sphere
from unbend.io import read_mesh, write_mesh
from unbend.preparation import Diagnosis, diagnose, prepare

CUBE_VERTICES = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
CORNERS = "013 032 467 475 045 051 237 276 026 064 157 173"
CUBE_FACES = np.array([[int(corner) for corner in face] for face in CORNERS.split()])
CUBE = Mesh(CUBE_VERTICES, CUBE_FACES)


def torus(n: int) -> Mesh:
    i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    u, v = 2 * np.pi * i / n, 2 * np.pi * j / n
    ring = 2 + np.cos(v)
    vertices = np.column_stack([ring * np.cos(u), ring * np.sin(u), np.sin(v)])
    here, right = i * n + j, (i + 1) % n * n + j
    up, across = i * n + (j + 1) % n, (i + 1) % n * n + (j + 1) % n
    lower, upper = np.column_stack([here, right, across]), np.column_stack([here, across, up])
    return Mesh(vertices, np.concatenate([lower, upper]))


def test_a_cube() -> None:
    health = diagnose(CUBE)
    assert dataclasses.asdict(health) == {
        "n_vertices": 8,
        "n_faces": 12,
        "component_vertices": (8,),
        "component_faces": (12,),
        "boundary_edges": 0,
        "boundary_loops": 0,
        "non_manifold_edges": 0,
        "non_manifold_vertices": 0,
        "inconsistent_edges": 0,
        "one_sided": False,
        "inside_out": False,
        "seems_inside_out": False,
        "degenerate_faces": 0,
        "unreferenced_vertices": 0,
        "duplicate_vertices": 0,
        "seam_vertices": 0,
        "duplicate_faces": 0,
        "area": pytest.approx(6),
        "closed": True,
        "euler_characteristic": 2,
        "genus": 0,
        "edge_min": 1,
        "edge_median": 1,
        "edge_max": pytest.approx(np.sqrt(2)),
        "robust_needed": False,
    }


def test_a_strip_has_one_side(moebius_strip: Mesh) -> None:
    health = diagnose(moebius_strip)
    assert (health.one_sided, health.boundary_loops, health.genus) == (True, 1, None)
    assert health.inconsistent_edges > 0


def test_a_torus_has_one_handle() -> None:
    health = diagnose(torus(8))
    assert (health.genus, health.euler_characteristic, health.closed) == (1, 0, True)


def test_a_cube_without_lid_has_one_boundary_loop() -> None:
    health = diagnose(Mesh(CUBE_VERTICES, CUBE_FACES[2:]))
    assert (health.boundary_edges, health.boundary_loops, health.closed) == (4, 1, False)
    assert (health.euler_characteristic, health.genus) == (1, 0)


def test_a_tube_has_two_boundary_loops() -> None:
    health = diagnose(Mesh(CUBE_VERTICES, CUBE_FACES[4:]))
    assert (health.boundary_loops, health.genus) == (2, 0)


def test_components_are_sorted_by_size() -> None:
    vertices = np.vstack([CUBE_VERTICES[:3], CUBE_VERTICES + 5, [[9, 9, 9]]])
    health = diagnose(Mesh(vertices, np.vstack([[[0, 1, 2]], CUBE_FACES + 3])))
    assert health.component_vertices == (8, 3)
    assert health.component_faces == (12, 1)
    assert health.n_components == 2
    assert health.unreferenced_vertices == 1
    assert health.euler_characteristic == 3
    assert health.genus is None


def test_three_faces_at_an_edge() -> None:
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]]
    health = diagnose(Mesh(vertices, [[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert (health.non_manifold_edges, health.non_manifold_vertices) == (1, 0)
    assert health.robust_needed
    assert health.genus is None


def test_two_cubes_that_touch_at_a_corner() -> None:
    other = CUBE_FACES + 7
    other[CUBE_FACES == 0] = 7
    vertices = np.vstack([CUBE_VERTICES, CUBE_VERTICES[1:] + 1])
    health = diagnose(Mesh(vertices, np.vstack([CUBE_FACES, other])))
    assert (health.non_manifold_vertices, health.non_manifold_edges) == (1, 0)
    assert health.component_vertices == (15,)
    assert health.robust_needed


def test_two_triangles_that_touch_at_a_corner() -> None:
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]
    health = diagnose(Mesh(vertices, [[0, 1, 2], [0, 3, 4]]))
    assert (health.non_manifold_vertices, health.boundary_loops) == (1, 1)


def test_a_flipped_face() -> None:
    faces = CUBE_FACES.copy()
    faces[0] = faces[0, ::-1]
    health = diagnose(Mesh(CUBE_VERTICES, faces))
    assert (health.inconsistent_edges, health.closed, health.genus) == (3, True, None)
    assert not health.one_sided


@pytest.mark.parametrize("scale", [1e-200, 1e-3, 1.0, 1e200])
def test_degenerate_faces_do_not_depend_on_the_unit_of_length(scale: float) -> None:
    thin = [[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0]]
    fine = [[0, 0, 0], [1, 0, 0], [0.5, 1e-7, 0]]
    line = [[0, 0, 0], [1, 1, 1], [2, 2, 2]]
    point = [[3, 3, 3]] * 3
    vertices = scale * np.vstack([thin, fine, line, point])
    faces = np.vstack([np.arange(12).reshape(4, 3), [[0, 1, 1]]])
    assert diagnose(Mesh(vertices, faces)).degenerate_faces == 4
    assert diagnose(Mesh(scale * CUBE_VERTICES, CUBE_FACES)).degenerate_faces == 0


def test_a_face_that_names_a_vertex_twice_has_no_edges() -> None:
    health = diagnose(Mesh(CUBE_VERTICES, np.vstack([CUBE_FACES, [[0, 0, 1]]])))
    assert (health.closed, health.degenerate_faces, health.non_manifold_edges) == (True, 1, 0)
    assert (health.euler_characteristic, health.genus) == (2, None)


def test_duplicates() -> None:
    vertices = np.vstack([CUBE_VERTICES, [[1, 1, 1], [-0.0, 0, 0], [np.nan] * 3, [np.nan] * 3]])
    faces = np.vstack([CUBE_FACES, CUBE_FACES[[3, 3]][:, ::-1]])
    health = diagnose(Mesh(vertices, faces))
    assert (health.duplicate_vertices, health.duplicate_faces) == (2, 2)
    assert health.area == pytest.approx(6)
    assert health.unreferenced_vertices == 4


def test_duplicates_do_not_hide_how_a_surface_is_oriented(moebius_strip: Mesh) -> None:
    def repeated(vertices: np.ndarray, faces: np.ndarray) -> Diagnosis:
        return diagnose(Mesh(vertices, np.concatenate([faces, faces[::-1, ::-1]])))

    assert repeated(moebius_strip.vertices, moebius_strip.faces).one_sided
    assert repeated(CUBE.vertices, CUBE.faces[:, ::-1]).inside_out
    lid = CUBE.faces[[0, 1]]  # far from closed, and seen from either side
    for faces in (lid, lid[:, ::-1]):
        assert not repeated(CUBE.vertices - 9, faces).inside_out


def test_an_open_shell_seems_to_be_inside_out_or_not() -> None:
    ball = make_sphere(2)
    cap = ball.faces[(ball.vertices[ball.faces][:, :, 2] > 0.4).all(axis=1)]
    turned = diagnose((ball.vertices, cap[:, ::-1]))
    assert turned.seems_inside_out
    assert not turned.inside_out
    assert not diagnose((ball.vertices, cap)).seems_inside_out
    lid = CUBE.faces[[0, 1]]  # flat: it has no inside
    assert not any(diagnose((CUBE.vertices, one)).seems_inside_out for one in (lid, lid[:, ::-1]))


def test_a_point_cloud() -> None:
    health = diagnose(Mesh(np.vstack([CUBE_VERTICES, CUBE_VERTICES[:1]])))
    assert (health.n_vertices, health.n_faces, health.n_components) == (9, 0, 0)
    assert (health.duplicate_vertices, health.unreferenced_vertices) == (1, 0)
    assert (health.closed, health.euler_characteristic, health.genus) == (False, None, None)
    assert np.isnan(health.edge_median)


def count_by_walking(faces: np.ndarray) -> tuple[int, int, list[int]]:
    """Count non-manifold edges and vertices and component sizes the slow, obvious way."""
    around: dict[tuple[int, int], set[int]] = {}
    proper = [tuple(map(int, face)) for face in faces if len(set(face)) == 3]
    for k, (a, b, c) in enumerate(proper):
        for edge in ((a, b), (b, c), (c, a)):
            around.setdefault((min(edge), max(edge)), set()).add(k)

    def groups(items: list[int], linked: list[set[int]]) -> list[set[int]]:
        result = [{item} for item in items]
        for link in linked:
            touched = [group for group in result if group & link]
            merged = set().union(*touched) if touched else set()
            result = [group for group in result if not group & link] + ([merged] if merged else [])
        return result

    many = 0
    for vertex in set(faces.ravel().tolist()):
        mine = [k for k, face in enumerate(proper) if vertex in face]
        many += len(groups(mine, [s & set(mine) for e, s in around.items() if vertex in e])) > 1
    parts = groups(sorted({i for face in proper for i in face}), [set(face) for face in proper])
    sizes = sorted((len(part) for part in parts), reverse=True)
    return sum(len(s) > 2 for s in around.values()), many, sizes


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.tuples(*[st.integers(0, 8)] * 3), min_size=1, max_size=14),
    st.integers(0, 2**32 - 1),
)
def test_any_tangle_of_faces_agrees_with_walking(
    faces: list[tuple[int, int, int]], seed: int
) -> None:
    array = np.unique(np.sort(np.array(faces), axis=1), axis=0)
    health = diagnose(Mesh(np.random.default_rng(seed).normal(size=(9, 3)), array))
    edges, vertices, sizes = count_by_walking(array)
    assert health.non_manifold_edges == edges
    assert health.non_manifold_vertices == vertices
    assert list(health.component_vertices) == sizes


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_numbering_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = torus(6)
    order = rng.permutation(mesh.n_vertices)
    number = np.argsort(order)
    turned = Mesh(mesh.vertices[order], np.roll(number[mesh.faces], rng.integers(3), axis=1))
    expected, found = dataclasses.asdict(diagnose(mesh)), dataclasses.asdict(diagnose(turned))
    for name, value in expected.items():
        assert found[name] == pytest.approx(value), name


@pytest.mark.parametrize(
    ("more", "robust"),
    [
        ([[0, 0, 3]], False),  # names a vertex twice
        ([[1, 0, 3], [3, 0, 1]], False),  # repeat the first face
        ([[3, 1, 0], [7, 7, 7]], False),
        ([[0, 1, 7]], True),  # a third face at two edges
        ([[0, 1, 7], [7, 1, 0]], True),
        ([[0, 0, 3], [1, 0, 3], [0, 1, 7]], True),
    ],
)
def test_the_robust_laplacian_is_needed_where_computations_take_it(more, robust) -> None:
    mesh = Mesh(CUBE_VERTICES, np.vstack([CUBE_FACES, more]))
    health = diagnose(mesh)
    assert health.degenerate_faces or health.non_manifold_edges
    assert health.robust_needed == prepare(mesh).robust_needed == robust
    assert laplacian(mesh).kind == ("robust" if robust else "cotangent")


def test_the_robust_laplacian_is_not_needed_where_nothing_can_be_computed() -> None:
    line = np.arange(5)[:, None] * np.ones(3)
    health = diagnose(Mesh(line, [[0, 1, 2], [1, 2, 3], [2, 3, 4]]))
    assert health.degenerate_faces == 3
    assert not health.robust_needed


def test_real_shapes(real_data: Path) -> None:
    koala = read_mesh(real_data / "large" / "koala.obj")
    health = diagnose(koala)
    assert (health.n_vertices, health.n_faces) == (49_999, 99_994)
    assert (health.closed, health.genus, health.n_components) == (True, 0, 1)
    assert not health.robust_needed


def test_takes_whatever_is_a_mesh(tmp_path: Path) -> None:
    cube = Mesh(CUBE_VERTICES, CUBE_FACES)
    path = tmp_path / "cube.ply"
    write_mesh(path, cube)
    for shape in (path, str(path), (CUBE_VERTICES, CUBE_FACES)):
        assert diagnose(shape) == diagnose(cube)


def test_faces_that_are_none_close_nothing() -> None:
    points = np.eye(3)
    assert not diagnose(Mesh(points, [[0, 0, 1]])).closed
    assert not diagnose(Mesh(points)).closed
    assert diagnose(Mesh(points, [[0, 1, 2], [0, 2, 1]])).closed


def test_faces_that_are_oriented_inward() -> None:
    inward = CUBE.faces[:, ::-1].copy()
    assert diagnose(Mesh(CUBE.vertices, inward)).inside_out
    inward[3] = CUBE.faces[3]
    health = diagnose(Mesh(CUBE.vertices, inward))
    assert health.inside_out
    assert health.inconsistent_edges == 3
