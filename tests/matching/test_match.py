"""Matching: truths on shapes whose correspondence is known, and on real ones where given."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sheets import lopsided, make_blob, make_egg, make_torus, make_twisted_ball
from testshapes.damage import Damaged, keep
from unbend import Mesh, read_mesh
from unbend.correspondence import evaluate
from unbend.datasets import make_biped, make_quadruped, make_sphere, rest_map
from unbend.errors import InputError, UnbendWarning
from unbend.matching import _constants as constants
from unbend.matching import _match, landmark_pairs, match, prepare_spectrum, symmetry
from unbend.mesh import vertex_areas
from unbend.mesh.refinement import refine

MIRROR = np.array([-1.0, 1.0, 1.0])


def _share_right(point_map: np.ndarray, mesh: Mesh, truth: np.ndarray) -> float:
    """Share of vertices that land within a tenth of the shape's size of their true image."""
    size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    return float(
        (
            np.linalg.norm(mesh.vertices[point_map] - mesh.vertices[truth], axis=1) < 0.1 * size
        ).mean()
    )


@pytest.fixture(scope="module")
def blob(blob: Mesh) -> Mesh:
    """The same surface in 162 vertices."""
    return Mesh(blob.vertices[:162], make_sphere(2).faces, name="blob")


@pytest.fixture
def _small_copies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search on coarse copies of few vertices."""
    monkeypatch.setattr(constants, "N_VERTICES", (100, 150))


def _rotation(seed: int) -> np.ndarray:
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return rotation * np.sign(np.linalg.det(rotation))


def test_itself_is_the_identity(blob: Mesh) -> None:
    found = match(blob, blob, barycentric=True)
    every = np.arange(blob.n_vertices)
    assert (found.source_to_target == every).all()
    assert (found.target_to_source == every).all()
    assert found.orientation > 0.9
    assert found.confidence > 0.9
    np.testing.assert_allclose(found.functional_map, np.eye(30), atol=1e-9)
    np.testing.assert_allclose(found.weights.sum(axis=1), 1)
    assert (found.weights >= 0).all()
    positions = np.einsum("ij,ijk->ik", found.weights, blob.vertices[blob.faces[found.faces]])
    assert np.abs(positions - blob.vertices).max() < 0.02


def test_a_coarse_mesh_is_matched_as_well_as_a_fine_one() -> None:
    """A block of twelve vertices, and a fine mesh of it in two poses."""
    corners = np.array([[0.0, 0], [6, 0], [6, 1], [1, 1], [1, 4], [0, 4]])
    block = np.vstack([np.insert(corners, 2, height, axis=1) for height in (0, 2.5)])
    block[[0, 5, 6, 11], 2] *= 1.2
    end, here = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]]), np.arange(6)
    there = np.roll(here, -1)
    walls = np.transpose([[here, there, there + 6], [here, there + 6, here + 6]], (0, 2, 1))
    coarse = Mesh(block, np.vstack([end[:, ::-1], end + 6, *walls]))
    vertices, faces, *_ = refine(coarse.vertices, coarse.faces, 0.2)
    fine, bent = (
        Mesh(places, faces)
        for places in (vertices, vertices + 0.02 * vertices[:, [2, 0, 1]] ** 2 * [0, 1, 0])
    )
    for source, target, pair in ((coarse, fine, (coarse, bent)), (fine, coarse, (bent, coarse))):
        found = match(*pair, barycentric=True)
        assert found.confidence > 0.9
        there = np.einsum("ij,ijk->ik", found.weights, target.vertices[target.faces[found.faces]])
        assert np.linalg.norm(there - source.vertices, axis=1).mean() < 0.1
        # Errors include the way to the next vertex, however far that is.
        away = np.linalg.norm(target.vertices[found.source_to_target] - source.vertices, axis=1)
        assert (found.expected_error * np.sqrt(vertex_areas(target).sum()) > away).mean() > 0.8


def test_symmetric_shape_and_its_mirror_image() -> None:
    egg, image = make_egg(2), make_egg(2, -1)
    found = match(egg, image)
    assert found.orientation > 0.9
    np.testing.assert_allclose(image.vertices[found.source_to_target], egg.vertices, atol=1e-9)


def test_vertex_order_motion_and_unit_do_not_matter(blob: Mesh) -> None:
    n = blob.n_vertices
    order = np.random.default_rng(0).permutation(n)
    inverse = np.argsort(order)
    moved = Mesh(100 * blob.vertices[order] @ _rotation(1).T + 7, inverse[blob.faces])
    assert (match(blob, moved).source_to_target == inverse).all()


def test_faces_that_are_oriented_inward_are_turned(blob: Mesh) -> None:
    inside_out = Mesh(blob.vertices, blob.faces[:, ::-1])
    for pair in ((blob, inside_out), (inside_out, blob)):
        with pytest.warns(UnbendWarning, match="oriented inward; they are turned"):
            found = match(*pair, barycentric=True)
        assert (found.source_to_target == np.arange(blob.n_vertices)).all()
        assert found.confidence > 0.9
        places = np.einsum("ij,ijk->ik", found.weights, blob.vertices[pair[1].faces[found.faces]])
        assert np.abs(places - blob.vertices).max() < 0.02


def test_a_mirror_image_is_told_and_matched_if_allowed(blob: Mesh) -> None:
    # Without a symmetry of its own the shape and its mirror image have one isometry, which turns
    # the surface inside out.
    image = Mesh(blob.vertices * MIRROR, blob.faces[:, ::-1])
    with pytest.warns(UnbendWarning, match="mirror image of the target fits better"):
        kept = match(blob, image, refine=False)
    assert kept.confidence < 0.01
    allowed = match(blob, image, allow_mirror=True, barycentric=True)
    assert (allowed.source_to_target == np.arange(blob.n_vertices)).all()
    assert allowed.orientation < -0.9
    places = np.einsum("ij,ijk->ik", allowed.weights, image.vertices[image.faces[allowed.faces]])
    assert np.abs(places - image.vertices).max() < 0.02


def test_left_and_right_of_two_individuals_are_told() -> None:
    one, other = make_blob(2, lengths=(0.8, 0.5, 0.3)), make_blob(2, lengths=(0.8, 0.45, 0.33))
    other = Mesh(other.vertices * [1.1, 1, 0.95], other.faces)
    assert match(one, other, refine=False).confidence > 0.9
    image = Mesh(other.vertices * MIRROR, other.faces[:, ::-1])
    with pytest.warns(UnbendWarning, match="mirror image of the target fits better"):
        found = match(one, image, refine=False)
    assert found.mirror_fits
    assert found.confidence < 0.1
    # A wrong landmark does not hide that, and true ones are not said to be wrong.
    low, high = one.vertices[:, 0].argmin(), one.vertices[:, 0].argmax()
    with pytest.warns(UnbendWarning, match="mirror image of the target fits better"):
        found = match(one, image, refine=False, landmarks=[[low, high]])
    assert found.confidence < 0.1
    with pytest.warns(UnbendWarning) as told:
        match(one, image, refine=False, landmarks=[[low, low], [high, high]])
    assert [str(each.message)[:17] for each in told] == ["the mirror image "]


@pytest.mark.filterwarnings("ignore:(source|target). .* unreferenced")
def test_left_and_right_that_end_at_different_places_are_told() -> None:
    one, other = make_blob(2, lengths=(1.5, 1, 0.7)), make_blob(2, lengths=(1.5, 0.95, 0.75))
    one, other = _ending(one, -0.96), _ending(other, -0.66)
    assert match(one, other, refine=False).confidence > 0.9
    with pytest.warns(UnbendWarning, match="mirror image of the target fits better"):
        found = match(one, (other.vertices * MIRROR, other.faces[:, ::-1]), refine=False)
    assert found.confidence < 0.3


def test_a_left_one_is_told_from_a_right_one_that_differs_more_than_their_sides() -> None:
    one, other = make_blob(2, lengths=(0.6, 0.5, 0.4)), make_blob(2, lengths=(1.2, 0.5, 0.15))
    assert match(one, other, refine=False).confidence > 0.9
    with pytest.warns(UnbendWarning, match="mirror image of the target fits better"):
        found = match(one, (other.vertices * MIRROR, other.faces[:, ::-1]), refine=False)
    assert found.confidence < 0.3


def _ending(mesh: Mesh, least: float) -> Mesh:
    kept = mesh.vertices[:, 0] > least
    return Mesh(mesh.vertices, mesh.faces[kept[mesh.faces].all(axis=1)])


@pytest.mark.usefixtures("_small_copies")
def test_symmetry_swaps_left_and_right() -> None:
    dog = make_quadruped("walking", n_vertices=600)
    told: list[tuple[str, float]] = []
    found = symmetry(dog.mesh, progress=lambda *stage: told.append(stage))
    assert _share_right(found.source_to_target, dog.mesh, dog.mirror) > 0.98
    assert found.orientation < -0.5
    assert found.confidence > 0.5
    assert (told[0], told[-1]) == (("spectrum", 0.0), ("refine", 1.0))


def _with_limbs(middle: np.ndarray, limbs: Any, sharp: float) -> Mesh:
    """A ball, scaled, with limbs: a direction each, and a length."""
    ball = make_sphere(2)
    places = ball.vertices * middle
    for limb, length in limbs:
        way = np.array(limb) / np.linalg.norm(limb)
        places = places + length * np.exp(-sharp * (1 - ball.vertices @ way))[:, None] * way
    return Mesh(places, ball.faces)


def test_what_has_no_counterpart_has_no_mirror_partner() -> None:
    sides = [((side, 0.3, 0.1), 1.3) for side in (1, -1)] + [
        ((side, -2, 0), 1.6) for side in (1, -1)
    ]
    doll = _with_limbs(np.ones(3), [*sides, ((0, 1, 0.3), 0.7), ((0, -0.1, 1), 0.3)], 9)
    places = doll.vertices
    mirror = np.linalg.norm(places[:, None] * MIRROR - places, axis=2).argmin(axis=1)
    part = keep(doll, places[:, 0] < 1.5)  # without the end of one arm
    found = symmetry(part.mesh, refine=False)
    np.testing.assert_array_equal(found.source_to_target, part.image[mirror[part.origin]])


def test_back_and_belly_exchanged_is_told() -> None:
    """A flat body whose limbs all differ has no other symmetry."""
    ways = (1, 0.3), (-1, 0.5), (0.4, -1), (-0.7, -0.8), (0, 1)
    limbs = [((*way, 0), size) for way, size in zip(ways, (2.4, 1.7, 2.1, 1.4, 1.0), strict=True)]
    body = _with_limbs(np.array([0.4, 0.4, 0.16]), limbs, 25)
    with pytest.warns(UnbendWarning, match="as if back and belly were exchanged"):
        found = symmetry(body, refine=False)
    partners = body.vertices[found.source_to_target]
    np.testing.assert_allclose(partners * [1, 1, -1], body.vertices, atol=1e-9)


def test_limbs_that_stay_on_their_sides_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_match, "_stays", lambda sides, found: True)
    ball = make_sphere(2)
    egg = ball.vertices * [1, 0.75, 0.5] + 0.1 * ball.vertices[:, [1, 2, 0]] ** 2, ball.faces
    with pytest.warns(UnbendWarning, match="or limbs stayed on their sides"):
        found = symmetry(egg, refine=False)
    assert found.confidence <= 0.5
    pair = [(int(i), int(found.source_to_target[i])) for i in (0, 40)]
    symmetry(egg, refine=False, landmarks=pair)  # without a warning: they tell the sides


@pytest.mark.parametrize(
    ("kept", "energy", "stays"),
    [((3, 6), 0.1, True), ((3, 6), 0.05, False), ((3, 7), 0.1, False), ((2, 2), 0.1, False)],
)
def test_half_of_the_limbs_stay_or_fewer(
    monkeypatch: pytest.MonkeyPatch, kept: tuple[int, int], energy: float, stays: bool
) -> None:
    monkeypatch.setattr(_match, "kept_extremities", lambda sides, found: kept)
    monkeypatch.setattr(_match, "moved_share", lambda sides, found: 0.5)
    assert _match._stays(None, SimpleNamespace(energy=energy)) == stays


def test_landmarks_choose_among_symmetries() -> None:
    ball = make_sphere(2)
    places = ball.vertices * [1, 0.75, 0.5]
    for axis in (0, 1):
        flip = np.where(np.arange(3) == axis, -1, 1)
        one = int(places[:, axis].argmax())
        pair = (one, int(np.linalg.norm(places - places[one] * flip, axis=1).argmin()))
        found = symmetry((places, ball.faces), landmarks={"tip": pair}, refine=False)
        assert found.missed_landmarks == ()
        np.testing.assert_allclose(places[found.source_to_target] * flip, places, atol=1e-9)
    with pytest.raises(InputError, match="landmarks give vertex 3 two partners"):
        symmetry((places, ball.faces), landmarks=[(3, 5), (3, 5), (7, 3)])


def test_maps_that_are_not_refined_are_a_little_rough(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(constants, "N_VERTICES", (200, 300))  # of copies, fewer than the egg has
    egg = make_egg(3)
    both = match(egg, egg, mirrored=True, refine=False)
    rough, swap = (symmetry(egg, refine=one) for one in (False, True))
    off, rough_off, swap_off = (
        np.linalg.norm(egg.vertices[one] * MIRROR - egg.vertices, axis=1).mean()
        for one in (both.mirrored, rough.source_to_target, swap.source_to_target)
    )
    assert swap_off < 1e-9 < max(off, rough_off) < 0.03


def test_every_alternative_knows_all_hypotheses_its_own_first() -> None:
    ball = make_sphere(2)
    box = Mesh(ball.vertices * [1.6, 1, 0.7], ball.faces)  # the same after half turns
    found = match(box, box, n_matches=2, n_eigenpairs=40, refine=False)
    first, second, *rest = found.hypotheses
    assert rest
    assert second.difference > first.difference == 0
    energies = [one.energy for one in (second, first, *rest)]
    (other,) = found.alternatives
    assert [one.energy for one in other.hypotheses] == energies
    assert other.hypotheses[0].difference == 0
    maps = [one.source_to_target for one in (found, *found.alternatives)]
    for one in maps:
        signs = np.sign((box.vertices[one] * box.vertices).sum(axis=0))
        np.testing.assert_allclose(box.vertices[one], box.vertices * signs, atol=1e-9)
        assert signs.prod() == 1
    assert len({tuple(one) for one in maps}) == 2


def test_a_prepared_spectrum_is_not_computed_again(
    blob: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UNBEND_CACHE_DIR", str(tmp_path))
    prepare_spectrum(blob)
    kept = set(tmp_path.rglob("*.*"))
    assert len(kept) == 1
    match(blob, blob, refine=False)
    assert set(tmp_path.rglob("*.*")) == kept


@pytest.mark.usefixtures("_small_copies")
def test_open_surface_and_small_mesh() -> None:
    sphere = make_sphere(2)
    points = sphere.vertices * [1.5, 1, 0.7] + 0.3 * np.roll(sphere.vertices, 1, axis=1) ** 2
    cut = sphere.faces[(sphere.vertices[sphere.faces][:, :, 0] < 0.8).all(axis=1)]
    sheet = Mesh(points, cut)  # the cut leaves vertices that no face uses
    with pytest.warns(UnbendWarning, match="unreferenced"):
        found = match(sheet, sheet)
    used = np.unique(cut)
    assert (found.source_to_target[used] == used).all()
    unused = np.setdiff1d(np.arange(sphere.n_vertices), used)
    assert len(unused)
    assert (found.source_to_target[unused] == -1).all()
    assert len(found.functional_map) <= len(used) // 2


@pytest.mark.usefixtures("_small_copies")
def test_a_vertex_that_only_an_improper_face_names_has_no_partner() -> None:
    blob = make_blob(2)
    n = blob.n_vertices
    odd = Mesh(np.vstack([blob.vertices, blob.vertices[:1]]), np.vstack([blob.faces, [[0, n, n]]]))
    with (
        pytest.warns(UnbendWarning, match="1 unreferenced vertex"),
        pytest.warns(UnbendWarning, match="1 face left out"),
    ):
        assert match(odd, blob, refine=False).source_to_target[n] == -1


@pytest.mark.filterwarnings("ignore:part of the map is wrong")
def test_the_same_every_time_and_unlike_shapes_are_not_trusted(blob: Mesh) -> None:
    torus = make_torus(20, 8)
    other = Mesh(torus.vertices * [1, 1.5, 1], torus.faces)
    told: list[tuple[str, float]] = []
    one = match(blob, other, refine=False, progress=lambda *stage: told.append(stage))
    two = match(blob, other, refine=False)
    assert (one.source_to_target == two.source_to_target).all()
    assert (one.functional_map == two.functional_map).all()
    assert one.hypotheses == two.hypotheses
    assert one.confidence < 0.5
    assert {stage for stage, _ in told} == {"spectrum", "search", "refine"}
    assert (told[0], told[-2:]) == (("spectrum", 0.0), [("refine", 0.0), ("refine", 1.0)])
    assert all(0 <= share <= 1 for _, share in told)


@pytest.mark.usefixtures("_small_copies")
def test_an_edge_of_three_faces_does_not_stop_a_match(blob: Mesh) -> None:
    first, second = blob.faces[10, :2]
    extremity = 1.02 * blob.vertices[[first, second]].mean(axis=0)
    fin = Mesh(
        np.concatenate([blob.vertices, [extremity]]),
        np.concatenate([blob.faces, [[first, second, blob.n_vertices]]]),
    )
    with pytest.warns(UnbendWarning, match="non-manifold edge"):
        found = match(fin, blob)
    every = np.arange(blob.n_vertices)
    assert _share_right(found.source_to_target[:-1], blob, every) == 1


def test_a_small_twist_that_leaves_one_side_is_no_hindrance() -> None:
    twisted, _ = make_twisted_ball(4)
    points, egg = lopsided(twisted.vertices), make_egg(3)
    found = match(Mesh(points, twisted.faces), egg)
    off = np.linalg.norm(egg.vertices[found.source_to_target] - points, axis=1)
    assert off.mean() < 0.1


def test_real_shapes(real_data: Path) -> None:
    folder, names = real_data / "tosca_remeshed", ("david0", "david1")
    shapes = [read_mesh(folder / f"{name}.off") for name in names]
    truth = [np.loadtxt(folder / "corres" / f"{name}.vts", dtype=int) - 1 for name in names]
    some = np.arange(0, 5000, 25)
    found = match(*shapes)
    result = evaluate(found.source_to_target, shapes[1], truth[0][some], truth[1][some])
    assert result.mean() < 0.03
    assert found.confidence > 0.5


def test_places_on_faces_are_those_of_the_mesh_as_given(blob: Mesh) -> None:
    """Whatever way its faces are wound, and whatever comes before them."""
    ball = make_sphere(1)
    n = ball.n_vertices
    turned = np.where(np.arange(blob.n_faces)[:, None] % 3 == 0, blob.faces[:, ::-1], blob.faces)
    other = Mesh(
        np.concatenate([ball.vertices + 9, blob.vertices]),
        np.concatenate([ball.faces, [[n, n, n + 1]], turned + n, turned[:5] + n]),
    )
    plain = match(blob, blob, barycentric=True, refine=False)
    with pytest.warns(UnbendWarning):
        found = match(blob, other, barycentric=True, refine=False)
    places = [
        np.einsum("ij,ijk->ik", one.weights, mesh.vertices[mesh.faces[one.faces]])
        for one, mesh in ((plain, blob), (found, other))
    ]
    np.testing.assert_allclose(places[1], places[0], atol=1e-8)
    assert found.orientation > 0.9
    assert _share_right(plain.source_to_target, blob, np.arange(blob.n_vertices)) == 1


def _box() -> Mesh:
    """A rounded box, which three half turns leave the same."""
    ball = make_sphere(2)
    return Mesh(ball.vertices * [1.6, 1, 0.7], ball.faces)


def _bent(mesh: Mesh) -> Mesh:
    x, y, z = mesh.vertices.T
    return Mesh(np.stack([x, y - x**2 / 4, z], axis=1), mesh.faces)


def test_mirror_images_and_several_ways_are_given_only_where_asked() -> None:
    egg = make_egg(2)
    every = np.arange(egg.n_vertices)
    plain = match(egg, egg, n_eigenpairs=30)
    assert (plain.mirrored, plain.alternatives, plain.faces, plain.weights) == (
        None,
        (),
        None,
        None,
    )
    found = match(egg, egg, n_eigenpairs=30, mirrored=True)
    np.testing.assert_array_equal(found.source_to_target, every)
    np.testing.assert_allclose(egg.vertices[found.mirrored] * MIRROR, egg.vertices, atol=1e-9)
    assert found.orientation == pytest.approx(1)
    assert found.hypotheses == plain.hypotheses


def test_rounding_does_not_choose_between_a_map_and_its_mirror_image() -> None:
    egg = make_egg(2)
    for seed in range(2):
        noise = 1e-12 * np.random.default_rng(seed).standard_normal(egg.vertices.shape)
        other = Mesh(egg.vertices + noise, egg.faces)
        found = match(egg, other, n_eigenpairs=30, allow_mirror=True, refine=False)
        assert found.orientation == pytest.approx(1)
        energies = [one.energy for one in found.hypotheses]
        assert np.round(energies, 6).tolist() == sorted(np.round(energies, 6))
        assert any(one.orientation < 0 for one in found.hypotheses)


def _without_end() -> Damaged:
    """An egg without one end, a fifth of it."""
    egg = make_egg(2)
    return keep(egg, egg.vertices[:, 1] > np.quantile(egg.vertices[:, 1], 0.2))


@pytest.mark.usefixtures("_small_copies")
@pytest.mark.filterwarnings("ignore:part of the map is wrong")
@pytest.mark.parametrize("partial", ["none", "source", "target", "both"])  # auto: test_parts.py
def test_only_what_the_other_shape_may_lack_has_no_partner(partial: str) -> None:
    egg, torn = make_egg(2), _without_end()
    found = match(egg, torn.mesh, n_eigenpairs=40, partial=partial, barycentric=True)
    matched = found.source_to_target >= 0
    assert (found.target_to_source >= 0).all()
    assert found.overlap_target == 1
    np.testing.assert_array_equal(found.faces == -1, ~matched)
    np.testing.assert_array_equal(np.isnan(found.weights).all(axis=1), ~matched)
    np.testing.assert_allclose(found.weights[matched].sum(axis=1), 1)
    if partial in ("none", "source"):
        assert matched.all()
        assert found.overlap_source == 1
        return
    assert (matched == (torn.image >= 0)).mean() > 0.95
    areas = vertex_areas(egg)
    assert found.overlap_source == pytest.approx(areas[matched].sum() / areas.sum(), rel=0.02)
    # Of the constants, with the Laplacian's areas.
    assert found.functional_map[0, 0] == pytest.approx(found.overlap_source, rel=0.03)


@pytest.mark.usefixtures("_small_copies")
def test_what_only_the_target_has_has_no_partner() -> None:
    egg, torn = make_egg(2), _without_end()
    found = match(torn.mesh, egg, n_eigenpairs=40, partial="source")
    assert (found.source_to_target >= 0).all()
    assert ((found.target_to_source >= 0) == (torn.image >= 0)).mean() > 0.95
    assert found.overlap_source == 1
    assert found.overlap_target == pytest.approx(0.8, abs=0.05)


@pytest.mark.usefixtures("_small_copies")
def test_small_holes_leave_nothing_without_partner_unless_asked_to() -> None:
    egg = make_egg(3)
    off = np.linalg.norm(egg.vertices - egg.vertices[100], axis=1)
    areas = vertex_areas(egg)
    gone = np.argsort(off)[:8]
    assert areas[gone].sum() < areas.sum() / 50
    holed = keep(egg, ~np.isin(np.arange(egg.n_vertices), gone)).mesh
    asked, auto = (match(egg, holed, n_eigenpairs=40, partial=one) for one in ("target", "auto"))
    assert (asked.source_to_target[gone] == -1).sum() >= 4
    assert asked.overlap_source > 0.96
    assert (auto.source_to_target >= 0).all()
    assert auto.overlap_source == auto.overlap_target == 1


def test_how_far_it_is_is_told_after_each_of_the_matches() -> None:
    told: list[tuple[str, float]] = []
    box = _box()
    found = match(box, box, n_eigenpairs=40, n_matches=1000, progress=lambda *s: told.append(s))
    n = 1 + len(found.alternatives)
    assert 1 < n < 1000  # fewer than asked for
    assert told[0] == ("spectrum", 0.0)
    searched = [share for stage, share in told if stage == "search"]
    assert searched == sorted(searched)
    assert searched[-1] == 1
    assert told[1 + len(searched) :] == [("refine", i / n) for i in range(n + 1)]


def test_each_of_several_matches_has_places_on_faces_if_asked() -> None:
    """Of the target, which is bent: its middle stays, and its ends go down."""
    box = _box()
    target = _bent(box)
    found = match(box, target, n_eigenpairs=20, n_matches=2, barycentric=True)
    assert len(found.alternatives) == 1
    for one in (found, *found.alternatives):
        places = np.einsum("ij,ijk->ik", one.weights, target.vertices[target.faces[one.faces]])
        off = np.linalg.norm(places - target.vertices[one.source_to_target], axis=1)
        assert off.mean() < 0.1  # a third of an edge


def test_a_vertex_that_no_face_uses_is_on_no_face() -> None:
    egg = make_egg(2)
    loose = Mesh(np.concatenate([egg.vertices, [[9, 9, 9]]]), egg.faces)
    with pytest.warns(UnbendWarning, match="unreferenced"):
        found = match(loose, egg, n_eigenpairs=20, refine=False, barycentric=True)
    np.testing.assert_array_equal(np.flatnonzero(found.source_to_target < 0), [162])
    np.testing.assert_array_equal(np.flatnonzero(found.faces == -1), [162])
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.weights).any(axis=1)), [162])
    assert np.isnan(found.weights[162]).all()


def test_landmarks_are_vertices_of_source_and_target() -> None:
    box = _box()
    order = np.random.default_rng(0).permutation(162)
    number = np.argsort(order)
    target = Mesh(box.vertices[order], number[box.faces])
    ends = box.vertices[:, 0].argsort()[[0, -1]]
    found = match(
        box, target, n_eigenpairs=20, landmarks=np.stack([ends, number[ends[::-1]]], axis=1)
    )
    assert found.missed_landmarks == ()
    np.testing.assert_allclose(
        target.vertices[found.source_to_target[ends]], box.vertices[ends[::-1]], atol=1e-9
    )


def test_a_functional_map_is_of_as_many_functions_as_asked_for() -> None:
    egg = make_egg(2)
    for found in (
        match(egg, egg, n_eigenpairs=4, refine=False),
        symmetry(egg, n_eigenpairs=4, refine=False),
    ):
        assert found.functional_map.shape == (4, 4)


@pytest.mark.parametrize("wrong", [3, 4.5, True])
def test_a_symmetry_needs_four_functions(blob: Mesh, wrong: Any) -> None:
    with pytest.raises(InputError, match="n_eigenpairs must be a whole number of at least 4"):
        symmetry(blob, n_eigenpairs=wrong)


def test_options_that_make_no_sense_are_refused(blob: Mesh) -> None:
    with pytest.raises(InputError, match="n_eigenpairs"):
        match(blob, blob, n_eigenpairs=2)
    with pytest.raises(InputError, match="partial must be one of auto, none"):
        match(blob, blob, partial="half")  # type: ignore[arg-type]
    for wrong in (0, 1.5, True):
        with pytest.raises(InputError, match="n_matches must be a whole number of at least 1"):
            match(blob, blob, n_matches=wrong)  # type: ignore[arg-type]


def test_landmarks_that_are_no_pairs_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before anything takes long."""
    monkeypatch.delattr("unbend.matching._match.prepare_shapes")
    egg = make_egg(2)
    with pytest.raises(InputError, match=f"there is no vertex {egg.n_vertices}"):
        match(egg, egg, n_eigenpairs=20, landmarks=[(0, egg.n_vertices)])
    with pytest.raises(InputError, match=f"there is no vertex {2**64 - 5}"):
        match(egg, egg, n_eigenpairs=20, landmarks=np.array([[0, 2**64 - 5]], np.uint64))
    for wrong in ([1, 2], [[1, 2, 3]], [[[1, 2], [3, 4]]], 5):
        with pytest.raises(InputError, match="landmarks must be rows of two vertex numbers"):
            match(egg, egg, n_eigenpairs=20, landmarks=wrong)
    with pytest.raises(InputError, match="landmarks: rows have different lengths"):
        match(egg, egg, n_eigenpairs=20, landmarks=[[1, 2], [3]])


