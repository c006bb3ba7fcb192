"""What computations run on: vertices in use, in order, and a clear refusal otherwise."""

import numpy as np
import pytest

from sheets import cut_along_seam
from unbend import Mesh
from unbend.datasets import make_sphere
from unbend.errors import InputError, MeshError
from unbend.preparation import only_component, prepare

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
TETRAHEDRON = Mesh(VERTICES, FACES)
# A triangle and, after it, a tetrahedron with one vertex that no face uses inside its numbering.
TWO = Mesh(
    np.vstack([VERTICES[:3], VERTICES[:2], [[np.nan] * 3], VERTICES[2:]]),
    np.vstack([[[0, 1, 2]], np.array([3, 4, 6, 7])[FACES]]),
    name="two.off",
)


def test_a_clean_mesh_is_passed_on_as_it_is() -> None:
    prepared = prepare(TETRAHEDRON)
    assert prepared.mesh is TETRAHEDRON
    assert prepared.kept.tolist() == [0, 1, 2, 3]
    assert (prepared.notes, prepared.robust_needed) == ((), False)
    values = np.arange(8.0).reshape(4, 2)
    assert prepared.expand(values) is values


def test_unreferenced_vertices_become_nan() -> None:
    mesh = Mesh(np.vstack([[[9, 9, 9]], VERTICES, [[np.nan] * 3]]), FACES + 1)
    prepared = prepare(mesh)
    np.testing.assert_array_equal(prepared.mesh.vertices, VERTICES)
    np.testing.assert_array_equal(prepared.mesh.faces, FACES)
    assert prepared.kept.tolist() == [1, 2, 3, 4]
    assert prepared.notes == ("2 unreferenced vertices get no values (NaN) and no partners (-1)",)
    expanded = prepared.expand(VERTICES)
    np.testing.assert_array_equal(expanded[1:5], VERTICES)
    assert np.isnan(expanded[[0, 5]]).all()


def test_several_components_are_refused_with_a_remedy() -> None:
    with pytest.raises(MeshError) as caught:
        prepare(TWO)
    assert str(caught.value) == (
        "two.off: the mesh has 2 separate components (with 4 and 3 vertices); keep one with "
        '--component largest (in Python: component="largest")'
    )


def test_boundaries_with_equal_positions_are_joined(blob: Mesh) -> None:
    """Of a part and the rest; vertices in no face are not on the seam."""
    cut, seam = cut_along_seam(blob)
    cut = Mesh(np.vstack([cut.vertices, blob.vertices[:3]]), cut.faces)
    n, n_cut = blob.n_vertices, len(cut.vertices) - 3
    prepared = prepare(cut)
    np.testing.assert_array_equal(prepared.mesh.vertices, blob.vertices)
    np.testing.assert_array_equal(prepared.mesh.faces, blob.faces)
    assert prepared.notes == (
        f"{len(seam)} boundary vertices have the position of another one: the surface is joined "
        "there, as at the seams of a texture",
        "3 unreferenced vertices get no values (NaN) and no partners (-1)",
    )
    values = prepared.expand(np.arange(n))
    np.testing.assert_array_equal(values[n:n_cut], seam)
    assert np.isnan(values[n_cut:]).all()
    np.testing.assert_array_equal(only_component(cut, 0).faces, cut.faces)
    (note,) = prepare(Mesh(cut.vertices[:n_cut], cut.faces), connected=False).notes
    assert note.endswith("the surface is cut open there; merge them if it should be whole")


def test_closed_surfaces_that_touch_stay_apart() -> None:
    touching = Mesh(np.vstack([VERTICES, VERTICES * [-1, 1, 1]]), np.vstack([FACES, FACES + 4]))
    with pytest.raises(MeshError, match="2 separate components"):
        prepare(touching)


