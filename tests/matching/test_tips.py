"""Tips of limbs: found where they are, and told apart by the ways between them."""

import numpy as np

from unbend import Mesh
from unbend.datasets import make_biped, make_octopus, make_sphere
from unbend.matching._inputs import prepare_shape
from unbend.matching._tips import _assignments, find_tips, maps_from_tips


def test_a_person_has_five_tips() -> None:
    body = make_biped("walking", n_vertices=1500)
    tips = find_tips(prepare_shape(body.mesh, 60, True, None)[1])
    named = [body.parts[label] for label in body.labels[tips.vertices]]
    assert sorted(named) == ["head", "left_arm", "left_leg", "right_arm", "right_leg"]
    np.testing.assert_allclose(tips.ways, tips.ways.T)
    assert (tips.ways[~np.eye(5, dtype=bool)] > 0.3).all()


def test_a_star_has_a_tip_on_every_ray() -> None:
    ball = make_sphere(4)
    angles = 2 * np.pi * np.arange(5) / 5
    rays = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    reach = 1 + 2 * np.exp(-12 * (1 - ball.vertices @ rays.T)).sum(axis=1)
    star = prepare_shape(Mesh(ball.vertices * reach[:, None], ball.faces), 40, True, None)[1]
    tips = find_tips(star)
    ends = star.vertices[tips.vertices]
    ends /= np.linalg.norm(ends, axis=1, keepdims=True)
    order = (rays @ ends.T).argmax(axis=1)  # the tip of each ray
    assert sorted(order) == list(range(len(ends)))
    assert (rays * ends[order]).sum(axis=1).min() > 0.99
    # All ways between rays side by side are about equal, and so are the longer ones.
    ways = tips.ways[np.ix_(order, order)]
    beside, beyond = (np.diag(np.roll(ways, -step, axis=1)) for step in (1, 2))
    for alike in (beside, beyond):
        assert alike.max() < 1.1 * alike.min()
    assert beyond.min() > beside.max()


def test_an_octopus_has_tips_on_arms_of_their_own() -> None:
    body = make_octopus("floating", n_vertices=1500)
    tips = find_tips(prepare_shape(body.mesh, 60, True, None)[1])
    named = [body.parts[label] for label in body.labels[tips.vertices]]
    assert len(named) == len(set(named)) == 7  # of its eight arms and its mantle


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
