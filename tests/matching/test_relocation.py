"""Hypotheses mended by distances: truths that hold for two poses of one body."""

from dataclasses import replace

import numpy as np
import pytest

from unbend import Mesh
from unbend._types import IntArray
from unbend.datasets import Shape as Body
from unbend.datasets import make_quadruped, rest_map
from unbend.matching._inputs import prepare_shape
from unbend.matching._proxy import make_proxy
from unbend.matching._registration import Pose, Registered, lift, lower
from unbend.matching._relocation import EVERYWHERE, TRUNK, _central, relocate
from unbend.matching._shape import Shape

SOURCE = make_quadruped("standing", n_vertices=500)
TARGET = make_quadruped("galloping", n_vertices=500, meshing=1)
THERE, BACK = rest_map(SOURCE, TARGET), rest_map(TARGET, SOURCE)


def _shape(mesh: Mesh) -> Shape:
    return prepare_shape(mesh, 20, True).shape


def _still(shape: Shape) -> Pose:
    n = len(shape.areas)
    return Pose(shape.vertices, np.tile(np.eye(3), (n, 1, 1)), np.ones(n, dtype=bool))


def _off(found: IntArray, truth: IntArray, goal: Shape) -> np.ndarray:
    return np.linalg.norm(goal.vertices[found] - goal.vertices[truth], axis=1)


def _front_legs(body: Body) -> np.ndarray:
    named = [i for i, part in enumerate(body.parts) if "foreleg" in part]
    assert len(named) == 2
    return np.isin(body.labels, named)


@pytest.fixture(scope="module")
def shapes() -> tuple[Shape, Shape]:
    return _shape(SOURCE.mesh), _shape(TARGET.mesh)


@pytest.mark.parametrize("asked", [EVERYWHERE, TRUNK])
def test_a_right_map_stays_right(shapes: tuple[Shape, Shape], asked: float) -> None:
    found = Registered(THERE, BACK, *map(_still, shapes))
    for maps, truth, goal in zip(
        relocate(*shapes, found, asked), (THERE, BACK), shapes[::-1], strict=True
    ):
        assert _off(maps, truth, goal).mean() < 0.05


def test_asked_everywhere_vertices_count_by_their_areas(shapes: tuple[Shape, Shape]) -> None:
    areas, ways = shapes[0].areas, shapes[0].ways
    np.testing.assert_array_equal(_central(areas, ways, EVERYWHERE), areas)
    trunk = _central(areas, ways, TRUNK) / areas
    assert trunk.argmax() == (ways @ areas).argmin()


def test_swapped_legs_find_back(shapes: tuple[Shape, Shape]) -> None:
    assert SOURCE.mirror is not None
    assert TARGET.mirror is not None
    legs = _front_legs(SOURCE), _front_legs(TARGET)
    swapped = (
        np.where(legs[0], TARGET.mirror[THERE], THERE),
        np.where(legs[1], SOURCE.mirror[BACK], BACK),
    )
    assert _off(swapped[0], THERE, shapes[1])[legs[0]].mean() > 0.15
    found = Registered(*swapped, *map(_still, shapes))
    forward, backward = relocate(*shapes, found, TRUNK)
    assert _off(forward, THERE, shapes[1])[legs[0]].mean() < 0.1
    assert _off(backward, BACK, shapes[0])[legs[1]].mean() < 0.1


def test_what_has_no_partner_is_not_asked(shapes: tuple[Shape, Shape]) -> None:
    legs = _front_legs(SOURCE), _front_legs(TARGET)
    poses = [_still(one)._replace(within=~leg) for one, leg in zip(shapes, legs, strict=True)]
    astray = np.where(legs[0], 0, THERE), np.where(legs[1], 0, BACK)
    one = relocate(*shapes, Registered(THERE, BACK, *poses), EVERYWHERE)
    other = relocate(*shapes, Registered(*astray, *poses), EVERYWHERE)
    np.testing.assert_array_equal(one[0], other[0])
    np.testing.assert_array_equal(one[1], other[1])


def test_a_larger_part_is_measured_in_its_own_unit(shapes: tuple[Shape, Shape]) -> None:
    found = Registered(THERE, BACK, *map(_still, shapes))
    scaled = [
        replace(shape, vertices=shape.vertices * factor)
        for shape, factor in zip(shapes, (1.5**-0.5, 1.5**0.5), strict=True)
    ]
    larger = found._replace(source=found.source._replace(size=1.5))
    for maps, same in zip(
        relocate(*scaled, larger, TRUNK),
        relocate(*shapes, found, TRUNK),
        strict=True,
    ):
        assert (maps == same).mean() > 0.98  # ties go either way


def test_proxies_take_back_what_they_lent(shapes: tuple[Shape, Shape]) -> None:
    proxies = [make_proxy(shape, 150) for shape in shapes]
    chance = np.random.default_rng(0)
    sizes = [len(proxy.kept) for proxy in proxies]
    maps = chance.integers(sizes[1], size=sizes[0]), chance.integers(sizes[0], size=sizes[1])
    found = Registered(*maps, *(_still(proxy.shape) for proxy in proxies))
    back = lower(lift(found, *proxies, *shapes), *proxies)
    np.testing.assert_array_equal(back.forward, maps[0])
    np.testing.assert_array_equal(back.backward, maps[1])
    for pose, proxy in zip(back[2:], proxies, strict=True):
        np.testing.assert_allclose(pose.places, proxy.shape.vertices, atol=1e-12)
