"""From meshes to the matcher's arrays and back, however many are prepared at once."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from sheets import cut_along_seam
from unbend import Mesh, match
from unbend.datasets import make_sphere
from unbend.errors import InputError, MeshError, UnbendWarning, heard
from unbend.matching import _inputs
from unbend.matching._inputs import expand, expand_rows, prepare_shape, prepare_shapes
from unbend.mesh import vertex_areas

pytestmark = pytest.mark.usefixtures("as_meshed")


def test_only_small_meshes_are_prepared_side_by_side_and_all_with_one_result(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ball = make_sphere(2)
    egg = Mesh(ball.vertices * [1, 1.2, 1.5], ball.faces[1:])  # with a hole
    monkeypatch.setattr(_inputs, "_SIDE_BY_SIDE", 2 * 162)
    ran: list[int] = []

    def run_all(tasks: list[Callable[[], Any]]) -> list[Any]:
        ran.append(len(tasks))
        return [task() for task in tasks]

    monkeypatch.setattr(_inputs, "run_all", run_all)
    expected = prepare_shapes([egg, egg], 10, [False, True])
    assert ran == [2]
    monkeypatch.setattr(_inputs, "_SIDE_BY_SIDE", 2 * 162 - 1)
    monkeypatch.setattr(_inputs, "run_all", None)
    found = prepare_shapes([egg, egg], 10, [False, True])
    assert [one.shape.partial for one in found] == [False, True]
    assert not prepare_shape(egg, 10).shape.partial
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.shape.vertices, other.shape.vertices)
        np.testing.assert_array_equal(one.shape.eigenvalues, other.shape.eigenvalues)


def test_every_vertex_in_use_has_one_that_stands_for_it() -> None:
    """A small ball before a large one, and a vertex of no face between them."""
    small, large = make_sphere(0), make_sphere(1)
    mesh = Mesh(
        np.concatenate([small.vertices * 0.1 + [1.3, 0, 0], [[9, 9, 9]], large.vertices]),
        np.concatenate([small.faces, large.faces + 13]),
        name="both",
    )
    with pytest.warns(UnbendWarning, match=r"42 of 55 .*; 1 smaller component takes"):
        found = prepare_shape(mesh, 10)
    np.testing.assert_array_equal(found.kept, np.arange(13, 55))
    np.testing.assert_array_equal(found.local(found.kept), np.arange(42))
    nearest = np.linalg.norm(mesh.vertices[:12, None] - large.vertices, axis=2).argmin(axis=1)
    np.testing.assert_array_equal(found.local(np.arange(12)), nearest)
    with pytest.raises(InputError, match="both: vertex 12 is not on its surface; name another"):
        found.local(np.array([0, 12]))
    assert found.representatives[12] == -1
    np.testing.assert_array_equal(found.own_faces, len(small.faces) + np.arange(80))
    apart = np.linalg.norm(np.diff(found.shape.vertices, axis=0), axis=1)
    before = np.linalg.norm(np.diff(large.vertices, axis=0), axis=1)
    np.testing.assert_allclose(apart / before, apart[0] / before[0])


@pytest.mark.parametrize("cut", [False, True])
def test_what_is_done_to_a_shape_is_told(blob: Mesh, cut: bool) -> None:
    mesh = cut_along_seam(blob)[0] if cut else blob
    mesh = Mesh(mesh.vertices, np.concatenate([mesh.faces, [[3, 3, 5]]]), name="blob")
    with heard() as said:
        prepare_shape(mesh, 10)
    assert said[-1] == "blob: 1 face left out, for naming a vertex twice"
    assert [one.endswith("seams of a texture") for one in said[:-1]] == [True] * cut
    scrap = [mesh.n_vertices + np.arange(3)]
    several = Mesh([*mesh.vertices, *np.eye(3) + 9], np.concatenate([mesh.faces, scrap]))
    with heard() as said:
        prepare_shape(several, 10)
    assert [one.endswith("seams of a texture") for one in said] == [True] * cut + [False]


@pytest.mark.parametrize(
    ("size", "level", "told"),
    [
        (9, 1, "component 1 has a larger area"),
        (9, 2, "component 1 has a larger area"),
        (1, 2, "component 1 is nearly as large"),
        (1, 1, ""),
    ],
)
def test_it_is_told_if_another_component_may_be_the_body(
    size: float, level: int, told: str
) -> None:
    ball, other = make_sphere(2), make_sphere(level)
    mesh = Mesh(
        np.concatenate([ball.vertices, other.vertices * size + 20]),
        np.concatenate([ball.faces, other.faces + 162]),
    )
    with pytest.warns(UnbendWarning, match="largest component") as caught:
        prepare_shape(mesh, 10)
    assert told in str(caught[0].message)
    assert bool(told) == ("component 1 " in str(caught[0].message))


def test_beside_what_is_matched_errors_are_larger_and_far_away_nothing_is_known() -> None:
    small, large = make_sphere(0), make_sphere(2)
    stone = large.vertices * [1, 0.8, 0.6] + 0.2 * large.vertices[:, [1, 2, 0]] ** 2
    others = [small.vertices * 0.1 + [x, 0, 0] for x in (1.4, 9)]
    mesh = Mesh(
        np.concatenate([stone, *others]),
        np.concatenate([large.faces, small.faces + 162, small.faces + 174]),
        name="both",
    )
    told = r"largest component is matched"
    with pytest.warns(UnbendWarning, match=told):
        found = match(mesh, (stone, large.faces))
    near, far = slice(162, 174), slice(174, None)
    away = np.linalg.norm(mesh.vertices[near] - stone[found.source_to_target[near]], axis=1)
    assert found.expected_error is not None
    assert (found.expected_error[near] > away / np.sqrt(vertex_areas(mesh)[:162].sum())).all()
    assert (found.source_to_target[far] == -1).all()
    assert np.isnan(found.expected_error[far]).all()
    areas = vertex_areas(mesh)
    assert found.overlap_source == pytest.approx(1 - areas[far].sum() / areas.sum())
    assert found.overlap_target == 1
    with (
        pytest.warns(UnbendWarning, match=told),
        pytest.raises(InputError, match="both: vertex 175 is far from the largest component"),
    ):
        match(mesh, (stone, large.faces), landmarks=[(0, 0), (175, 3)])


def test_of_two_open_shapes_it_is_told_if_their_faces_seem_to_face_different_ways() -> None:
    cap = _cap(0.3, "cap")
    inward = _turned(cap)
    for pair in ((cap, inward), (inward, cap)):
        with pytest.warns(UnbendWarning, match="the faces of inward seem to be oriented inward"):
            prepare_shapes(pair, 10, [False, False])
    for pair in ((cap, cap), (inward, inward)):
        prepare_shapes(pair, 10, [False, False])


def test_beside_a_shape_that_faces_inward_another_that_seems_to_is_turned_too() -> None:
    deep, cap = _cap(-0.7, "deep"), _cap(0.3, "cap")
    right = prepare_shapes((deep, cap), 10, [False, False])
    with pytest.warns(
        UnbendWarning, match="inward: its faces are oriented inward; they are turned"
    ):
        turned = prepare_shapes((_turned(deep), _turned(cap)), 10, [False, False])
    with pytest.warns(
        UnbendWarning, match="inward: its faces are oriented inward; they are turned"
    ):
        turned += prepare_shapes((_turned(deep), cap), 10, [False, False])
    for one, other in zip(turned, 2 * right, strict=True):
        np.testing.assert_allclose(one.shape.normals, other.shape.normals, atol=1e-12)


def test_what_cannot_be_matched_is_refused(moebius_strip: Mesh) -> None:
    cloud = Mesh(make_sphere(0).vertices, name="cloud")
    with pytest.raises(MeshError, match="cloud: 12 points at different positions are too few"):
        prepare_shape(cloud, 10)
    with pytest.raises(MeshError, match="only one side, like a Möbius strip"):
        prepare_shape(moebius_strip, 10)


def test_there_are_at_most_half_as_many_functions_as_vertices() -> None:
    """The constant is one of them, and is left out."""
    ball = make_sphere(0)  # of twelve vertices
    middle = ball.vertices[ball.faces[0]].mean(axis=0)
    corners = ball.faces[0]
    fan = [[*corners[[i, (i + 1) % 3]], 12] for i in range(3)]
    thirteen = Mesh(np.vstack([ball.vertices, 1.2 * middle]), np.vstack([ball.faces[1:], fan]))
    for mesh in (ball, thirteen):
        for asked, k in ((4, 3), (6, 5), (10, 5)):
            assert prepare_shape(mesh, asked).shape.k == k


def _with_odds() -> Mesh:
    """A ball with unused vertices, faces that are none, and some wound the other way."""
    ball = make_sphere(1)
    vertices = np.vstack([[[9, 9, 9]], ball.vertices[:20], [[8, 8, 8]], ball.vertices[20:]])
    faces = ball.faces + 1 + (ball.faces >= 20)
    faces[::3] = faces[::3, ::-1]
    none = [[5, 5, 6], [1, 2, 1]]
    faces = np.vstack([faces[:7], none[:1], faces[7:], none[1:], faces[:1]])
    return Mesh(vertices, faces, name="odd")


@pytest.mark.parametrize(("longest", "count"), [(np.inf, 80), (0.1, 80 * 4)])
def test_points_on_faces_are_the_same_points_on_the_mesh_s_own(
    longest: float, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_inputs, "_LONGEST", longest)
    mesh = _with_odds()
    with pytest.warns(UnbendWarning):
        found = prepare_shape(mesh, 10)
    np.testing.assert_array_equal(found.kept[:42], [*range(1, 21), *range(22, 44)])
    faces = np.arange(len(found.shape.faces))
    assert len(faces) == count
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], count)
    corners = found.surface.mesh.vertices[found.shape.faces]
    places = np.einsum("ij,ijk->ik", weights, corners)
    own, moved = found.on_own_faces(faces, weights)
    np.testing.assert_allclose(moved.sum(axis=1), 1)
    there = np.einsum("ij,ijk->ik", moved, mesh.vertices[mesh.faces[own]])
    np.testing.assert_allclose(there, places)
    assert not {7, 81, 82} & set(own.tolist())  # which are no faces, or there already


def test_long_edges_of_whole_shapes_alone_are_split(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_inputs, "_LONGEST", 0.1)
    ball = make_sphere(1)
    half = Mesh(ball.vertices, ball.faces[40:], name="half")
    assert len(prepare_shape(ball, 10).shape.faces) == 4 * 80
    with heard():  # of unused vertices
        assert len(prepare_shape(half, 10).shape.faces) == 40


def test_a_small_hole_does_not_keep_long_edges(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_inputs, "_LONGEST", 0.05)
    ball = make_sphere(2)
    middle = ball.vertices[ball.faces[0]].mean(axis=0)
    a, b, c = ball.faces[0]
    around = [(a, b, ball.n_vertices), (b, c, ball.n_vertices)]  # a third of the face is missing
    holed = Mesh(np.vstack([ball.vertices, middle]), np.vstack([ball.faces[1:], around]))
    assert len(prepare_shape(holed, 10).shape.faces) > 3 * holed.n_faces


def test_a_map_between_vertices_in_use_becomes_one_between_all() -> None:
    mesh = _with_odds()
    with pytest.warns(UnbendWarning):
        found = prepare_shape(mesh, 10)
    n = len(found.kept)
    images = np.random.default_rng(0).permutation(n)
    overlap = np.arange(n) % 5 != 2
    whole = expand(images, overlap, found, found)
    assert whole.dtype == np.int64
    assert np.flatnonzero(whole < 0).tolist() == sorted([0, 21, *found.kept[~overlap]])
    assert whole.min() == -1
    np.testing.assert_array_equal(whole[found.kept[overlap]], found.kept[images[overlap]])
    values = np.arange(2.0 * n).reshape(n, 2)
    rows = expand_rows(values, found, np.nan)
    np.testing.assert_array_equal(rows[found.kept], values)
    assert np.isnan(rows[[0, 21]]).all()


def _cap(least: float, name: str) -> Mesh:
    ball = make_sphere(3)
    inside = (ball.vertices[ball.faces, 0] > least).all(axis=1)
    kept, corners = np.unique(ball.faces[inside], return_inverse=True)
    return Mesh(ball.vertices[kept], corners.reshape(-1, 3), name=name)


def _turned(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[:, ::-1], name="inward")