def test_no_landmarks_may_be_an_empty_list() -> None:
    egg = make_egg(2)
    for none in ([], np.empty((0, 2), dtype=int)):
        assert landmark_pairs(none).shape == (0, 2)
    plain, found = (match(egg, egg, refine=False, landmarks=none) for none in (None, {}))
    np.testing.assert_array_equal(found.source_to_target, plain.source_to_target)


@pytest.mark.usefixtures("_small_copies")
def test_an_ignored_landmark_is_named_by_its_label() -> None:
    ball = make_sphere(2)
    stone = Mesh(ball.vertices * [1, 0.8, 0.6] + 0.2 * ball.vertices[:, [1, 2, 0]] ** 2, ball.faces)
    x = stone.vertices[:, 0]
    pairs = {str(i): (i, i) for i in (0, 20, 40, 60, 80)} | {"paw": (x.argmin(), x.argmax())}
    told = f"landmark 'paw' at vertices {x.argmin()} and {x.argmax()} is ignored"
    with pytest.warns(UnbendWarning, match=told):
        assert match(stone, stone, landmarks=pairs).missed_landmarks == (5,)


@pytest.mark.filterwarnings("ignore:the mirror image of the target")
def test_landmarks_that_lead_far_from_the_best_map_are_told() -> None:
    standing, walking = (make_biped(pose, n_vertices=1000) for pose in ("standing", "walking"))
    hands = np.array([standing.rest[:, 0].argmax(), standing.rest[:, 0].argmin()])
    there = rest_map(standing, walking)[hands]
    names = [f"landmark {one!r} at vertices {i} and" for one, i in zip("ab", hands, strict=True)]
    told = f"{names[0]} .* and {names[1]} .*: another map fits far better"
    pairs = dict(zip("ab", zip(hands, there[::-1], strict=True), strict=True))
    with pytest.warns(UnbendWarning, match=told):
        found = match(standing.mesh, walking.mesh, landmarks=pairs, refine=False)
    assert found.confidence <= 0.5
    true = np.stack([hands, there], axis=1)
    assert match(standing.mesh, walking.mesh, landmarks=true, refine=False).confidence > 0.9


