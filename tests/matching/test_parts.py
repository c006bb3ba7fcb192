"""Parts, hints and alternatives, on bodies whose exact truth is known."""

import functools
import warnings
from dataclasses import replace

import numpy as np
import pytest

from animals import person
from sheets import make_sheet
from testshapes.damage import cut, cut_discs, damaged_truth, keep
from testshapes.scanning import add_components
from unbend import Mesh, evaluate, match
from unbend._types import IntArray
from unbend.datasets import Shape as ShapeWithTruth
from unbend.datasets import make_biped, make_octopus, make_sphere, rest_map
from unbend.errors import UnbendWarning
from unbend.matching import _constants as constants
from unbend.matching import _inputs
from unbend.matching._inputs import prepare_shape
from unbend.matching._registration import (
    Pose,
    Registered,
    _find_closest,
    _Moving,
    limited,
    register,
)
from unbend.mesh import find_components, vertex_areas
from unbend.report import match_page

N = 500


@pytest.fixture(autouse=True)
def _small_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search on coarse copies of few vertices."""
    monkeypatch.setattr(constants, "N_VERTICES", (200, 400))


_source = functools.partial(person, "standing", n_vertices=N)
_target = functools.partial(person, "walking", n_vertices=N, meshing=1)


@functools.cache
def _truth() -> IntArray:
    return rest_map(_source(), _target())


def test_the_registration_keeps_what_is_beyond_the_rim_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(_inputs, "_LONGEST", np.inf)  # vertices of bodies are those of shapes
    # From the truth, of a body and the same one without an arm, the truth stays.
    body = _source().mesh
    torn = keep(body, _source().labels != _source().parts.index("left_arm"))
    whole, part = (prepare_shape(mesh, 60, partial=True).shape for mesh in (body, torn.mesh))
    # A part of unit area is drawn larger.
    size = float(np.sqrt(vertex_areas(body).sum() / vertex_areas(torn.mesh).sum()))
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


def test_what_lands_on_a_rim_does_not_pull() -> None:
    ours, theirs = (prepare_shape(make_sheet(side), 20, partial=True).shape for side in (9, 12))
    apart = np.linalg.norm(ours.vertices[:, None] - theirs.vertices, axis=2)
    maps = apart.argmin(axis=1), apart.argmin(axis=0)
    poses = (
        Pose(one.vertices, np.tile(np.eye(3), (n, 1, 1)), np.arange(n) < 0)
        for one, n in ((ours, 81), (theirs, 144))
    )
    start = Registered(*maps, *poses)
    weight = constants.NORMAL_WEIGHTS[0]
    moving = _Moving(ours, [start], weight), _Moving(theirs, [start.back()], weight)
    _find_closest(*moving)
    for one, goal, way in zip(moving, (theirs, ours), maps, strict=True):
        np.testing.assert_array_equal(one.overlap[:, 0], ~goal.on_boundary[way])


def test_a_pull_is_over_no_less_than_an_edge_if_either_is_a_part() -> None:
    fine, coarse = (prepare_shape(make_sheet(side), 10, partial=True).shape for side in (13, 7))
    data_weights = (1.0, 10.0, 3000.0, 9000.0)
    most = 1 / coarse.edge**2
    assert data_weights[1] < most < data_weights[2]
    whole = replace(fine, partial=False), replace(coarse, partial=False)
    for pair in ((fine, coarse), (coarse, fine), (whole[0], coarse), (fine, whole[1])):
        found = limited(*pair, data_weights)
        assert found[:2] == data_weights[:2]
        assert found[2:] == pytest.approx([most])
        assert limited(*pair, data_weights, 2)[-1] == pytest.approx(most / 4)
    assert limited(*whole, data_weights) == data_weights


@pytest.mark.parametrize("size", [1.0, 1.3])
def test_how_far_something_is_beyond_a_rim(size: float) -> None:
    """Of a square, and one that is drawn larger around it; in the smaller one's unit."""
    ours, theirs = (prepare_shape(make_sheet(side), 10, partial=True).shape for side in (13, 6))
    wide, still = 1.5 * ours.vertices, np.tile(np.eye(3), (169, 1, 1))
    ours = replace(ours, vertices=size * wide)
    pose = Pose(wide, still, np.ones(169, dtype=bool), 1 / size)
    goal = Pose(size * theirs.vertices, still[:36], np.ones(36, dtype=bool), size)
    nearest = np.linalg.norm(wide[:, None] - theirs.vertices, axis=2).argmin(axis=1)
    start = Registered(nearest, np.zeros(36, dtype=np.int64), pose, goal)
    moving = _Moving(ours, [start], constants.NORMAL_WEIGHTS[0])
    other = _Moving(theirs, [start.back()], constants.NORMAL_WEIGHTS[0])
    half = theirs.vertices[:, 0].max()
    over = np.abs(wide) - half  # along either axis, negative inside
    on_side = np.isclose(np.abs(theirs.vertices[nearest]), half)[:, :2]
    expected = (over[:, :2] * on_side).sum(axis=1) / np.sqrt(np.maximum(on_side.sum(axis=1), 1))
    assert expected.max() > 0.3
    found = moving.beyond(other)
    np.testing.assert_allclose(found[:, 0], expected, atol=1e-9)


