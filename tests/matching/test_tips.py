"""Tips of limbs: found where they are, and told apart by the ways between them."""

import numpy as np

from unbend.datasets import make_biped
from unbend.matching._inputs import prepare_shape
from unbend.matching._tips import _assignments, find_tips, maps_from_tips


def test_a_person_has_five_tips() -> None:
    body = make_biped("walking", n_vertices=1500)
    tips = find_tips(prepare_shape(body.mesh, 60, True, None)[1])
    named = [body.parts[label] for label in body.labels[tips.vertices]]
    assert sorted(named) == ["head", "left_arm", "left_leg", "right_arm", "right_leg"]
    np.testing.assert_allclose(tips.ways, tips.ways.T)
    assert (tips.ways[~np.eye(5, dtype=bool)] > 0.3).all()


def test_limbs_of_other_lengths_change_little() -> None:
    # A tree whose five limbs grow, each by a factor of its own, and whose unit is another.
    rng = np.random.default_rng(0)
    body = np.array([0, 0.1, 0.1, 0.7, 0.7])
    trunk = np.abs(body[:, None] - body)
    limbs = np.array([0.3, 0.7, 0.72, 0.9, 0.93])

    def ways(lengths: np.ndarray) -> np.ndarray:
        return (trunk + lengths[:, None] + lengths) * (1 - np.eye(5))

    order = rng.permutation(5)
    grown = 3.0 * ways(limbs * [1.5, 0.8, 0.8, 1.2, 1.2])[np.ix_(order, order)]
    found = _assignments(ways(limbs), grown)
    right = [k for k, (mine, other) in enumerate(found) if (order[other] == mine).all()]
    assert right[0] < 20
    exact = _assignments(ways(limbs), 2 * ways(limbs))[0]
    assert (exact[0] == exact[1]).all()
    assert len(exact[0]) == 5


def test_maps_are_orthogonal_and_shapes_without_tips_have_none(blob) -> None:
    shape = prepare_shape(make_biped("running", n_vertices=1000).mesh, 60, True, None)[1]
    maps = maps_from_tips(shape, shape)
    np.testing.assert_allclose(
        maps @ maps.transpose(0, 2, 1), np.tile(np.eye(7), (len(maps), 1, 1)), atol=1e-9
    )
    np.testing.assert_allclose(maps[0], np.eye(7), atol=1e-4)
    smooth = prepare_shape(blob, 60, True, None)[1]
    assert maps_from_tips(smooth, shape).shape[1:] == (7, 7)