def test_of_a_round_shape_little_is_known_without_two_landmarks() -> None:
    ball = make_sphere(2)
    landmarks = np.tile([[0], [40]], 2)
    with pytest.warns(UnbendWarning, match="sphere: the shape is round.*at most 0.10"):
        unsure = match(ball, ball, n_eigenpairs=20, landmarks=landmarks[:1])
    sure = match(ball, ball, n_eigenpairs=20, landmarks=landmarks)
    assert unsure.confidence < 0.13 < sure.confidence
    assert np.mean(unsure.expected_error) > np.mean(sure.expected_error) + 0.1


@pytest.mark.filterwarnings("ignore:.*is round")
def test_landmarks_lead_to_each_other_whatever_the_surface_says() -> None:
    """A ball has no features; on a stone some lie a little off where its shape says."""
    ball = make_sphere(2)
    stone = Mesh(ball.vertices * [1, 0.8, 0.6] + 0.2 * ball.vertices[:, [1, 2, 0]] ** 2, ball.faces)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    edge = 0.3  # the mean one of either
    for count, mesh, moved in (
        (1, ball, ball.vertices @ turn.T),
        (1, stone, _slid(stone)),
        (30, stone, _slid(stone)),
    ):
        sources = np.arange(0, mesh.n_vertices, mesh.n_vertices // count)[:count]
        goals = np.linalg.norm(mesh.vertices - moved[sources, None], axis=2).argmin(axis=1)
        landmarks = np.stack([sources, goals], axis=1)
        found = match(mesh, mesh, n_eigenpairs=20, landmarks=landmarks)
        assert found.missed_landmarks == ()
        off = mesh.vertices[found.source_to_target[sources]] - mesh.vertices[goals]
        assert np.linalg.norm(off, axis=1).max() < 0.75 * edge


def _slid(stone: Mesh) -> np.ndarray:
    """Vertices 36 degrees about an axis on, which is two edges."""
    angle = np.deg2rad(36)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.hstack([stone.vertices[:, :2] @ turn.T, stone.vertices[:, 2:]])


def test_a_landmark_where_it_is_asked_for_settles_which_of_several_maps_it_is() -> None:
    """An ellipsoid turned by half a turn about any axis is itself: there are four maps."""
    ball = make_sphere(2)
    places = ball.vertices * [1, 0.75, 0.5]
    found = match((places, ball.faces), (places, ball.faces))
    assert found.confidence < 0.6
    for turn in ([1, -1, -1], [-1, -1, 1]):
        images = np.linalg.norm(places[:, None] * turn - places, axis=2).argmin(axis=1)
        landmarks = [(i, images[i]) for i in found.landmark_hints]
        settled = match((places, ball.faces), (places, ball.faces), landmarks=landmarks)
        off = np.linalg.norm(places[settled.source_to_target] - places[images], axis=1)
        assert off.max() < 0.3
        assert settled.confidence > found.confidence


def test_no_landmark_is_asked_for_where_no_other_map_is_nearly_as_good() -> None:
    ball = make_sphere(2)
    stone = ball.vertices * [1, 0.8, 0.6] + 0.2 * ball.vertices[:, [1, 2, 0]] ** 2
    assert match((stone, ball.faces), (stone, ball.faces)).landmark_hints == ()