@pytest.mark.parametrize("part_first", [False, True])
@pytest.mark.parametrize("both", [False, True])
def test_what_is_beyond_the_rim_in_the_end_has_no_partner(part_first: bool, both: bool) -> None:
    """Of a square within a wider one, which leads back even from its sides."""
    part, wide = (
        prepare_shape(make_sheet(side), 10, partial=one).shape
        for side, one in ((6, True), (13, both))
    )
    wide = replace(wide, vertices=1.5 * wide.vertices)
    apart = np.linalg.norm(wide.vertices[:, None] - part.vertices, axis=2)
    every = [
        Pose(one.vertices, np.tile(np.eye(3), (n, 1, 1)), np.ones(n, dtype=bool))
        for one, n in ((part, 36), (wide, 169))
    ]
    shapes, maps = [part, wide], [apart.argmin(axis=0), apart.argmin(axis=1)]
    if not part_first:
        shapes, maps, every = shapes[::-1], maps[::-1], every[::-1]
    (found,) = register(*shapes, [Registered(*maps, *every)], constants.DATA_WEIGHTS[4:5], 1)
    small, large = found[2:] if part_first else found[:1:-1]
    assert small.overlap.all()
    assert large.overlap[np.abs(wide.vertices).max(axis=1) < part.vertices.max() + 1e-9].all()
    assert not large.overlap[np.abs(wide.vertices).max(axis=1) > wide.vertices.max() - 1e-9].any()


def test_half_a_body_is_found_on_the_whole_one() -> None:
    direction = np.random.default_rng(1).standard_normal(3)
    half = cut(_target().mesh, _target().mesh.vertices @ direction, 0.5)
    found = match(_source().mesh, half.mesh)
    truth = damaged_truth(_truth(), None, half)
    measured = evaluate(found, half.mesh, np.arange(N), truth)
    assert measured.mean() < 0.06  # of the half's sqrt(area)
    assert measured.overlap.iou > 0.8
    assert found.confidence_bound > 0.9


def test_a_half_of_another_size_is_told_unless_its_unit_must_differ() -> None:
    direction = np.random.default_rng(1).standard_normal(3)
    half = cut(_target().mesh, _target().mesh.vertices @ direction, 0.5).mesh
    confidences = []
    for size in (1.0, 3.0, 1000.0):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", UnbendWarning)
            found = match((half.vertices * size, half.faces), _source().mesh)
        confidences.append(found.confidence)
        is_told = any(
            "times as large as that of the source: if both" in str(x.message) for x in told
        )
        assert is_told == (size == 3)
        on_page = match_page((half.vertices * size, half.faces), _source().mesh, found).html
        assert ("times as large as that of the source" in on_page) == (size == 3)
    assert confidences[1] < 0.7 * confidences[0]
    assert confidences[2] == pytest.approx(confidences[0], abs=0.02)


def test_a_limb_that_is_missing_gets_no_partner() -> None:
    torn = keep(_source().mesh, _source().labels != _source().parts.index("left_arm"))
    found = match(torn.mesh, _target().mesh)
    truth = damaged_truth(_truth(), torn, None)
    measured = evaluate(found, _target().mesh, np.arange(len(truth)), truth)
    assert measured.mean() < 0.03
    assert measured.overlap.iou > 0.95
    gone = vertex_areas(torn.mesh).sum() / vertex_areas(_source().mesh).sum()
    assert abs(found.overlap_target - gone) < 0.03


