"""Carried values are those of the place they come from; labels are never averaged."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from unbend import Mesh
from unbend.correspondence import transfer, transfer_landmarks, value_kind
from unbend.correspondence._transfer import positions_on_target
from unbend.datasets import make_quadruped, make_sphere, rest_map
from unbend.deformation import closest_faces
from unbend.errors import InputError
from unbend.matching import Match, match
from unbend.mesh import faces_around

PERMUTATION = st.integers(1, 20).flatmap(lambda n: st.permutations(range(n)))


def _match(forward, backward, faces=None, weights=None) -> Match:
    return Match(np.asarray(forward), np.asarray(backward), np.eye(1), 1.0, 1.0, (), faces, weights)


def _identity(mesh: Mesh) -> Match:
    """Map each vertex to a corner of one of its faces, exactly."""
    every = np.arange(mesh.n_vertices)
    faces = np.zeros(mesh.n_vertices, dtype=np.int64)
    weights = np.zeros((mesh.n_vertices, 3))
    for corner in range(3):
        faces[mesh.faces[:, corner]] = np.arange(mesh.n_faces)
    weights[mesh.faces[faces] == every[:, None]] = 1
    return _match(every, every, faces, weights)


@given(PERMUTATION)
def test_permutations_permute(order) -> None:
    order = np.array(order)
    for values in (order * 0.5, order, np.stack([order * 1.0] * 2, axis=1), order.astype(str)):
        carried = transfer(values, np.argsort(order), target=np.zeros((len(order), 3)))
        np.testing.assert_array_equal(carried, values[order])
    np.testing.assert_array_equal(transfer(order, _match(np.argsort(order), order)), order[order])


def test_an_array_leads_from_source_to_target() -> None:
    triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 3, 0]], [[0, 1, 2]])
    assert transfer([10, 20, 30], [1, 2, 0], target=triangle).tolist() == [30, 10, 20]
    # Vertex 1 is nobody's image: it takes what the nearest one along the edges takes.
    assert transfer([10, 20], [2, 0], target=triangle).tolist() == [20, 20, 10]


def test_the_identity_changes_nothing(blob: Mesh) -> None:
    same = _identity(blob)
    carried = transfer(blob.vertices, same, source=blob, target=blob)
    np.testing.assert_allclose(carried, blob.vertices, atol=1e-12)
    labels = np.where(blob.vertices[:, 0] > 0, "front", "back")
    np.testing.assert_array_equal(transfer(labels, same, source=blob, target=blob), labels)
    column = labels.astype(object)  # as pandas has it
    np.testing.assert_array_equal(transfer(column, same, source=blob, target=blob), labels)


def test_positions_carried_through_faces_are_finer_than_through_vertices() -> None:
    # Both shapes at rest, meshed apart: each target vertex should get its own position.
    source = make_quadruped("standing", n_vertices=600)
    target = make_quadruped("standing", n_vertices=500, meshing=1)
    forward, backward = rest_map(source, target), rest_map(target, source)
    fans = faces_around(target.mesh.faces, target.mesh.n_vertices)
    found = _match(
        forward,
        backward,
        *closest_faces(
            source.mesh.vertices, target.mesh.vertices, target.mesh.faces, fans, forward
        ),
    )
    fine = transfer(source.mesh.vertices, found, source=source.mesh, target=target.mesh)
    coarse = transfer(source.mesh.vertices, found)
    errors = [np.linalg.norm(one - target.mesh.vertices, axis=1).mean() for one in (fine, coarse)]
    assert errors[0] < 0.4 * errors[1]
    equal = np.tile([2.7, -1 / 3], (source.mesh.n_vertices, 1))
    carried = transfer(equal, found, source=source.mesh, target=target.mesh)
    np.testing.assert_array_equal(np.unique(carried, axis=0), equal[:1])


def test_body_parts_arrive_away_from_their_borders() -> None:
    source = make_quadruped("standing", n_vertices=600)
    target = make_quadruped("galloping", n_vertices=500, meshing=1)
    carried = transfer(source.labels, _match(rest_map(source, target), rest_map(target, source)))
    ends = target.mesh.faces
    border = np.zeros(500, dtype=bool)
    border[ends[(target.labels[ends] != target.labels[ends[:, :1]]).any(axis=1)]] = True
    assert (carried == target.labels)[~border].mean() >= 0.99


def test_body_parts_arrive_through_a_computed_match() -> None:
    source = make_quadruped("standing", n_vertices=600)
    target = make_quadruped("walking", n_vertices=500, meshing=1)
    found = match(source.mesh, target.mesh, barycentric=True)
    for meshes in ({}, {"source": source.mesh, "target": target.mesh}):
        parts = transfer(np.array(source.parts)[source.labels], found, **meshes)
        assert (parts == np.array(target.parts)[target.labels]).mean() > 0.95
        weights = np.eye(len(source.parts))[source.labels]
        carried = transfer(weights, found, kind="weights", **meshes)
        np.testing.assert_allclose(carried.sum(axis=1), 1)
        assert carried.min() >= 0
    assert 0.005 < ((carried > 0) & (carried < 1)).any(axis=1).mean() < 0.5  # blended at borders


def test_labels_go_by_majority() -> None:
    # The first target vertex lies at (0.4, 0.3): shares 0.3, 0.4, 0.3 of the source's corners.
    source = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    target = Mesh([[0.4, 0.3, 0], [0, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    corners = [np.vstack([one.vertices[:, :2].T, np.ones(3)]) for one in (source, target)]
    shares = np.linalg.solve(corners[1], corners[0]).T  # of each source vertex on the target
    laid = _match([1, 0, 2], [1, 0, 2], np.zeros(3, dtype=np.int64), shares)
    carried = transfer(["A", "B", "A"], laid, source=source, target=target)
    assert carried.tolist() == ["A", "A", "A"]  # though B has the largest single share
    assert transfer([0.0, 1, 0], laid, source=source, target=target).tolist() == [0, 0, 0]
    gap = [np.nan, 1, np.nan]  # what has no label votes too
    assert np.isnan(transfer(gap, laid, source=source, target=target)).all()
    numbers = transfer([0.0, 1, 0], laid, kind="scalar", source=source, target=target)
    np.testing.assert_allclose(numbers, [0.4, 0, 0], atol=1e-12)
    pairs = [[5, 7], [7, 5], [5, 7]]
    rows = transfer(pairs, laid, kind="label", source=source, target=target)
    assert rows.tolist() == [[5, 7]] * 3  # a row is one label


def test_rounding_does_not_choose_between_labels_of_equal_shares() -> None:
    # The last target vertex lies in the middle of a side of the source's only face.
    source = Mesh([[0, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    laid = _match([0, 1, 2], [0, 1, 2, 0], np.array([0, 1, 0]), np.eye(3)[[0, 1, 2]])
    for noise in (0, 1e-14, -1e-14):
        target = Mesh([*source.vertices, [1 + noise, 0, 0]], [[0, 3, 2], [3, 1, 2]])
        carried = transfer(["A", "B", "C"], laid, source=source, target=target)
        assert carried.tolist() == ["A", "B", "C", "A"]


def test_without_a_preimage_nothing_is_made_up() -> None:
    gap = _match([-1, 0], [1, -1])
    assert np.isnan(transfer([1.0, 2], gap)).tolist() == [False, True]
    assert np.isnan(transfer([[1.0, 2], [3, 4]], gap)).tolist() == [[False] * 2, [True] * 2]
    assert transfer([5, 6], gap).tolist() == [6, -1]
    assert transfer(np.array([0, 1], np.uint8), gap).tolist() == [1, -1]
    assert transfer([True, True], gap).tolist() == [1, -1]
    assert transfer(["a", "b"], gap).tolist() == ["b", ""]
    colors = transfer(np.array([[0, 0, 0], [255, 8, 7]], np.uint8), gap)
    assert (colors.dtype, colors.tolist()) == (np.uint8, [[255, 8, 7], [128, 128, 128]])
    colors = transfer(np.array([[0, 0, 0, 0], [9, 8, 7, 6]], np.uint8), gap)
    assert (colors.dtype, colors.tolist()) == (np.uint8, [[9, 8, 7, 6], [128] * 4])
    small = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    within = _match([0, -1, 2], [0, -1, 2], np.array([0, -1, 0]), np.eye(3))
    carried = transfer([1.0, 2, 3], within, source=small, target=small)
    np.testing.assert_array_equal(carried, [1, np.nan, 3])


def test_nan_corners_without_a_share_do_not_spread(blob: Mesh) -> None:
    values = blob.vertices[:, 0].copy()
    values[7] = np.nan
    carried = transfer(values, _identity(blob), source=blob, target=blob)
    assert np.flatnonzero(np.isnan(carried)).tolist() == [7]


ONE = _match([0], [0])


@pytest.mark.parametrize(
    ("values", "mapping", "options", "sentence"),
    [
        ([1.0, 2], _match([0, 1], [2]), {}, "names source vertex 2, but there are 2 values"),
        ([1.0, 2, 3], [0, 0], {}, "3 rows to carry, but the source has 2 vertices"),
        ([1.0, 2], [0, 0], {}, "maps from source to target: to invert it, give"),
        ([1.0, 2], [0.5], {}, r"no Match must be a list of vertex numbers \(whole"),
        ([1.0, 2], [-2], {}, "no Match must be a list of vertex numbers"),
        ([1.0], _match([0, 0], [1]), {}, "1 row to carry, but the source has 2 vertices"),
        ([1.0], ONE, {"kind": "mean"}, "kind must be"),
        (["a"], ONE, {"kind": "scalar"}, "cannot be averaged"),
        ([1j], ONE, {}, "neither numbers nor labels"),
        ([None], ONE, {}, "neither numbers nor labels"),
        ([[0.5, 0.5], [0.5, 0.6]], _match([0, 0], [0]), {"kind": "weights"}, "sums; row 1 .* 1.1"),
        ([[0, 1], [1.5, -0.5]], _match([0, 0], [0]), {"kind": "weights"}, "row 1 .* least is -0.5"),
        ([[0, 1], [0, 0]], _match([0, 0], [0]), {"kind": "weights"}, "at least one; row 1 .* 0,"),
        (
            [[0, 1], [1, -1]],
            _match([0, 0], [0]),
            {"kind": "weights"},
            "numbers of 0 or more; row 1",
        ),
        ([[0, 1], [1, np.nan]], _match([0, 0], [0]), {"kind": "weights"}, "write 0 where .* row 1"),
        ([0.5, 0.5], _match([0, 0], [0]), {"kind": "weights"}, "must be rows"),
        ([[256, 0, 0]], ONE, {"kind": "color"}, "from 0 to 255"),
        ([[0.5, 0, 1]], ONE, {"kind": "color"}, "from 0 to 1; multiply by 255"),
        ([2**63], ONE, {}, "labels must be below 2.63, and one is 9223372036854775808"),
        (np.ma.array([1.0], mask=[True]), ONE, {}, "some are masked; fill them"),
        ([0.5], ONE, {"kind": "uv"}, "must have two columns"),
    ],
)
def test_what_does_not_fit(values, mapping, options, sentence) -> None:
    with pytest.raises(InputError, match=sentence):
        transfer(values, mapping, **options)


def test_meshes_must_be_those_of_the_match(blob: Mesh) -> None:
    small = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    every = np.zeros(blob.n_vertices)
    for pair in ({"source": small, "target": blob}, {"source": blob, "target": small}):
        with pytest.raises(InputError, match="the map has 642"):
            transfer(every, _identity(blob), **pair)
        with pytest.raises(InputError, match="the map has 642"):  # within faces or not
            transfer(every, _match(np.arange(642), np.arange(642)), **pair)
    with pytest.raises(InputError, match="the map has 642 source vertices, but source has 3"):
        transfer(every, np.arange(642), source=small, target=blob)
    with pytest.raises(InputError, match="names target vertex 641"):
        transfer(every, np.arange(642), target=small)
    for one in ({"source": blob}, {"target": blob}):
        with pytest.raises(InputError, match="both the source and the target"):
            transfer(every, _identity(blob), **one)
    with pytest.raises(InputError, match="names target vertex 641"):
        positions_on_target(np.arange(642), small)
    lying = _match([0, 1, 2], [0, 1, 2], np.array([1, 1, 1]), np.eye(3))
    with pytest.raises(InputError, match="names faces"):
        positions_on_target(lying, small)
    for faces in (blob.faces[::-1], blob.faces[1:]):  # its vertices are as they were
        with pytest.raises(InputError, match="in another order"):
            positions_on_target(_identity(blob), Mesh(blob.vertices, faces))


def test_places_on_the_target_are_vertices_or_within_faces() -> None:
    target = Mesh([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    for mapping in ([2, 1], _match([2, 1], [0, 0, 0])):
        assert positions_on_target(mapping, target).tolist() == [[0, 4, 0], [4, 0, 0]]
    within = _match([2, 1], [0, 0, 0], np.array([0, -1]), np.array([[0.25, 0.25, 0.5], [0, 0, 0]]))
    assert positions_on_target(within, target).tolist() == [[1, 2, 0], [4, 0, 0]]
    assert positions_on_target([0], Mesh([[1, 2, 3]])).tolist() == [[1, 2, 3]]


def test_a_partner_without_faces_stands_in_itself() -> None:
    # The source's only face lies where no target vertex has its partner.
    source = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], [[0, 1, 2]])
    target = Mesh([[5, 5, 5], [0, 0, 0], [1, 0, 0]], [[0, 1, 2]])
    laid = _match([1, 2, 1, 0], [3, 0, 1], np.zeros(4, dtype=np.int64), np.eye(3)[[1, 2, 1, 0]])
    assert transfer([1, 2, 3, 4], laid, source=source, target=target).tolist()[0] == 4
    assert transfer([1.0, 2, 3, 4], laid, source=source, target=target)[0] == 4


def test_carried_skinning_weights_sum_to_one() -> None:
    carried = transfer([[0.4, 0.6006]], ONE, kind="weights")
    np.testing.assert_allclose(carried, [[0.4 / 1.0006, 0.6006 / 1.0006]])


def test_weights_that_do_not_sum_to_one_are_refused(blob: Mesh) -> None:
    """They would pull places, and with them morphs and registrations, towards the origin."""
    found = _identity(blob)
    for wrong in (0.5, np.nan):
        assert found.weights is not None
        weights = found.weights.copy()
        weights[7] *= wrong
        with pytest.raises(InputError, match=r"weights in row 7 sum to (0.5|nan)"):
            positions_on_target(replace(found, weights=weights), blob)


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([[255, 0, 7]], "color"),
        ([[255, 0, 7, 255]], "color"),
        ([[0, 0, 1]], "scalar"),  # a direction
        ([[256, 0, 7]], "scalar"),
        ([[1, 2]], "scalar"),
        ([[1]], "label"),
        ([1], "label"),
        ([1.5], "scalar"),
        ([1.0, np.nan], "label"),
        ([np.nan, np.nan], "scalar"),
        ([np.inf, 1], "scalar"),
        ([[1.0, 2]], "scalar"),
    ],
)
def test_columns_of_whole_numbers_are_colours_or_numbers(values, kind) -> None:
    assert value_kind(np.array(values)) == kind


def test_columns_are_no_colours_under_other_names() -> None:
    for names in (
        ["r", "g", "b"],
        ["Red", "Green", "Blue", "Alpha"],
        ["color_0", "color_1", "colour_2"],
    ):
        assert value_kind(np.full((1, len(names)), 9), names=names) == "color"
    assert value_kind(np.full((1, 3), 9), names=["age", "weight", "score"]) == "scalar"


def test_landmarks_that_cannot_be_carried_are_refused() -> None:
    for labels, vertices, problem in (
        (["a"], [0, 1], "2 landmarks need as many labels, not 1"),
        (["a"], [3], "the source: there is no vertex 3"),
        (["a"], [2], "no landmark corresponds to a vertex of sphere"),
    ):
        with pytest.raises(InputError, match=problem):
            transfer_landmarks(labels, vertices, [0, 1, -1], make_sphere(1))