@pytest.mark.parametrize("component", ["largest", 0, np.int64(0)])
def test_the_largest_component(component: str | int) -> None:
    prepared = prepare(TWO, component=component)
    assert prepared.kept.tolist() == [3, 4, 6, 7]
    np.testing.assert_array_equal(prepared.mesh.vertices, VERTICES)
    np.testing.assert_array_equal(prepared.mesh.faces, FACES)
    assert prepared.mesh.name == "two.off"
    assert prepared.notes == (
        "1 unreferenced vertex gets no values (NaN) and no partners (-1)",
        "component 0 of 2 was kept, 4 of 8 vertices; the others get no values (NaN) and no "
        "partners (-1)",
    )
    values = np.array([1, 2, 3, 4])
    np.testing.assert_array_equal(prepared.expand(values)[[3, 4, 6, 7]], values)


def test_several_components_where_they_are_fine() -> None:
    assert prepare(TWO, connected=False).kept.tolist() == [0, 1, 2, 3, 4, 6, 7]


def test_a_component_that_is_too_small() -> None:
    with pytest.raises(MeshError, match="faces use only 3 vertices"):
        prepare(TWO, component=1)


@pytest.mark.parametrize("component", [2, -1])
def test_a_component_that_does_not_exist(component: int) -> None:
    with pytest.raises(InputError, match="the mesh has 2 components, numbered from 0"):
        prepare(TWO, component=component)


@pytest.mark.parametrize("component", ["biggest", "0", True, 1.5])
def test_a_component_that_is_no_number(component: object) -> None:
    with pytest.raises(InputError, match="'largest' or a whole number"):
        prepare(TWO, component=component)  # type: ignore[arg-type]


def test_choosing_the_only_component_changes_nothing() -> None:
    prepared = prepare(TETRAHEDRON, component="largest")
    assert prepared.mesh is TETRAHEDRON
    assert prepared.notes == ()
    with pytest.raises(InputError, match="1 component, numbered from 0"):
        prepare(Mesh(VERTICES), component=1)


@pytest.mark.parametrize("faces", [None, FACES])
def test_sizes_have_limits(faces: np.ndarray | None) -> None:
    shifted = VERTICES - [0, 0, 1]  # what counts is how far it reaches, not where it lies
    for vertices in (VERTICES, shifted, VERTICES - 1):
        for size in (1e-60, 1.0, 1e60):
            assert prepare(Mesh(vertices * size, faces)).mesh.n_vertices == 4
        for size in (0.99e-60, 1.01e60):
            with pytest.raises(MeshError, match="across; give coordinates in a unit"):
                prepare(Mesh(vertices * size, faces))


def test_one_component_keeps_its_faces_and_what_is_said_of_the_mesh() -> None:
    assert only_component(TWO, None) is TWO
    noted = Mesh(TWO.vertices, np.vstack([TWO.faces, [[3, 3, 0]]]), name="a", notes=("b",))
    kept = only_component(noted, 0)
    np.testing.assert_array_equal(kept.faces, TWO.faces[1:])
    np.testing.assert_array_equal(kept.vertices, TWO.vertices)
    assert (kept.name, kept.notes) == ("a", ("b",))
    part = prepare(noted, component=0).mesh
    assert (part.name, part.notes) == ("a", ("b",))
    pair = only_component((TWO.vertices, TWO.faces), 0)
    np.testing.assert_array_equal(pair.faces, TWO.faces[1:])


def test_many_components_are_summarised() -> None:
    faces = np.arange(24).reshape(8, 3)
    vertices = np.random.default_rng(0).normal(size=(24, 3))
    for count, sizes in (
        (2, "3 and 3 vertices"),
        (5, "3, 3, 3, 3 and 3 vertices"),
        (8, "3, 3, 3, 3 and 3 vertices, and 3 more"),
    ):
        with pytest.raises(MeshError, match=rf"{count} separate components \(with {sizes}\);"):
            prepare(Mesh(vertices, faces[:count]))


def test_faces_without_area_are_refused() -> None:
    line = np.arange(5)[:, None] * np.ones(3)
    with pytest.raises(MeshError, match="every face is degenerate"):
        prepare(Mesh(line, [[0, 1, 2], [1, 2, 3], [2, 3, 4]]))
    with pytest.raises(MeshError, match="every face is degenerate"):
        prepare(Mesh(line, [[0, 0, 1]]))


