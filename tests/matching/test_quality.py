"""What a finished map shows of itself bounds its confidence."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from sheets import make_sheet
from unbend import register, transfer
from unbend.errors import UnbendWarning
from unbend.matching import Match
from unbend.matching._inputs import prepare_shape
from unbend.matching._registration import Pose, Registered
from unbend.matching._score import Candidate, confidence_bound, disorder, expected_errors
from unbend.matching._shape import Shape

SIDE = 41


@pytest.fixture(scope="module")
def sheet() -> Shape:
    return prepare_shape(make_sheet(SIDE), 10).shape


def bound(
    shapes: tuple[Shape, Shape],
    forward: np.ndarray,
    backward: np.ndarray,
    orientation: float = 1.0,
    overlap: np.ndarray | None = None,
) -> float:
    poses = [
        Pose(one.vertices, np.tile(np.eye(3), (n, 1, 1)), np.ones(n, dtype=bool))
        for one in shapes
        for n in [len(one.areas)]
    ]
    if overlap is not None:
        poses = [one._replace(overlap=overlap) for one in poses]
    found = Registered(forward, backward, *poses)
    nothing = np.zeros(0, dtype=bool)
    one = Candidate(found, 0.0, orientation, False, nothing)
    return confidence_bound(disorder(*shapes, one))


def test_the_identity_is_in_order_and_a_surface_turned_inside_out_is_not(sheet: Shape) -> None:
    every = np.arange(SIDE**2)
    assert bound((sheet, sheet), every, every) == 1
    assert bound((sheet, sheet), every, every, orientation=0.9) == pytest.approx(1)
    assert bound((sheet, sheet), every, every, orientation=0.8) == pytest.approx(0.5)
    assert bound((sheet, sheet), every, every, orientation=0.68) == 0
    assert bound((sheet, sheet), every, every, orientation=-1.0) == 0


@pytest.mark.parametrize(("share", "expected"), [(0.05, 1.0), (0.2, 0.5), (0.5, 0.0)])
def test_a_map_that_does_not_lead_back_is_in_disorder(
    sheet: Shape, share: float, expected: float
) -> None:
    """A strip of so much of the area is led back to the opposite side."""
    every = np.arange(SIDE**2)
    back = every.copy()
    strip = every < share * SIDE**2
    back[strip] = every[::-1][strip]
    assert bound((sheet, sheet), every, back) == pytest.approx(expected, abs=0.15)
    assert bound((sheet, sheet), back, every) == pytest.approx(expected, abs=0.15)


@pytest.mark.parametrize(("share", "most"), [(0.05, 1.0), (0.3, 0.5), (0.5, 0.0)])
def test_a_map_that_crowds_is_in_disorder(sheet: Shape, share: float, most: float) -> None:
    """A strip is pressed into a tenth of its width, though most of it returns."""
    x = sheet.vertices[:, 0] - sheet.vertices[:, 0].min()
    pressed = sheet.vertices.copy()
    pressed[x < share, 0] -= 0.9 * x[x < share]
    forward = cKDTree(sheet.vertices).query(pressed)[1]
    backward = cKDTree(pressed).query(sheet.vertices)[1]
    assert bound((sheet, sheet), forward, backward) <= most


def test_only_what_has_a_partner_counts(sheet: Shape) -> None:
    every = np.arange(SIDE**2)
    left = every < SIDE**2 // 2
    back = np.where(left, every, every[::-1])
    assert bound((sheet, sheet), every, back) == 0
    assert bound((sheet, sheet), every, back, overlap=left) == 1


def test_shapes_of_very_different_resolution_are_not_crowded() -> None:
    fine, coarse = make_sheet(SIDE), make_sheet(5)
    shapes = tuple(prepare_shape(mesh, 10).shape for mesh in (fine, coarse))
    there, back = (
        cKDTree(one.vertices).query(other.vertices)[1] for one, other in (shapes[::-1], shapes)
    )
    assert bound(shapes, there, back) == 1
    assert bound(shapes[::-1], back, there) == 1


def test_what_uses_a_match_in_disorder_says_so() -> None:
    sheet = make_sheet(5)
    every = np.arange(25)
    poor = Match(every, every, np.eye(1), 0.68, 0.1, confidence_bound=0.1)
    with pytest.warns(UnbendWarning, match=r"orientation \+0.68, confidence at most 0.10"):
        transfer(np.arange(25.0), poor, target=sheet)
    with pytest.warns(UnbendWarning, match="part of the map is wrong"):
        register(sheet, sheet, poor)
    for bound in (1.0, 0.999):  # not "at most 1.00"
        transfer(np.arange(25.0), replace(poor, confidence_bound=bound), target=sheet)


def test_expected_errors_grow_with_gaps_with_other_maps_and_with_doubt(sheet: Shape) -> None:
    n, every = SIDE**2, np.arange(SIDE**2)
    pose = Pose(sheet.vertices, np.tile(np.eye(3), (n, 1, 1)), every != 7)
    off = pose._replace(places=sheet.vertices + (every < n // 2)[:, None] * [0.0, 0.0, 0.1])
    nothing = np.zeros(0, dtype=bool)
    exact, poor = (
        expected_errors(
            sheet,
            sheet,
            Candidate(Registered(every, every, one, pose), 0.0, 1.0, False, nothing),
            np.zeros(n),
            0.0,
        )
        for one in (pose, off)
    )
    assert np.isnan(exact[7])
    assert np.nanmax(exact[every < n // 2]) < np.nanmin(poor[every < n // 2])
    one = Candidate(Registered(every, every, pose, pose), 0.0, 1.0, False, nothing)
    assert np.nanmin(expected_errors(sheet, sheet, one, np.zeros(n), 0.5) - exact) > 0.05
    elsewhere = np.where(every == 3, 0.2, 0.0)
    more = expected_errors(sheet, sheet, one, elsewhere, 0.0) - exact
    assert more[3] > 0.1
    np.testing.assert_array_equal(more[(every != 3) & (every != 7)], 0)
