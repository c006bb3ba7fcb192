"""T-junctions are closed, and nothing else."""

from pathlib import Path

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from unbend import Mesh, diagnose, read_mesh, write_mesh
from unbend.datasets import make_sphere
from unbend.io.formats.junctions import divide_at_junctions
from unbend.mesh import vertex_areas


def _torn(seed: int, rounds: int) -> Mesh:
    """A ball of which sides of single triangles are divided, and again what came of these."""
    chance, ball = np.random.default_rng(seed), make_sphere(1)
    points, faces = list(ball.vertices), ball.faces.tolist()
    for _ in range(rounds):
        for i in range(len(faces)):
            if chance.random() < 0.4:
                a, b, c = np.roll(faces[i], chance.integers(3)).tolist()
                share = chance.uniform(0.2, 0.8)
                points.append(share * points[a] + (1 - share) * points[b])
                faces[i] = [a, len(points) - 1, c]
                faces.append([len(points) - 1, b, c])
    return Mesh(np.array(points), np.array(faces), name="torn")


@given(seed=st.integers(0, 1000), rounds=st.integers(1, 3), size=st.sampled_from([1e-3, 1.0, 1e5]))
def test_a_torn_ball_is_closed_again(seed: int, rounds: int, size: float) -> None:
    torn = _torn(seed, rounds)
    assume(not cKDTree(torn.vertices).query_pairs(1e-3))  # which would count as one
    faces, n_divided = divide_at_junctions(size * torn.vertices, torn.faces)
    closed = Mesh(torn.vertices, faces)
    assert n_divided > 0
    assert diagnose(closed).closed
    assert diagnose(closed).genus == 0
    assert diagnose(closed).inconsistent_edges == 0
    np.testing.assert_allclose(vertex_areas(closed).sum(), vertex_areas(torn).sum())


def test_what_only_touches_an_edge_stays_apart() -> None:
    """A corner on an edge from which no boundary runs along it, and one on an edge of two faces."""
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    tips = [[0.5, 0, 0], [0.3, -1, 0], [0.7, -1, 0], [0.5, 0.5, 0], [0.5, 0.5, 1], [0.6, 0.5, 1]]
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [7, 8, 9]])
    found, n_divided = divide_at_junctions(np.array(square + tips), faces)
    assert n_divided == 0
    np.testing.assert_array_equal(found, faces)


def test_an_stl_file_with_junctions_is_read_as_a_closed_surface(tmp_path: Path) -> None:
    torn = _torn(0, 1)
    write_mesh(tmp_path / "torn.stl", torn)
    found = read_mesh(tmp_path / "torn.stl")
    assert diagnose(found).closed
    assert found.n_vertices == torn.n_vertices
    n_divided = found.n_faces - torn.n_faces
    assert found.notes[1] == (
        f"{n_divided} edges divided at corners of other triangles that lie on them, to close "
        f"slits: {found.n_faces} triangles"
    )
