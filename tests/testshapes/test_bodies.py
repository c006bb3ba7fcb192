"""Bodies drawn at random: sound surfaces, proportions as said, and a truth that is one."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial import cKDTree

from testshapes.bodies import KINDS, is_carried_well, make_body, random_proportions
from testshapes.measures import mean_edge
from unbend import diagnose
from unbend.datasets import make_quadruped, rest_map
from unbend.datasets._skeleton import carry, cones_of
from unbend.errors import InputError

# Seeds of two bodies of each kind: any would do. The thirteenth biped is drawn twice.
PAIRS = {"quadruped": (11, 6), "biped": (13, 2), "octopus": (15, 16)}


@cache
def bodies(kind):
    return tuple(
        make_body(kind, body, random_state=body, meshing=body, n_vertices=900 + 10 * (body % 2))
        for body in PAIRS[kind]
    )


@pytest.mark.parametrize("kind", KINDS)
def test_surfaces_are_closed_and_in_one_piece(kind):
    for shape in bodies(kind):
        found = diagnose(shape.mesh)
        assert found.closed
        assert found.genus == 0
        assert len(found.component_faces) == 1
        assert found.non_manifold_edges == found.non_manifold_vertices == 0
        assert found.inconsistent_edges == found.degenerate_faces == 0


@pytest.mark.parametrize("kind", KINDS)
def test_no_parts_have_grown_together(kind):
    """Carried onto the plain body, whose parts are apart, every vertex lies on its skin."""
    for shape in bodies(kind):
        values, _ = cones_of(shape.plain_bones).local_field(shape.reference)[0](shape.reference)
        assert np.abs(values).max() < 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_the_truth_covers_the_target_and_leads_back(kind):
    source, target = bodies(kind)
    there, back = rest_map(source, target), rest_map(target, source)
    away = cKDTree(target.rest[there]).query(target.rest)[0]
    assert np.percentile(away, 98) < 3 * mean_edge(target.mesh)
    returned = np.linalg.norm(source.rest[back[there]] - source.rest, axis=1)
    assert np.percentile(returned, 98) < 3 * mean_edge(source.mesh)


@pytest.mark.parametrize("kind", KINDS)
def test_the_truth_commutes_with_the_symmetry(kind):
    source, target = bodies(kind)
    np.testing.assert_allclose(
        source.reference[source.mirror], source.reference * [-1, 1, 1], atol=1e-9
    )
    there = rest_map(source, target)
    across = target.rest[target.mirror[there]] - target.rest[there[source.mirror]]
    assert np.linalg.norm(across, axis=1).max() < 4 * mean_edge(target.mesh)  # ties fall anyhow


def test_parts_that_grow_together_are_noticed():
    """Legs as thick as these are one: no place on the plain body is that of the web between."""
    thick = {"girth": 0.66, "limbs": 1.68, "legs": 1.17, "body": 1.4}
    shape = make_quadruped({}, n_vertices=800, **thick)
    rest, faces, bones = shape.rest, shape.mesh.faces, shape.plain_bones
    assert not is_carried_well(rest, shape.reference, faces, bones)
    plain = make_quadruped({}, n_vertices=800)
    assert is_carried_well(plain.rest, plain.reference, plain.mesh.faces, bones)


@pytest.mark.parametrize(
    ("kind", "bone"),
    [
        ("quadruped", "left_shin"),
        ("quadruped", "right_forearm"),
        ("biped", "right_shin"),
        ("biped", "left_forearm"),
        ("octopus", "left_arm_2_5"),
    ],
)
def test_points_keep_their_place_along_a_bone(kind, bone):
    """Read off the bone itself, at the middle of a limb where it alone rules."""
    source, target = bodies(kind)
    there = rest_map(source, target)

    def along(shape):
        (one,) = (b for b in shape.bones if b.name == bone)
        axis = np.subtract(one.tail, one.head)
        offset = shape.rest - one.head
        share = offset @ axis / (axis @ axis)
        away = np.linalg.norm(offset - share[:, None] * axis, axis=1)
        return share, away, one.head_radius

    share, away, radius = along(source)
    near = (share > 0.2) & (share < 0.8) & (away < 1.3 * radius)
    assert near.sum() > 5
    edge = mean_edge(target.mesh)
    one = next(b for b in target.bones if b.name == bone)
    allowed = 0.15 + edge / np.linalg.norm(np.subtract(one.tail, one.head))
    assert np.abs(along(target)[0][there[near]] - share[near]).max() < allowed


def test_the_truth_is_the_same_by_way_of_a_third_body():
    source, target = bodies("biped")
    middle = make_body("biped", 13, {}, n_vertices=1000, meshing=7)
    direct, around = rest_map(source, target), rest_map(middle, target)[rest_map(source, middle)]
    apart = np.linalg.norm(target.reference[direct] - target.reference[around], axis=1)
    assert np.percentile(apart, 99) < 3 * mean_edge(target.mesh)


def test_of_one_body_the_truth_is_that_of_its_rest():
    first, _ = bodies("quadruped")
    second = make_body("quadruped", 11, random_state=2, n_vertices=800, meshing=4)
    away = np.linalg.norm(second.rest[rest_map(first, second)] - first.rest, axis=1)
    np.testing.assert_allclose(away, cKDTree(second.rest).query(first.rest)[0], atol=1e-6)


def test_species_of_one_maker_correspond():
    dog = make_quadruped(n_vertices=800)
    horse = make_quadruped("galloping", species="horse", n_vertices=800, meshing=2)
    there = rest_map(dog, horse)
    names = np.array(dog.parts)
    same = names[dog.labels] == np.array(horse.parts)[horse.labels[there]]
    assert same.mean() > 0.9
    # The tips of nose and tail are where they belong.
    assert np.array(horse.parts)[horse.labels[there[dog.rest[:, 2].argmax()]]] == "head"
    assert np.array(horse.parts)[horse.labels[there[dog.rest[:, 2].argmin()]]] == "tail"


def test_carrying_back_and_forth_is_the_identity():
    shape, _ = bodies("biped")
    there = shape.reference
    back = carry(there, shape.plain_bones, shape.bones)
    edge = mean_edge(shape.mesh)
    assert np.percentile(np.linalg.norm(back - shape.rest, axis=1), 99) < 0.35 * edge


def test_bodies_of_different_makers_do_not_correspond():
    with pytest.raises(InputError, match="different makers"):
        rest_map(bodies("quadruped")[0], bodies("biped")[0])


def test_proportions_are_drawn_from_their_ranges():
    for kind in KINDS:
        drawn = [random_proportions(kind, body) for body in PAIRS[kind]]
        for sizes in drawn:
            for name, factor in sizes.items():
                assert 0.6 <= factor <= (2.0 if name in ("girth", "limbs") else 1.6)
        assert drawn[0] != drawn[1]


def test_one_body_has_one_rest_whatever_its_pose():
    first, _ = bodies("quadruped")
    second = make_body("quadruped", 11, random_state=1, meshing=11, n_vertices=910)
    np.testing.assert_array_equal(first.rest, second.rest)
    assert np.abs(first.mesh.vertices - second.mesh.vertices).max() > 0.05


def test_an_unknown_kind_is_refused():
    with pytest.raises(InputError, match="quadruped, biped, octopus"):
        make_body("dragon", 1)
