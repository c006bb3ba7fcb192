"""Matching: truths on shapes whose correspondence is known, and on real ones where given."""

import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from sheets import lopsided, make_egg, make_twisted_ball
from unbend import Mesh, align, read_mesh, spectrum
from unbend.choices import Partial
from unbend.correspondence import evaluate
from unbend.datasets import make_biped, make_quadruped, make_sphere, rest_map
from unbend.errors import InputError, MeshError, UnbendWarning
from unbend.matching import Match, _match, _polish, match, prepare_spectrum, symmetry
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import Candidate, judge
from unbend.matching._match import _match_by_icp
from unbend.matching._polish import refined, with_partners
from unbend.matching._registration import Pose, Registered
from unbend.matching._solve import Sides, candidates, make_sides
from unbend.mesh import vertex_areas

MIRROR = np.array([-1.0, 1.0, 1.0])


def _share_right(point_map: np.ndarray, mesh: Mesh, truth: np.ndarray) -> float:
    """Share of vertices that land within a tenth of the shape's size of their true image."""
    size = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    return float(
        (
            np.linalg.norm(mesh.vertices[point_map] - mesh.vertices[truth], axis=1) < 0.1 * size
        ).mean()
    )


def _rotation(seed: int) -> np.ndarray:
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return rotation * np.sign(np.linalg.det(rotation))


def test_itself_is_the_identity(blob: Mesh) -> None:
    found = match(blob, blob, barycentric=True)
    every = np.arange(blob.n_vertices)
    assert (found.source_to_target == every).all()
    assert (found.target_to_source == every).all()
    assert found.orientation > 0.9
    assert found.residual < 1e-3
    assert found.confidence > 0.9
    np.testing.assert_allclose(found.functional_map, np.eye(150), atol=1e-9)
    np.testing.assert_allclose(found.weights.sum(axis=1), 1)
    assert (found.weights >= 0).all()
    positions = np.einsum("ij,ijk->ik", found.weights, blob.vertices[blob.faces[found.faces]])
    assert np.abs(positions - blob.vertices).max() < 0.02


def test_symmetric_shape_is_itself_not_its_mirror_image() -> None:
    dog = make_quadruped("standing", n_vertices=1200)
    found = match(dog.mesh, dog.mesh, mirrored=True)
    assert (found.source_to_target == np.arange(1200)).all()
    assert _share_right(found.mirrored, dog.mesh, dog.mirror) > 0.99


@pytest.mark.parametrize("make", [make_quadruped, make_biped])
def test_another_pose_and_meshing(make) -> None:
    source = make("standing", n_vertices=1500)
    target = make("walking", n_vertices=1200, meshing=1)
    found = match(source.mesh, target.mesh)
    truth = rest_map(source, target)
    assert _share_right(found.source_to_target, target.mesh, truth) > 0.99
    assert _share_right(found.target_to_source, source.mesh, rest_map(target, source)) > 0.99
    result = evaluate(found.source_to_target, target.mesh, np.arange(1500), truth)
    assert result.mean() < 0.03
    assert found.confidence > 0.5


def test_the_judge_prefers_the_right_map_to_its_rivals() -> None:
    # A person back to front is nearly the same person: only patches of the surface tell.
    source = make_biped("standing", n_vertices=1500)
    target = make_biped("walking", n_vertices=1200, meshing=1)
    sides = make_sides(*(prepare_shape(one.mesh, 150, True)[1] for one in (source, target)))
    first, *rivals = candidates(sides)
    assert rivals
    truth = rest_map(source, target)
    shares = [
        _share_right(refined(sides, one).registered.forward, target.mesh, truth)
        for one in (first, rivals[0])
    ]
    assert shares[0] > 0.99
    assert shares[1] < 0.8
    assert first.energy < rivals[0].energy
    assert first.orientation > 0.9


def test_vertex_order_motion_and_unit_do_not_matter(blob: Mesh) -> None:
    n = blob.n_vertices
    order = np.random.default_rng(0).permutation(n)
    inverse = np.argsort(order)
    moved = Mesh(100 * blob.vertices[order] @ _rotation(1).T + 7, inverse[blob.faces])
    assert (match(blob, moved).source_to_target == inverse).all()


