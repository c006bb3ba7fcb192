"""The matcher on plain arrays: what is chosen where a symmetry leaves the choice free."""

from dataclasses import replace

import numpy as np
import pytest

from unbend import Mesh
from unbend.datasets import make_biped, make_sphere
from unbend.matching import _solve
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import distinct
from unbend.matching._polish import with_partners
from unbend.matching._proxy import make_proxy
from unbend.matching._shape import Shape
from unbend.matching._solve import candidates, make_sides
from unbend.matching._tips import find_tips


@pytest.fixture(scope="module")
def boxes() -> list[Shape]:
    """A rounded box, which half turns and mirrors leave the same, and as others would round it."""
    ball = make_sphere(3)
    box = ball.vertices * [1.6, 1.0, 0.7]
    found = []
    for seed in range(4):
        noise = 1e-15 * np.random.default_rng(seed).standard_normal(box.shape)
        found.append(prepare_shape(Mesh(box + noise, ball.faces), 40, False)[1])
    return found


def test_rounding_does_not_choose_what_is_looked_at(boxes: list[Shape]) -> None:
    first, *others = boxes
    coarse = make_proxy(first, 200)
    for shape in others:
        np.testing.assert_array_equal(shape.samples, first.samples)
        np.testing.assert_array_equal(find_tips(shape).vertices, find_tips(first).vertices)
        np.testing.assert_array_equal(make_proxy(shape, 200).kept, coarse.kept)


def test_rounding_does_not_choose_among_maps_that_a_symmetry_makes_equal(
    boxes: list[Shape],
) -> None:
    every = np.arange(len(boxes[0].vertices))
    for shape in boxes[::3]:
        sides = make_sides(shape, shape)
        found = candidates(sides)
        assert max(one.energy for one in found[:4]) < 1e-6  # itself and three half turns
        np.testing.assert_array_equal(found[0].registered.forward, every)


def test_the_mirror_image_of_the_target_gives_the_mirrored_maps(boxes: list[Shape]) -> None:
    sides = make_sides(boxes[0], boxes[0])
    turned = candidates(sides.reflected())
    for one in turned[:4]:
        assert one.reflected
        assert one.energy < 1e-6
        assert one.orientation > 0.99  # of the mirror image, so the map turns inside out
        images = boxes[0].vertices[one.registered.forward]
        signs = np.sign((images * boxes[0].vertices).sum(axis=0))
        np.testing.assert_allclose(images, boxes[0].vertices * signs, atol=1e-9)
        assert signs.prod() == -1


def test_what_is_clear_is_what_a_thorough_search_finds(boxes: list[Shape], monkeypatch) -> None:
    one, other = (
        prepare_shape(make_biped(pose, n_vertices=800, meshing=i).mesh, 100, True)[1]
        for i, pose in enumerate(("standing", "walking"))
    )
    sides = make_sides(one, other)
    tried = []
    from_tips = _solve.from_tips
    monkeypatch.setattr(
        _solve, "from_tips", lambda sides, *sizes: tried.append(sizes) or from_tips(sides, *sizes)
    )
    quick = candidates(sides)
    assert tried == [_solve._FEW]
    thorough = candidates(sides, thorough=True)
    assert tried == [_solve._FEW, _solve._MANY]
    assert len(quick) < len(thorough)
    ways = [quick[0], thorough[0]]
    assert len(distinct(ways, sides.target.proxy.shape, sides.source.proxy.shape.areas)) == 1
    # Where several are equally good nothing is clear.
    candidates(make_sides(boxes[0], boxes[0]))
    assert tried[-1] == _solve._MANY


def test_a_vertex_has_a_partner_where_most_around_it_have(boxes: list[Shape]) -> None:
    sides = make_sides(boxes[0], boxes[0])
    best = candidates(sides)[0]
    right = boxes[0].vertices[:, 0] > 0.1
    astray = np.abs(boxes[0].vertices[:, 0]) > 0.9 * boxes[0].vertices[:, 0].max()
    few = np.flatnonzero(astray)[[0, -1]]  # one at either end
    ragged = right.copy()
    ragged[few] = ~ragged[few]
    ours = best.registered.source._replace(within=ragged)
    found = replace(best, registered=best.registered._replace(source=ours))
    smooth = with_partners(found, sides, 0.0).registered
    assert (smooth.source.within == right)[few].all()
    assert (smooth.source.within == right).mean() > 0.95
    assert smooth.target.within.all()
    assert with_partners(found, sides, 0.7).registered.source.within.all()