def test_a_hole_is_left_out_on_the_other_side_alone() -> None:
    torn = cut_discs(_target().mesh, 0.1, 1, random_state=5)
    found = match(_source().mesh, torn.mesh, partial="target", barycentric=True)
    truth = damaged_truth(_truth(), None, torn)
    measured = evaluate(found, torn.mesh, np.arange(N), truth)
    assert measured.mean() < 0.03
    assert measured.overlap.iou > 0.9
    assert (found.target_to_source >= 0).all()
    assert found.overlap_target == 1
    assert 0.85 < found.overlap_source < 0.95
    matched = found.source_to_target >= 0
    np.testing.assert_array_equal(found.faces >= 0, matched)
    np.testing.assert_array_equal(np.isfinite(found.weights).all(axis=1), matched)


def test_alternatives_are_other_limbs_and_share_the_probability() -> None:
    octopus = make_octopus("floating", n_vertices=500).mesh
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


@pytest.mark.filterwarnings("ignore:.*another map fits far better")  # the identity
def test_hints_settle_which_arm_is_which() -> None:
    octopus = make_octopus("floating", n_vertices=500)
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
    arm, head = _end(_source(), "left_arm"), _end(_source(), "head")
    hints = [(arm, _truth()[arm]), (head, _truth()[_end(_source(), "left_leg")])]
    told = "the landmark at vertices {} and {} is ignored".format(*hints[1])
    with pytest.warns(UnbendWarning, match=told):
        found = match(_source().mesh, _target().mesh, landmarks=hints)
    assert found.missed_landmarks == (1,)
    assert evaluate(found, _target().mesh, np.arange(N), _truth()).mean() < 0.03


def test_small_components_go_along() -> None:
    whole = add_components(_source().mesh, eyeballs=2, cloth=0, random_state=0)
    with pytest.warns(UnbendWarning, match=f"its largest component is matched, {N} of"):
        found = match(whole.mesh, _target().mesh)
    assert (found.source_to_target >= 0).all()
    eyes = np.arange(N, whole.mesh.n_vertices)
    body = whole.mesh.vertices[:N]
    beside = [np.linalg.norm(body - place, axis=1).argmin() for place in whole.mesh.vertices[eyes]]
    np.testing.assert_array_equal(found.source_to_target[eyes], found.source_to_target[beside])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        turned = match(_target().mesh, whole.mesh)
    assert (turned.source_to_target < N).all()
    assert (turned.target_to_source[eyes] >= 0).all()


def test_distances_are_in_units_of_all_of_the_target() -> None:
    body, ball = _target().mesh, make_sphere(2)
    size = 3 * np.sqrt(vertex_areas(body).sum() / vertex_areas(ball).sum())
    both = Mesh(
        np.vstack([body.vertices, size * ball.vertices + 100]),
        np.vstack([body.faces, ball.faces + body.n_vertices]),
    )
    alone = match(_source().mesh, body)
    with pytest.warns(UnbendWarning, match="its largest component is matched"):
        found = match(_source().mesh, both)
    np.testing.assert_array_equal(found.source_to_target, alone.source_to_target)
    smaller = np.sqrt(0.1)
    np.testing.assert_allclose(found.expected_error, smaller * alone.expected_error, rtol=1e-6)
    for one, other in zip(found.hypotheses, alone.hypotheses, strict=True):
        assert one.difference == pytest.approx(smaller * other.difference)


@pytest.mark.filterwarnings("ignore:.*its largest component is matched")
def test_a_landmark_without_partner_is_told() -> None:
    """It lies on another component, and the map leaves out what that hangs on."""
    one, other = make_biped("running", n_vertices=1000), make_biped("sitting", n_vertices=1100)
    along = other.mesh.vertices[:, np.ptp(other.mesh.vertices, axis=0).argmax()]
    left = (along > np.quantile(along, 0.4))[other.mesh.faces].all(axis=1)
    ids, faces = np.unique(other.mesh.faces[left], return_inverse=True)
    torn = Mesh(other.mesh.vertices[ids], faces.reshape(-1, 3))
    components = find_components(torn.faces, torn.n_vertices)
    truth = rest_map(one, other)
    source = int(np.flatnonzero(np.isin(truth, ids[components.of_vertex == 1]))[0])
    vertex = int(np.searchsorted(ids, truth[source]))
    with pytest.warns(UnbendWarning, match=f"at vertices {source} and {vertex} has no part"):
        found = match(one.mesh, torn, landmarks=[(source, vertex)], partial="target", refine=False)
    assert found.source_to_target[source] == -1
    assert found.missed_landmarks == (0,)
