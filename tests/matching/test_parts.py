"""Parts, hints and alternatives, on bodies whose exact truth is known."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from sheets import make_sheet
from testshapes.damage import Damaged, cut, cut_discs, damaged_truth, keep
from testshapes.scanning import add_components
from unbend import Mesh, evaluate, match
from unbend.datasets import Shape as ShapeWithTruth
from unbend.datasets import make_biped, make_octopus, make_sphere, rest_map
from unbend.errors import InputError, UnbendWarning
from unbend.matching import _constants as constants
from unbend.matching._inputs import prepare_shape
from unbend.matching._registration import (
    Pose,
    Registered,
    limited,
    register,
)
from unbend.matching._shape import Shape, make_shape
from unbend.mesh import vertex_areas

SOURCE = make_biped("standing", n_vertices=900)
TARGET = make_biped("walking", n_vertices=900, meshing=1)
TRUTH = rest_map(SOURCE, TARGET)


def _sheet() -> Mesh:
    square = make_sheet(9)
    x, y, _ = (2 * square.vertices - 1).T
    return Mesh(np.stack([x, y, 0.1 * x * y], axis=1), square.faces)


def test_the_rim_of_a_sheet_leads_outward() -> None:
    sheet = _sheet()
    flat = sheet.vertices * [1, 1, 0]
    shape = make_shape(flat, sheet.faces, *np.ones((2, 81)), np.ones((81, 2)), partial=True)
    conormals = shape.conormals_in(flat)
    on_boundary = np.abs(flat).max(axis=1) == 1
    np.testing.assert_array_equal(np.linalg.norm(conormals, axis=1) > 0, on_boundary)
    out = np.where(np.abs(flat) == 1, flat, 0)  # straight off a side, slanting off a corner
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1)
    np.testing.assert_allclose(conormals, out, atol=1e-9)


def test_only_a_part_has_a_rim(blob: Mesh) -> None:
    half = _sheet()
    assert not prepare_shape(half, 20).shape.conormals.any()
    assert prepare_shape(half, 20, partial=True).shape.conormals.any()
    assert not prepare_shape(blob, 20, partial=True).shape.partial


@pytest.mark.parametrize(("level", "partial"), [(3, True), (5, False)])
def test_a_pinhole_makes_no_part(level: int, partial: bool) -> None:
    # Without one face the rim is three edges long: 0.12 and 0.03 of sqrt(area).
    ball = make_sphere(level)
    pricked = Mesh(ball.vertices, ball.faces[1:])
    assert prepare_shape(pricked, 20, partial=True).shape.partial == partial


def test_the_registration_keeps_what_is_beyond_the_rim_out() -> None:
    # From the truth, of a body and the same one without an arm, the truth stays.
    torn = keep(SOURCE.mesh, SOURCE.labels != SOURCE.parts.index("left_arm"))
    whole, part = (prepare_shape(mesh, 60, partial=True).shape for mesh in (SOURCE.mesh, torn.mesh))
    size = float(
        np.sqrt(vertex_areas(SOURCE.mesh).sum() / vertex_areas(torn.mesh).sum())
    )  # a part of unit area is drawn larger
    there = np.where(torn.image >= 0, torn.image, 0)
    truth = torn.image >= 0
    # Everything a little off where it belongs, the arm included.
    moved = size * (whole.vertices - whole.vertices[torn.origin].mean(axis=0))
    moved += part.vertices.mean(axis=0)
    turns = np.tile(np.eye(3), (len(moved), 1, 1))
    back = (part.vertices - part.vertices.mean(axis=0)) / size
    back += whole.vertices[torn.origin].mean(axis=0)
    start = Registered(
        there,
        torn.origin,
        Pose(moved, turns, truth, size),
        Pose(back, turns[: len(back)].copy(), np.ones(len(back), dtype=bool), 1 / size),
    )
    (found,) = register(whole, part, [start], constants.DATA_WEIGHTS[2:], 8)
    overlap = (found.source.overlap & truth).sum() / (found.source.overlap | truth).sum()
    assert overlap > 0.98
    assert found.target.overlap.all()
    assert abs(found.source.size / size - 1) < 0.02
    both = found.source.overlap & truth
    off = np.linalg.norm(part.vertices[found.forward] - part.vertices[there], axis=1)
    assert off[both].mean() < 0.01


def test_parts_are_pulled_over_no_less_than_an_edge() -> None:
    torn = cut(SOURCE.mesh, SOURCE.mesh.vertices[:, 2], 0.5).mesh
    whole, part = (prepare_shape(one, 20, True).shape for one in (SOURCE.mesh, torn))
    assert limited(whole, whole, constants.DATA_WEIGHTS) == constants.DATA_WEIGHTS
    most = 1 / part.edge**2  # of unit area as the other one, of fewer and longer edges
    assert part.edge > whole.edge
    assert constants.DATA_WEIGHTS[4] < most < constants.DATA_WEIGHTS[6]
    data_weights = limited(whole, part, constants.DATA_WEIGHTS)
    assert data_weights == limited(part, whole, constants.DATA_WEIGHTS)
    assert list(data_weights) == sorted(
        {min(data_weight, most) for data_weight in constants.DATA_WEIGHTS}
    )
    assert limited(part, whole, constants.DATA_WEIGHTS, 2)[-1] == pytest.approx(most / 4)


@pytest.mark.parametrize("seed", [0, 1])
def test_half_a_body_is_found_on_the_whole_one(seed: int) -> None:
    direction = np.random.default_rng(seed).standard_normal(3)
    half = cut(TARGET.mesh, TARGET.mesh.vertices @ direction, 0.5)
    found = match(SOURCE.mesh, half.mesh)
    measured = evaluate(found, half.mesh, np.arange(len(TRUTH)), damaged_truth(TRUTH, None, half))
    assert measured.mean() < 0.06  # of the half's sqrt(area)
    assert measured.overlap.iou > 0.8


@pytest.mark.parametrize("side", ["source", "target"])
def test_a_limb_that_is_missing_gets_no_partner(side: str) -> None:
    torn_side = SOURCE if side == "source" else TARGET
    torn = keep(torn_side.mesh, torn_side.labels != torn_side.parts.index("left_arm"))
    pair = [torn.mesh, TARGET.mesh] if side == "source" else [SOURCE.mesh, torn.mesh]
    left: list[Damaged | None] = [torn, None] if side == "source" else [None, torn]
    found = match(*pair)
    truth = damaged_truth(TRUTH, *left)
    measured = evaluate(found, pair[1], np.arange(len(truth)), truth)
    assert measured.mean() < 0.03
    assert measured.overlap.iou > 0.95
    other = found.overlap_target if side == "source" else found.overlap_source
    gone = vertex_areas(torn.mesh).sum() / vertex_areas(torn_side.mesh).sum()
    assert abs(other - gone) < 0.03
    # Whole shapes have partners everywhere, also where that is asked for of parts.
    everywhere = match(*pair, partial="none")
    assert (everywhere.source_to_target >= 0).all()
    assert everywhere.overlap_source == everywhere.overlap_target == 1


def test_a_hole_is_left_out_on_the_other_side_alone() -> None:
    torn = cut_discs(TARGET.mesh, 0.1, 1, random_state=5)
    found = match(SOURCE.mesh, torn.mesh, partial="target")
    truth = damaged_truth(TRUTH, None, torn)
    measured = evaluate(found, torn.mesh, np.arange(900), truth)
    assert measured.mean() < 0.03
    assert measured.overlap.iou > 0.9
    assert (found.target_to_source >= 0).all()
    assert found.overlap_target == 1
    assert 0.85 < found.overlap_source < 0.95
    matched = found.source_to_target >= 0
    fine = match(SOURCE.mesh, torn.mesh, partial="target", barycentric=True)
    np.testing.assert_array_equal(fine.faces >= 0, matched)
    np.testing.assert_array_equal(np.isfinite(fine.weights).all(axis=1), matched)


def test_alternatives_are_other_limbs_and_share_the_probability() -> None:
    octopus = make_octopus("floating", n_vertices=700).mesh
    found = match(octopus, octopus, n_matches=3)
    assert len(found.alternatives) == 2
    images = [octopus.vertices[one.source_to_target] for one in (found, *found.alternatives)]
    areas = vertex_areas(octopus)
    unit = np.sqrt(areas.sum())
    for i in range(3):
        for j in range(i):
            apart = np.linalg.norm(images[i] - images[j], axis=1) > 0.15 * unit
            assert areas[apart].sum() > 0.02 * areas.sum()
    trust = [one.confidence for one in (found, *found.alternatives)]
    assert trust == sorted(trust, reverse=True)
    assert sum(trust) <= 1 + 1e-9
    assert found.hypotheses[0].energy <= found.alternatives[0].hypotheses[0].energy


def _end(shape: ShapeWithTruth, part: str) -> int:
    rows = np.flatnonzero(shape.labels == shape.parts.index(part))
    away = np.linalg.norm(shape.rest[rows] - shape.rest.mean(axis=0), axis=1)
    return int(rows[away.argmax()])


def test_hints_settle_which_arm_is_which() -> None:
    octopus = make_octopus("floating", n_vertices=700)
    arms = [f"{side}_arm_{i}" for side in ("left", "right") for i in range(1, 5)]
    ends = [_end(octopus, arm) for arm in arms]
    # Turned by one arm; a hint may be given twice.
    hints = [(ends[i], ends[i + 1]) for i in (0, 1, 0)]
    found = match(octopus.mesh, octopus.mesh, landmarks=hints)
    assert found.missed_landmarks == ()
    unit = np.sqrt(vertex_areas(octopus.mesh).sum())
    for source, target in hints:
        places = octopus.mesh.vertices[[found.source_to_target[source], target]]
        assert np.linalg.norm(places[0] - places[1]) < 0.15 * unit


def test_a_wrong_hint_is_outvoted_and_named() -> None:
    arm, head = _end(SOURCE, "left_arm"), _end(SOURCE, "head")
    hints = [(arm, TRUTH[arm]), (head, TRUTH[_end(SOURCE, "left_leg")])]
    with pytest.warns(UnbendWarning, match="landmark 1 is ignored"):
        found = match(SOURCE.mesh, TARGET.mesh, landmarks=hints)
    assert found.missed_landmarks == (1,)
    assert evaluate(found, TARGET.mesh, np.arange(900), TRUTH).mean() < 0.03


def test_small_components_go_along() -> None:
    whole = add_components(SOURCE.mesh, eyeballs=2, cloth=0, random_state=0)
    with pytest.warns(UnbendWarning, match="its largest component is matched, 900 of"):
        found = match(whole.mesh, TARGET.mesh)
    assert (found.source_to_target >= 0).all()
    eyes = np.arange(900, whole.mesh.n_vertices)
    body = whole.mesh.vertices[:900]
    beside = [np.linalg.norm(body - place, axis=1).argmin() for place in whole.mesh.vertices[eyes]]
    np.testing.assert_array_equal(found.source_to_target[eyes], found.source_to_target[beside])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        turned = match(TARGET.mesh, whole.mesh)
    assert (turned.source_to_target < 900).all()
    assert (turned.target_to_source[eyes] >= 0).all()


def test_what_cannot_be_hinted_is_said(blob: Mesh) -> None:
    with pytest.raises(InputError, match="partial must be one of auto, none"):
        match(blob, blob, partial="maybe")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="n_matches must be a whole number of at least 1, not 0"):
        match(blob, blob, n_matches=0)
    with pytest.raises(InputError, match="landmarks must be rows of two vertex numbers"):
        match(blob, blob, landmarks=[1, 2])
    with pytest.raises(InputError, match=f"there is no vertex {blob.n_vertices}"):
        match(blob, blob, landmarks=[(0, blob.n_vertices)])
    with pytest.raises(InputError, match="give at most 7 landmarks"):
        match(blob, blob, landmarks=[(i, i) for i in range(8)])
    loose = Mesh(np.vstack([blob.vertices, [[9, 9, 9]]]), blob.faces)
    with (
        pytest.warns(UnbendWarning, match="unreferenced"),
        pytest.raises(InputError, match=f"no face uses vertex {blob.n_vertices}; name another"),
    ):
        match(loose, blob, landmarks=[(blob.n_vertices, 0)])


def test_a_mirror_image_has_the_mirrored_rim() -> None:
    half = _sheet()
    shape = prepare_shape(half, 20, partial=True).shape
    mirror = shape.reflected()
    np.testing.assert_allclose(mirror.conormals, shape.conormals * [-1, 1, 1], atol=1e-12)
    fresh: Shape = replace(mirror)
    np.testing.assert_allclose(fresh.edge, mirror.edge)
    np.testing.assert_allclose(fresh.patch_sizes, mirror.patch_sizes)
