import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from unbend import Mesh, as_mesh, write_mesh
from unbend.datasets import make_sphere
from unbend.errors import FileError, InputError, MeshError
from unbend.mesh import vertex_areas, vertex_ids, vertex_normals

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


class Tensor:
    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("use detach()")  # as PyTorch's with gradients


def same(mesh):
    return np.array_equal(mesh.vertices, VERTICES) and np.array_equal(mesh.faces, FACES)


def test_is_frozen_and_keeps_its_own_copy():
    vertices = VERTICES.copy()
    mesh = Mesh(vertices, FACES.astype(np.int32), name="tetrahedron")
    vertices[0] = 9
    assert same(mesh)
    assert mesh.vertices.dtype == np.float64
    assert mesh.faces.dtype == np.int64
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0, 0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        mesh.name = "other"


def test_meshes_share_the_faces_of_a_mesh_and_no_others():
    mesh = Mesh(VERTICES, FACES)
    assert Mesh(2 * VERTICES, mesh.faces).faces is mesh.faces
    faces = FACES.astype(np.int64)
    view = faces[:]
    view.setflags(write=False)
    for given in (faces, view, mesh.faces[::-1]):
        assert not np.shares_memory(Mesh(VERTICES, given).faces, given)


def test_faces_are_frozen_and_rows_lie_in_order():
    mesh = Mesh(np.asfortranarray(VERTICES), np.asfortranarray(FACES))
    with pytest.raises(ValueError, match="read-only"):
        mesh.faces[0, 0] = 1
    assert mesh.vertices.flags.c_contiguous
    assert mesh.faces.flags.c_contiguous
    none = Mesh(VERTICES, []).faces
    assert (none.shape, none.dtype) == ((0, 3), np.int64)
    assert len(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.array([[0, 1, 2]])).faces) == 1
    with pytest.raises(MeshError, match=r"shape \(m, 3\)"):
        Mesh(VERTICES, [[0]])


def test_vertex_numbers():
    assert vertex_ids([0, 3], 4, "a.ply").tolist() == [0, 3]
    for wrong in ([1.0], [[1]], "a", [True]):
        with pytest.raises(InputError, match=r"a\.ply: vertex ids must be a list of whole"):
            vertex_ids(wrong, 4, "a.ply")
    for wrong in (-1, 4):
        with pytest.raises(InputError, match=f"no vertex {wrong}; vertices are numbered 0 to 3"):
            vertex_ids([0, wrong, 3], 4, "a.ply")


def test_a_mesh_a_path_a_pair_and_an_array_are_meshes(tmp_path):
    mesh = Mesh(VERTICES, FACES)
    write_mesh(tmp_path / "mesh.ply", mesh)
    assert as_mesh(mesh) is mesh
    assert same(as_mesh(tmp_path / "mesh.ply"))
    assert same(as_mesh(str(tmp_path / "mesh.ply")))
    assert same(as_mesh((VERTICES, FACES)))
    assert same(as_mesh([VERTICES.tolist(), FACES.tolist()]))
    assert as_mesh(VERTICES).is_point_cloud


def test_a_trimesh_is_a_mesh():
    trimesh = pytest.importorskip("trimesh")
    assert same(as_mesh(trimesh.Trimesh(VERTICES, FACES, process=False)))


def test_says_what_it_is():
    assert repr(Mesh(VERTICES, FACES)) == "Mesh(4 vertices, 4 faces)"
    assert repr(Mesh(VERTICES)) == "Mesh(4 points)"


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (VERTICES[:, :2], FACES, r"shape \(n, 3\), not \(4, 2\)"),
        ("abc", FACES, "not an array of numbers"),
        (Tensor(), FACES, r"not an array of numbers \(use detach\(\)\)"),
        (VERTICES * 1j, FACES, "real numbers, not complex128"),
        (VERTICES > 0, FACES, "real numbers, not bool"),
        (VERTICES.astype(str), FACES, "real numbers, not <U"),
        (VERTICES.astype("datetime64[s]"), FACES, "real numbers, not datetime64"),
        (np.ma.masked_less(VERTICES, 0.5), FACES, "coordinates are masked"),
        ([[0, 0, 0], [1, 1]], None, "not an array of numbers"),
        (VERTICES, [[0, 1, 2], [0, 1, 2, 3]], "different numbers of vertices; triangulate them"),
        (VERTICES, np.ma.masked_less(FACES, 1), "some faces are masked"),
        (VERTICES, FACES[:, :2], r"shape \(m, 3\), not \(4, 2\)"),
        (VERTICES, FACES * 1.0, "whole numbers"),
        (VERTICES, FACES + 1, "face 1 names vertex 4, but the vertices are numbered 0 to 3"),
        (VERTICES, FACES - 1, "face 0 names vertex -1"),
        (VERTICES, (FACES - 1).astype(np.uint64), "face 0 names vertex 18446744073709551615"),
        (VERTICES * [[1], [1], [np.nan], [1]], FACES, "vertex 2 is at"),
        (np.where(VERTICES == 1, np.inf, VERTICES), None, "vertex 1 is at"),
    ],
)
def test_broken_arrays_are_refused_by_vertex_or_face(vertices, faces, message):
    with pytest.raises(MeshError, match=message) as error:
        Mesh(vertices, faces, name="broken.off")
    assert str(error.value).startswith("broken.off: ")


def test_a_vertex_that_no_face_uses_may_be_nan():
    extended = np.vstack([VERTICES, [[np.nan] * 3]])
    assert Mesh(extended, FACES).n_vertices == 5


@pytest.mark.parametrize(
    "thing",
    [
        5,
        None,
        {"vertices": 1},
        (1, 2, 3),
        SimpleNamespace(vertices=VERTICES),
        SimpleNamespace(points=VERTICES, n_cells=0),
    ],
)
def test_anything_else_is_refused(thing):
    with pytest.raises(InputError, match=r"is not a mesh: .* array of points"):
        as_mesh(thing)


def test_a_missing_file_is_refused():
    with pytest.raises(FileError, match="there is no such file"):
        as_mesh("nowhere.off")


def test_points_have_equal_areas():
    assert vertex_areas(Mesh(np.zeros((5, 3)))).tolist() == [1] * 5


def test_each_vertex_has_a_third_of_the_faces_around_it(blob):
    repeated = np.vstack([blob.faces, blob.faces[:9, [1, 0, 2]]])  # which are no more surface
    extended = Mesh(np.vstack([blob.vertices, [[9.0, 9, 9]]]), repeated)
    areas = np.zeros(643)
    for a, b, c in blob.faces:
        sides = [
            np.linalg.norm(blob.vertices[i] - blob.vertices[j]) for i, j in ((a, b), (b, c), (c, a))
        ]
        half = sum(sides) / 2  # Heron's formula
        areas[[a, b, c]] += np.sqrt(half * np.prod([half - side for side in sides])) / 3
    np.testing.assert_allclose(vertex_areas(extended), areas)


def test_normals_of_a_sphere_point_outwards():
    sphere = make_sphere(4)
    found = vertex_normals(sphere.vertices, sphere.faces)
    np.testing.assert_allclose(found, sphere.vertices, atol=0.02)
    extended = np.vstack([sphere.vertices, [[9.0, 9, 9]]])
    np.testing.assert_array_equal(vertex_normals(extended, sphere.faces)[-1], 0)