def test_doubled_faces_and_those_that_name_a_vertex_twice_are_left_out() -> None:
    faces = np.vstack([[[1, 1, 1]], FACES[:, ::-1], FACES[:1], [[0, 0, 3]]])
    prepared = prepare(Mesh(VERTICES, faces, name="a", notes=("b",)))
    assert (prepared.mesh.name, prepared.mesh.notes) == ("a", ("b",))
    np.testing.assert_array_equal(prepared.mesh.faces, FACES[:, ::-1])
    np.testing.assert_array_equal(prepared.kept_faces, [1, 2, 3, 4])
    assert not prepared.robust_needed
    assert prepared.notes == (
        "1 face left out, for repeating the vertices of another",
        "2 faces left out, for naming a vertex twice",
    )


def test_a_vertex_that_only_such_a_face_uses_is_left_out() -> None:
    mesh = Mesh(np.vstack([VERTICES, [[2, 2, 2]]]), np.vstack([FACES, [[0, 0, 4]]]))
    prepared = prepare(mesh)
    np.testing.assert_array_equal(prepared.kept, [0, 1, 2, 3])
    assert prepared.notes[0] == "1 unreferenced vertex gets no values (NaN) and no partners (-1)"


def test_degenerate_faces_stay_and_call_for_the_robust_laplacian() -> None:
    middle = (VERTICES[0] + VERTICES[1]) / 2
    faces = np.vstack([FACES[1:], [[0, 2, 4], [4, 2, 1], [0, 4, 1]]])
    mesh = Mesh(np.vstack([VERTICES, [middle]]), faces)
    prepared = prepare(mesh)
    assert prepared.mesh is mesh
    assert prepared.robust_needed
    assert prepared.notes == ("robust Laplacian, because of 1 degenerate face",)
    doubled = prepare(Mesh(mesh.vertices, np.vstack([faces, faces[:1, ::-1]])))
    np.testing.assert_array_equal(doubled.mesh.faces, faces)
    assert doubled.robust_needed
    assert doubled.notes[1:] == prepared.notes


def test_points() -> None:
    cloud = Mesh(np.vstack([VERTICES, VERTICES[:1]]))
    prepared = prepare(cloud, component="largest")
    assert prepared.mesh is cloud
    assert prepared.notes == ("1 point at the position of another",)
    assert not prepared.robust_needed
    assert len(prepared.kept_faces) == 0
    assert prepare(Mesh(VERTICES)).notes == ()
    with pytest.raises(MeshError, match="only 3 different positions"):
        prepare(Mesh(VERTICES[[0, 1, 2, 2, 2]]))
    with pytest.raises(MeshError, match="only 3 different positions; a shape needs at least 4"):
        prepare(Mesh(VERTICES[:3]))


def test_rounded_positions_are_told() -> None:
    ball = make_sphere(3)
    far = ball.vertices + np.array([500_000, 4_500_000, 0])
    rounded = far.astype(np.float32).astype(np.float64)
    for faces in (ball.faces, None):
        assert not any("rounded" in note for note in prepare(Mesh(far, faces)).notes)
        assert prepare(Mesh(rounded, faces)).notes[-1] == (
            "positions are rounded to about 0.5, and vertices are about 0.08 apart; move the shape "
            "to the origin before saving it"
        )
    near = Mesh((ball.vertices + 100).astype(np.float32), ball.faces)
    assert prepare(near).notes == ()


def test_a_vertex_at_a_place_that_can_only_be_wrong_is_named() -> None:
    ball = make_sphere(2)
    places = np.vstack([[[np.nan] * 3], ball.vertices])  # the first is in no face
    places[18] *= 1e7
    stray = Mesh(places, ball.faces + 1)
    assert "vertex 18 is 1e+07 times as far from the middle" in prepare(stray).notes[-1]
    assert "vertex 17 is" in prepare(Mesh(places[1:])).notes[0]
    places[18] = ball.vertices[17] * 100
    assert not any("middle" in note for note in prepare(Mesh(places, ball.faces + 1)).notes)
    missing = np.vstack([np.zeros((200, 3)), ball.vertices])  # pixels of a depth image
    assert not any("middle" in note for note in prepare(Mesh(missing)).notes)
