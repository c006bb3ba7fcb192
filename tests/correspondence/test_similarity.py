"""Similarity sees the shape alone: not pose, place, handedness, size or vertex order."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh, canonical_form, read_mesh
from unbend.alignment import procrustes
from unbend.correspondence import aligned_cosine, similarity
from unbend.datasets import make_biped, make_quadruped, rest_map
from unbend.errors import InputError
from unbend.matching import Match
from unbend.mesh import vertex_areas


def _match(forward, backward) -> Match:
    return Match(np.asarray(forward), np.asarray(backward), np.eye(1), 1.0, 1.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_moved_or_mirrored_copy_is_the_same(blob: Mesh, sign: int) -> None:
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    rotation *= sign * np.sign(np.linalg.det(rotation))
    moved = Mesh(30 * blob.vertices @ rotation.T + 7, blob.faces)
    assert similarity(blob, moved) == pytest.approx(1)


def test_a_permuted_copy_is_the_same_through_its_map(blob: Mesh) -> None:
    order = np.random.default_rng(1).permutation(blob.n_vertices)
    inverse = np.argsort(order)
    other = Mesh(blob.vertices[order], inverse[blob.faces])
    assert similarity(blob, other) < 0.2
    assert similarity(blob, other, match=inverse) == pytest.approx(1)
    assert similarity(blob, other, match=_match(inverse, order)) == pytest.approx(1)
    some = np.where(np.arange(len(order)) % 3, inverse, -1)  # the others have no partner
    assert similarity(blob, other, match=some) == pytest.approx(1)
    assert similarity(blob, other, match=_match(some, order)) == pytest.approx(1)
    assert similarity(other, blob, match=_match(order, some)) == pytest.approx(1)


def test_it_is_the_cosine_after_procrustes(blob: Mesh) -> None:
    other = make_quadruped("standing", n_vertices=642).mesh
    forms = [canonical_form(one).points for one in (blob, other)]
    rotation, translation = procrustes(*forms)
    moved = forms[0] @ rotation.T + translation
    s, t = (one - one.mean(axis=0) for one in (moved, forms[1]))
    expected = (s * t).sum() / (np.linalg.norm(s) * np.linalg.norm(t))
    assert similarity(blob, other) == pytest.approx(expected)
    assert similarity(other, blob) == pytest.approx(expected)


def test_a_match_counts_in_both_directions() -> None:
    one = make_quadruped("standing", n_vertices=600)
    two = make_quadruped("galloping", n_vertices=500, meshing=1)
    there, back = rest_map(one, two), rest_map(two, one)
    found = similarity(one.mesh, two.mesh, match=_match(there, back))
    swapped = similarity(two.mesh, one.mesh, match=_match(back, there))
    assert found == pytest.approx(swapped)
    assert found > 0.99


def test_another_animal_is_less_alike_than_another_pose() -> None:
    dog, person = make_quadruped("standing", n_vertices=600), make_biped("standing", n_vertices=600)
    pose = make_quadruped("galloping", n_vertices=600)
    assert similarity(dog.mesh, pose.mesh) > 0.97 > similarity(dog.mesh, person.mesh)


def test_forms_spare_the_work_and_change_nothing(blob: Mesh) -> None:
    other = Mesh(blob.vertices * [1, 2, 1], blob.faces)
    forms = [canonical_form(one) for one in (blob, other)]
    expected = similarity(blob, other)
    assert similarity(*forms) == expected
    assert similarity(forms[0], other) == expected
    wide = canonical_form(blob, n_components=5)
    assert similarity(wide, other) == pytest.approx(expected)
    assert similarity(wide, other, n_components=5) == similarity(blob, other, n_components=5)
    every = np.arange(blob.n_vertices)
    by_area = [canonical_form(one, weighting="area") for one in (blob, other)]
    areas = (vertex_areas(blob), vertex_areas(other))
    assert similarity(*by_area, match=every, areas=areas) == pytest.approx(
        similarity(blob, other, match=every)
    )
    assert similarity(*by_area, areas=areas) == pytest.approx(
        similarity(blob, other, weighting="area")
    )
    assert similarity(*forms, match=every, weighting="uniform") == pytest.approx(expected)


def test_other_distances(blob: Mesh) -> None:
    other = Mesh(blob.vertices * [1, 2, 1], blob.faces)
    found = {
        similarity(blob, other, distance=name)
        for name in ("biharmonic", "geodesic", "commute-time")
    }
    assert len(found) == 3
    assert all(0.5 < one < 1 for one in found)


def test_vertices_without_a_partner_do_not_count() -> None:
    points = np.random.default_rng(0).normal(size=(9, 3))
    broken = points.copy()
    broken[2, 0] = np.nan
    other = 2 * points[:, [1, 0, 2]]
    assert aligned_cosine(broken, other, np.ones(9)) == pytest.approx(1)
    assert aligned_cosine(other, broken, np.ones(9)) == pytest.approx(1)
    with pytest.raises(InputError, match="no vertex"):
        aligned_cosine(points, points * np.nan, np.ones(9))
    with pytest.raises(InputError, match="no vertex"):
        aligned_cosine(points, points, np.zeros(9))
    with pytest.raises(InputError, match="coincide"):
        aligned_cosine(points, points * 0, np.ones(9))


def test_what_does_not_fit(blob: Mesh) -> None:
    form = canonical_form(blob)
    geodesic = replace(form, distance="geodesic")
    slow = replace(form, distance="diffusion", time=0.5)
    every = np.arange(blob.n_vertices)
    small = Mesh(blob.vertices[:-1], blob.faces[(blob.faces < 641).all(axis=1)])
    for arguments, options, sentence in (
        ((blob, small), {}, "642 and 641 vertices; pass a match of model and probe as match="),
        ((form, form), {"n_components": 4}, "compute it with n_components=4"),
        ((form, geodesic), {}, "biharmonic distance, uniform .* geodesic distance, uniform"),
        ((form, blob), {"distance": "geodesic"}, "geodesic distance"),
        ((slow, blob), {"distance": "diffusion"}, r"at time 0\.1, .* at time 0\.5"),
        (
            (form, blob),
            {"weighting": "area", "areas": (every + 1, every + 1)},
            "compute both alike",
        ),
        ((form, form), {"n_components": 0}, "at least 1"),
        ((form, form), {"match": every}, "does not know its vertices' areas"),
        ((form, form), {"match": every, "areas": (every, -every)}, "areas must be"),
        ((blob, blob), {"match": every[:5]}, "one vertex number for each of 642"),
        ((blob, blob), {"match": every + 1}, "names target vertex 642"),
        ((blob, blob), {"match": every - 2}, "list of vertex numbers"),
        ((blob, blob), {"weighting": "mass"}, "weighting"),
        ((blob, blob), {"weighting": "uniform", "areas": (every, every)}, "areas have no use"),
    ):
        with pytest.raises(InputError, match=sentence):
            similarity(*arguments, **options)


def test_poses_of_a_real_wolf(real_data: Path) -> None:
    wolves = [read_mesh(real_data / "tosca_original" / f"wolf{i}.off") for i in range(3)]
    forms = [canonical_form(wolf) for wolf in wolves]
    assert min(similarity(forms[0], form) for form in forms[1:]) > 0.98