def test_mirror_image_keeps_the_side_that_faces_name(blob: Mesh) -> None:
    # Without a symmetry of its own the shape and its mirror image have one isometry. Reflected
    # and re-wound, that isometry turns the surface inside out; left as wound, it does not.
    reflected = Mesh(blob.vertices * MIRROR, blob.faces)
    rewound = Mesh(blob.vertices * MIRROR, blob.faces[:, ::-1])
    every = np.arange(blob.n_vertices)
    assert (match(blob, reflected).source_to_target == every).all()
    kept = match(blob, rewound, refine=False)
    assert kept.orientation > 0 or kept.confidence < 0.5
    allowed = match(blob, rewound, allow_mirror=True)
    assert (allowed.source_to_target == every).all()
    assert allowed.orientation < -0.9


def test_places_of_a_map_that_mirrors_are_on_the_target(blob: Mesh) -> None:
    image = Mesh(blob.vertices * MIRROR, blob.faces[:, ::-1])
    found = match(blob, image, allow_mirror=True, barycentric=True)
    assert found.orientation < -0.9
    places = np.einsum("ij,ijk->ik", found.weights, image.vertices[image.faces[found.faces]])
    assert np.abs(places - image.vertices).max() < 0.02


def test_progress_ends_where_fewer_matches_are_found_than_asked_for(blob: Mesh) -> None:
    told: list[tuple[str, float]] = []
    found = match(blob, blob, n_matches=1000, refine=False, progress=lambda *s: told.append(s))
    assert len(found.alternatives) < 999
    assert told[-1] == ("refine", 1.0)


def test_icp_needs_no_table_of_all_pairs() -> None:
    ball = make_sphere(4)  # 2,562 vertices: a table has 26 MB in single precision
    egg = Mesh(lopsided(ball.vertices), ball.faces)
    match(egg, egg, method="icp")  # compiles
    tracemalloc.start()
    match(egg, egg, method="icp")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 4 * len(ball.vertices) ** 2


def test_symmetric_shape_and_its_mirror_image() -> None:
    dog = make_quadruped("standing", n_vertices=1000)
    image = Mesh(dog.mesh.vertices * MIRROR, dog.mesh.faces[:, ::-1])
    assert _share_right(match(dog.mesh, image).source_to_target, image, dog.mirror) > 0.99


def test_symmetry_swaps_left_and_right() -> None:
    dog = make_quadruped("walking", n_vertices=1500)
    found = symmetry(dog.mesh)
    assert _share_right(found.source_to_target, dog.mesh, dog.mirror) > 0.98
    assert found.orientation < -0.5
    assert found.confidence > 0.5


@pytest.mark.parametrize("options", [{}, {"refine": False}])
def test_a_symmetry_is_polished_unless_asked_not_to(
    monkeypatch: pytest.MonkeyPatch, options: dict[str, Any]
) -> None:
    egg = make_egg(2)
    polished, told = [], []

    def quick(sides: Sides, one: Candidate, *, polish: bool) -> Candidate:
        polished.append(polish)
        return refined(sides, one, polish=False)

    monkeypatch.setattr(_match, "refined", quick)
    found = symmetry(egg, n_eigenpairs=30, progress=lambda *stage: told.append(stage), **options)
    assert np.abs(egg.vertices[found.source_to_target] * MIRROR - egg.vertices).max() < 1e-9
    assert polished == [not options]
    assert (told[0], told[-1]) == (("spectrum", 1.0), ("refine", 1.0))


def test_every_alternative_knows_all_hypotheses_its_own_first() -> None:
    ball = make_sphere(2)
    box = Mesh(ball.vertices * [1.6, 1, 0.7], ball.faces)  # the same after half turns
    found = match(box, box, n_matches=3, n_eigenpairs=40, refine=False)
    first, second, third, *rest = found.hypotheses
    assert [one.hypotheses for one in found.alternatives] == [
        (second, first, third, *rest),
        (third, first, second, *rest),
    ]
    assert rest
    maps = [one.source_to_target for one in (found, *found.alternatives)]
    for one in maps:
        signs = np.sign((box.vertices[one] * box.vertices).sum(axis=0))
        np.testing.assert_allclose(box.vertices[one], box.vertices * signs, atol=1e-9)
        assert signs.prod() == 1
    assert len({tuple(one) for one in maps}) == 3


