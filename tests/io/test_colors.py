"""Numbers take the colours of viridis, labels one each."""

import matplotlib
import numpy as np
import pytest

from unbend.errors import InputError
from unbend.io import value_colors


def test_numbers_have_viridis() -> None:
    values = np.linspace(3, 5, 200)
    want = 255 * matplotlib.colormaps["viridis"](np.linspace(0, 1, 200))[:, :3]
    assert np.abs(value_colors(values) - want).max() < 5
    np.testing.assert_array_equal(value_colors(values[:, None]), value_colors(values))
    marks = np.linspace(0, 1, 17)
    exact = np.rint(255 * matplotlib.colormaps["viridis"](marks)[:, :3])
    np.testing.assert_array_equal(value_colors(marks), exact)
    # As seen without hue, greater is lighter.
    light = value_colors(values) @ [0.21, 0.72, 0.07]
    assert (np.diff(light) > -1).all()


def test_numbers_of_both_signs_have_blue_white_and_red() -> None:
    marks = np.linspace(-1, 1, 11)
    want = 255 * matplotlib.colormaps["RdBu_r"]((marks + 1) / 2)[:, :3]
    exact = value_colors(7 * marks)
    assert np.abs(exact - want).max() < 5
    np.testing.assert_array_equal(value_colors([-0.4, 0.0, 1.0]), exact[[3, 5, 10]])
    assert value_colors([-0.04, 1.0]).tolist() == [[68, 1, 84], [253, 231, 37]]  # noise


def test_what_is_no_number_is_grey() -> None:
    colors = value_colors([np.nan, 1.0, 1.0, np.inf])
    assert colors[[0, 3]].tolist() == [[153] * 3] * 2
    assert colors[1].tolist() == colors[2].tolist() == [68, 1, 84]
    assert value_colors([np.nan, np.nan]).tolist() == [[153] * 3] * 2


def test_limits_are_the_ends() -> None:
    colors = value_colors([-1.0, 0.0, 2.0, 3.0], limits=(0, 2))
    np.testing.assert_array_equal(colors, value_colors([0.0, 0.0, 2.0, 2.0]))


@pytest.mark.parametrize("labels", [["leg", "arm", "", "leg"], [7, 2, -1, 7], [7, 2, np.nan, 7]])
def test_each_label_has_a_colour(labels: list) -> None:
    leg, arm, none, again = value_colors(labels, kind="label").tolist()
    assert leg == again
    assert none == [153] * 3
    assert len({tuple(one) for one in (leg, arm, none)}) == 3


def test_labels_have_the_colors_of_okabe_and_ito_in_turn() -> None:
    published = ["0072B2", "E69F00", "009E73", "CC79A7", "56B4E9", "D55E00", "F0E442"]
    colors = value_colors(range(21), kind="label")
    assert [bytes(one).hex().upper() for one in colors[:7]] == published
    assert len(np.unique(colors[:14], axis=0)) == 14  # the same seven, darker
    np.testing.assert_array_equal(colors[14:], colors[:7])


def test_weights_have_the_colour_of_the_largest() -> None:
    weights = np.array([[0.9, 0.1], [0.2, 0.8], [np.nan, 0.3], [0.6, 0.4]])
    colors = value_colors(weights, kind="weights")
    np.testing.assert_array_equal(colors[[0, 1, 3]], value_colors([0, 1, 0], kind="label"))
    assert colors[2].tolist() == [153] * 3


def test_several_numbers_and_other_kinds_have_none() -> None:
    with pytest.raises(InputError, match="2 numbers for each vertex"):
        value_colors(np.zeros((3, 2)))
    with pytest.raises(InputError, match="not 'number'"):
        value_colors(np.zeros(3), kind="number")