def test_a_prepared_spectrum_is_not_computed_again(
    blob: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("UNBEND_CACHE_DIR", str(tmp_path))
    prepare_spectrum(blob)
    kept = set(tmp_path.rglob("*.*"))
    assert len(kept) == 1
    match(blob, blob, refine=False)
    assert set(tmp_path.rglob("*.*")) == kept


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


def test_quick_and_icp_variants(blob: Mesh) -> None:
    every = np.arange(blob.n_vertices)
    assert _share_right(match(blob, blob, refine=False).source_to_target, blob, every) == 1
    assert _share_right(match(blob, blob, method="icp").source_to_target, blob, every) > 0.95


@pytest.mark.filterwarnings("ignore:the map is in disorder")
def test_the_same_every_time_and_unlike_shapes_are_not_trusted(blob: Mesh) -> None:
    other = make_quadruped("walking", n_vertices=600).mesh
    told: list[tuple[str, float]] = []
    one = match(blob, other, refine=False, progress=lambda *stage: told.append(stage))
    two = match(blob, other, refine=False)
    assert (one.source_to_target == two.source_to_target).all()
    assert (one.functional_map == two.functional_map).all()
    assert one.hypotheses == two.hypotheses
    assert one.confidence < 0.5
    assert {stage for stage, _ in told} == {"spectrum", "search", "refine"}
    assert (told[0], told[-1]) == (("spectrum", 1.0), ("refine", 1.0))
    assert all(0 < share <= 1 for _, share in told)


def test_icp_aligns_forms_of_three_functions_and_tells_how_well(blob: Mesh) -> None:
    ball = make_sphere(2)
    egg = Mesh(ball.vertices * [1, 1.3, 2.2], ball.faces)
    found = match(blob, egg, method="icp")
    mine, other = (spectrum(mesh, 4) for mesh in (blob, egg))
    forms = [
        one.eigenfunctions[:, 1:] / one.eigenvalues[1:] / np.sqrt(one.areas.sum())
        for one in (mine, other)
    ]
    size = np.sqrt((other.areas / other.areas.sum()) @ (forms[1] ** 2).sum(axis=1))
    assert found.residual == pytest.approx(align(*forms).residual / size, rel=0.01)
    assert found.functional_map.shape == (4, 4)
    assert (len(found.source_to_target), len(found.target_to_source)) == (642, 162)
    back = match(egg, blob, method="icp")
    assert back.target_to_source.shape == found.source_to_target.shape
    landed = egg.vertices[found.source_to_target]
    assert np.linalg.norm(landed - egg.vertices[back.target_to_source], axis=1).mean() < 0.1


def test_faces_that_disagree_are_wound_alike(blob: Mesh) -> None:
    faces = blob.faces.copy()
    some = np.random.default_rng(0).random(len(faces)) < 0.2
    faces[some] = faces[some][:, ::-1]
    found = match(Mesh(blob.vertices, faces), blob)
    assert (found.source_to_target == np.arange(blob.n_vertices)).all()
    assert found.orientation > 0.9


def test_an_edge_of_three_faces_does_not_stop_a_match(blob: Mesh) -> None:
    first, second = blob.faces[10, :2]
    tip = 1.02 * blob.vertices[[first, second]].mean(axis=0)
    fin = Mesh(
        np.concatenate([blob.vertices, [tip]]),
        np.concatenate([blob.faces, [[first, second, blob.n_vertices]]]),
    )
    with pytest.warns(UnbendWarning, match="non-manifold edge"):
        found = match(fin, blob)
    every = np.arange(blob.n_vertices)
    assert _share_right(found.source_to_target[:-1], blob, every) == 1


@pytest.mark.parametrize(
    "options",
    [
        {"barycentric": True},
        {"mirrored": True},
        {"allow_mirror": True},
        {"refine": True},
        {"refine": False},
        {"n_eigenpairs": 150},
        {"n_matches": 2},
        {"partial": "none"},
        {"landmarks": [(0, 0)]},
    ],
)
def test_options_that_icp_cannot_use_are_refused(blob: Mesh, options: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=f'{next(iter(options))} is for method="progressive"'):
        match(blob, blob, method="icp", **options)


def test_a_small_twist_that_leaves_one_side_is_no_hindrance() -> None:
    twisted, _ = make_twisted_ball(4)
    points, egg = lopsided(twisted.vertices), make_egg(3)
    found = match(Mesh(points, twisted.faces), egg, cache=False)
    off = np.linalg.norm(egg.vertices[found.source_to_target] - points, axis=1)
    assert off.mean() < 0.1


def test_what_is_wrong_is_said(blob: Mesh, moebius_strip: Mesh) -> None:
    with pytest.raises(MeshError, match="only one side"):
        match(moebius_strip, blob)
    with pytest.raises(InputError, match="needs faces"):
        match(blob.vertices, blob)
    with pytest.raises(InputError, match="method"):
        match(blob, blob, method="magic")
    with pytest.raises(InputError, match="n_eigenpairs"):
        match(blob, blob, n_eigenpairs=2)
    with pytest.raises(InputError, match="partial must be one of auto, none"):
        match(blob, blob, partial="half")  # type: ignore[arg-type]
    for wrong in (0, 1.5, True):
        with pytest.raises(InputError, match="n_matches must be a whole number of at least 1"):
            match(blob, blob, n_matches=wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(("source", "target"), [("cat0", "cat1"), ("david0", "david1")])
def test_real_shapes(real_data: Path, source: str, target: str) -> None:
    folder = real_data / "tosca_remeshed"
    shapes = [read_mesh(folder / f"{name}.off") for name in (source, target)]
    truth = [
        np.loadtxt(folder / "corres" / f"{name}.vts", dtype=int) - 1 for name in (source, target)
    ]
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


class Asked:
    """Stages of a match in which candidates are given, and nothing is refined; what each is asked.

    Candidates are a box's half turns, itself first, and as many that turn it inside out.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.searches: list[tuple[bool, bool]] = []
        self.settled = 0
        self.polished: list[bool] = []
        self.torn: list[float] = []
        self.within = [np.ones(162, dtype=bool)] * 2  # which vertices have partners
        self.order: list[int] = []  # of candidates, when near ones have been ranked anew
        self.costs = {False: [0.1, 0.12, 0.3, 0.4], True: [0.2, 0.25, 0.5, 0.6]}
        ball = make_sphere(2)
        self.box = self.target = Mesh(ball.vertices * [1.6, 1, 0.7], ball.faces)
        points = np.round(self.box.vertices, 9)
        signs = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
        order = {tuple(point): i for i, point in enumerate(points + 0.0)}
        self.turns = {
            turned: [
                np.array([order[tuple(one)] for one in points * row * sign + 0.0]) for row in signs
            ]
            for turned, sign in ((False, 1), (True, -1))
        }

        def search(sides: Sides, progress: Any, thorough: bool = False) -> list[Candidate]:
            self.searches.append((sides.turned, thorough))
            if progress is not None:
                progress("search", 1.0)
            ours, theirs = sides.proxies
            still = np.tile(np.eye(3), (162, 1, 1))
            found = []
            for cost, way in zip(self.costs[sides.turned], self.turns[sides.turned], strict=True):
                one = Pose(theirs.vertices[way], still, self.within[0])
                other = Pose(ours.vertices[way], still, self.within[1])
                judged = judge(ours, theirs, Registered(way, way, one, other), sides.turned)
                found.append(replace(judged, energy=cost))
            return found

        def settle(sides: Sides, found: list[Candidate]) -> tuple[list[Candidate], dict]:
            self.settled += 1
            return [found[i] for i in self.order or range(len(found))], {}

        def refine(sides: Sides, one: Candidate, *, polish: bool = True) -> Candidate:
            self.polished.append(polish)
            return refined(sides, one, polish=False)

        def partners(one: Candidate, sides: Sides, torn: float) -> Candidate:
            self.torn.append(torn)
            return with_partners(one, sides, torn)

        monkeypatch.setattr(_match, "candidates", search)
        monkeypatch.setattr(_match, "settled", settle)
        monkeypatch.setattr(_match, "refined", refine)
        monkeypatch.setattr(_match, "with_partners", partners)
        # A box has no rim, and yet some of it is to have no partner.
        monkeypatch.setattr(_polish, "keep_matched", lambda shape, goal, within, *_: within)

    def __call__(self, **options: Any) -> Match:
        for one in (self.searches, self.polished, self.torn):
            one.clear()
        self.settled = 0
        return match(self.box, self.target, n_eigenpairs=20, **options)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    return Asked(monkeypatch)


def test_several_ways_are_searched_for_and_mirror_images_only_where_asked(asked: Asked) -> None:
    found = asked()
    assert asked.searches == [(False, False)]
    np.testing.assert_array_equal(found.source_to_target, asked.turns[False][0])
    assert (found.mirrored, found.alternatives) == (None, ())
    assert [one.energy for one in found.hypotheses] == asked.costs[False]
    np.testing.assert_allclose(found.functional_map, np.eye(20), atol=1e-6)
    found = asked(n_matches=2)
    assert asked.searches == [(False, True)]
    (other,) = found.alternatives
    np.testing.assert_array_equal(other.source_to_target, asked.turns[False][1])
    assert found.confidence > other.confidence
    found = asked(mirrored=True)
    assert asked.searches == [(False, False), (True, False)]
    np.testing.assert_array_equal(found.source_to_target, asked.turns[False][0])
    np.testing.assert_array_equal(found.mirrored, asked.turns[True][0])
    assert found.orientation == pytest.approx(1)
    assert [one.energy for one in found.hypotheses] == asked.costs[False]


@pytest.mark.parametrize("better", [False, True])
def test_a_map_that_turns_the_surface_inside_out_is_taken_where_allowed_if_it_is_better(
    asked: Asked, better: bool
) -> None:
    asked.costs[False] = [0.3, 0.31, 0.32, 0.33] if better else [0.1, 0.21, 0.22, 0.23]
    found = asked(allow_mirror=True, n_matches=9)
    assert asked.searches == [(False, True), (True, True)]
    assert found.mirrored is None
    np.testing.assert_array_equal(found.source_to_target, asked.turns[better][0])
    assert found.orientation == pytest.approx(-1 if better else 1)
    assert len(found.alternatives) == 7
    energies = [one.energy for one in found.hypotheses]
    assert energies == sorted([*asked.costs[False], *asked.costs[True]])
    assert sum(one.orientation < 0 for one in found.hypotheses) == 4


@pytest.mark.parametrize("refine", [None, True, False])
def test_maps_are_polished_unless_asked_not_to(asked: Asked, refine: bool | None) -> None:
    asked(refine=refine, mirrored=True, n_matches=2)
    polish = refine is not False
    assert asked.settled == 2 * polish
    assert asked.polished == [polish] * 3


def test_maps_that_reflect_are_ranked_anew_too(asked: Asked) -> None:
    asked.order = [1, 0, 2, 3]
    found = asked(mirrored=True)
    np.testing.assert_array_equal(found.source_to_target, asked.turns[False][1])
    np.testing.assert_array_equal(found.mirrored, asked.turns[True][1])
    found = symmetry(asked.box, n_eigenpairs=20)
    np.testing.assert_array_equal(found.source_to_target, asked.turns[True][1])


def test_rounding_does_not_choose_between_a_map_and_its_mirror_image(asked: Asked) -> None:
    asked.costs = {False: [0.2 + 1e-9, 0.3, 0.4, 0.5], True: [0.2, 0.6, 0.7, 0.8]}
    assert asked(allow_mirror=True).orientation == pytest.approx(1)


@pytest.mark.parametrize("partial", get_args(Partial))
def test_small_holes_leave_nothing_without_partner_unless_asked_to(
    asked: Asked, partial: Partial
) -> None:
    asked(partial=partial, mirrored=True)
    assert asked.torn == [1 / 50 if partial == "auto" else 0] * 2


def test_how_far_it_is_is_told_after_each_of_the_matches(asked: Asked) -> None:
    told: list[tuple[str, float]] = []
    asked(n_matches=4, progress=lambda *stage: told.append(stage))
    assert told[:2] == [("spectrum", 1.0), ("search", 1.0)]
    assert told[2:] == [("refine", share) for share in (0.25, 0.5, 0.75, 1.0)]


@pytest.mark.filterwarnings("ignore:the map is in disorder")
def test_what_has_no_partner_is_not_shared(asked: Asked) -> None:
    asked.within[0] = asked.box.vertices[:, 0] > 0.4
    found = asked(partial="none", barycentric=True)
    matched = found.source_to_target >= 0
    np.testing.assert_array_equal(matched[asked.within[0]], True)
    np.testing.assert_array_equal(matched[asked.box.vertices[:, 0] < 0], False)
    assert (found.target_to_source >= 0).all()
    areas = vertex_areas(asked.box)
    assert found.overlap_source == pytest.approx(areas[matched].sum() / areas.sum(), rel=0.02)
    assert found.overlap_target == 1
    np.testing.assert_array_equal(found.faces == -1, ~matched)
    np.testing.assert_array_equal(np.isnan(found.weights).all(axis=1), ~matched)
    np.testing.assert_allclose(found.weights[matched].sum(axis=1), 1)
    shares = np.linalg.eigvalsh(found.functional_map)  # how much of a function is on the part
    assert -1e-6 < shares.min() < 0.1
    assert 0.9 < shares.max() < 1 + 1e-6
    asked.within = asked.within[::-1]
    back = asked(partial="none")
    assert (back.overlap_source, back.overlap_target) == (1, found.overlap_source)
    np.testing.assert_array_equal(back.target_to_source >= 0, matched)


def test_each_of_several_matches_has_places_on_faces_if_asked(asked: Asked) -> None:
    """Of the target, which is bent: its middle stays, and its ends go down."""
    x, y, z = asked.box.vertices.T
    asked.target = Mesh(np.stack([x, y - x**2 / 2, z], axis=1), asked.box.faces)
    found = asked(n_matches=2, barycentric=True)
    for one in (found, *found.alternatives):
        corners = asked.target.vertices[asked.target.faces[one.faces]]
        places = np.einsum("ij,ijk->ik", one.weights, corners)
        expected = asked.target.vertices[one.source_to_target]
        np.testing.assert_allclose(places, expected, atol=1e-6)
    plain = asked(n_matches=2)
    assert [(one.faces, one.weights) for one in (plain, *plain.alternatives)] == [(None, None)] * 2


def test_a_vertex_that_no_face_uses_is_on_no_face(asked: Asked) -> None:
    asked.box = Mesh(np.concatenate([asked.box.vertices, [[9, 9, 9]]]), asked.box.faces)
    with pytest.warns(UnbendWarning, match="unreferenced"):
        found = asked(barycentric=True)
    np.testing.assert_array_equal(np.flatnonzero(found.source_to_target < 0), [162])
    np.testing.assert_array_equal(np.flatnonzero(found.faces == -1), [162])
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.weights).any(axis=1)), [162])
    assert np.isnan(found.weights[162]).all()


def test_landmarks_are_vertices_of_source_and_target(
    asked: Asked, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    sides = _match.make_sides
    monkeypatch.setattr(_match, "make_sides", lambda *shapes: seen.extend(shapes) or sides(*shapes))
    x, y, z = asked.box.vertices.T
    asked.target = Mesh(np.stack([x, y - x**2 / 2, z], axis=1), asked.box.faces)
    ends = x.argsort()[[0, -1]]
    others = asked.turns[False][2][ends]
    assert (np.abs(asked.box.vertices[ends] - asked.box.vertices[others]).max(axis=1) > 1).all()
    with pytest.warns(UnbendWarning, match="landmark . is left aside"):
        found = asked(landmarks=np.stack([ends, others], axis=1))
    assert found.missed_landmarks == (0, 1)
    assert [one.landmarks.tolist() for one in seen] == [ends.tolist(), others.tolist()]
    for one, mesh in zip(seen, (asked.box, asked.target), strict=True):
        np.testing.assert_allclose(
            one.vertices, prepare_shape(mesh, 20, True).shape.vertices, atol=1e-9
        )


class EnoughError(Exception):
    """What comes afterwards is of no interest."""


@pytest.mark.parametrize(
    ("options", "torn", "n_eigenpairs"),
    [
        ({}, [True, True], 150),
        ({"partial": "both"}, [True, True], 150),
        ({"partial": "none"}, [False, False], 150),
        ({"partial": "source"}, [True, False], 150),
        ({"partial": "target", "n_eigenpairs": 4}, [False, True], 4),
        ({"method": "icp"}, [False, False], 4),
    ],
)
@pytest.mark.parametrize("cache", [None, False])
def test_what_is_a_part_and_how_many_functions_are_needed(
    monkeypatch: pytest.MonkeyPatch,
    blob: Mesh,
    options: dict[str, Any],
    torn: list[bool],
    n_eigenpairs: int,
    cache: bool | None,
) -> None:
    asked: list[Any] = []

    def prepare(meshes: Any, *others: Any) -> None:
        asked.extend(others)
        raise EnoughError

    monkeypatch.setattr(_match, "prepare_shapes", prepare)
    with pytest.raises(EnoughError):
        match(blob, blob, **options, **({} if cache is None else {"cache": cache}))
    assert asked == [n_eigenpairs, cache is None, torn]


@pytest.mark.parametrize("cache", [None, False])
def test_a_symmetry_asks_for_as_many_functions_as_a_match(
    monkeypatch: pytest.MonkeyPatch, blob: Mesh, cache: bool | None
) -> None:
    asked: list[Any] = []

    def prepare(mesh: Any, *others: Any) -> None:
        asked.extend(others)
        raise EnoughError

    monkeypatch.setattr(_match, "prepare_shape", prepare)
    with pytest.raises(EnoughError):
        symmetry(blob, **({} if cache is None else {"cache": cache}))
    assert asked == [150, cache is None]
    for wrong in (3, 4.5, True):
        with pytest.raises(InputError, match="n_eigenpairs must be a whole number of at least 4"):
            symmetry(blob, n_eigenpairs=wrong)  # type: ignore[arg-type]


def test_landmarks_that_are_no_pairs_are_refused_and_so_are_too_many(asked: Asked) -> None:
    for wrong in ([1, 2], [[1, 2, 3]], [[[1, 2], [3, 4]]], np.zeros((0, 2), dtype=int), 5):
        with pytest.raises(InputError, match="landmarks must be rows of two vertex numbers"):
            asked(landmarks=wrong)
    with pytest.raises(InputError, match="landmarks: rows have different lengths"):
        asked(landmarks=[[1, 2], [3]])
    with pytest.raises(InputError, match="give at most 7 landmarks, not 8"):
        asked(landmarks=[(i, i) for i in range(8)])
    assert asked(landmarks=[(i, i) for i in range(7)]).missed_landmarks == ()


def test_icp_takes_as_many_functions_as_both_shapes_have() -> None:
    corners = np.concatenate([np.eye(3), -np.eye(3)]) * [1, 1.5, 2.5]
    faces = [[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]]
    few = Mesh(corners, np.array(faces))
    ball = make_sphere(2)
    egg = Mesh(ball.vertices * [1, 1.5, 2.5], ball.faces)
    for pair in ((few, egg), (egg, few)):
        found = match(*pair, method="icp")
        assert found.functional_map.shape == (3, 3)
        assert found.residual < 2


def test_icp_turns_the_form_of_the_source_onto_that_of_the_target(blob: Mesh) -> None:
    """Of a shape and itself, by functions of one frequency that are others' sums."""
    ours = prepare_shape(blob, 4, True)
    shape = replace(ours.shape, eigenvalues=np.full(3, 2.0))
    turned = replace(shape, basis=shape.basis @ _rotation(4))
    found = _match_by_icp(ours._replace(shape=shape), ours._replace(shape=turned))
    np.testing.assert_array_equal(found.source_to_target, np.arange(blob.n_vertices))
    np.testing.assert_array_equal(found.target_to_source, np.arange(blob.n_vertices))
    assert found.residual < 1e-6
    assert found.orientation > 0.9
