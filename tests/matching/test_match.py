"""Matching: truths on shapes whose correspondence is known, and on real ones where given."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from unbend import Mesh, align, read_mesh, spectrum
from unbend.correspondence import evaluate
from unbend.datasets import make_biped, make_quadruped, make_sphere, rest_map
from unbend.errors import InputError, MeshError, UnbendWarning
from unbend.matching import _match, match, prepare_spectrum, symmetry
from unbend.matching._inputs import prepare_shape
from unbend.matching._judge import Candidate
from unbend.matching._polish import refined
from unbend.matching._solve import Sides, candidates, make_sides

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
    ball = make_sphere(2)
    x, y, z = ball.vertices.T
    egg = np.stack([x * (1.3 + 0.4 * y + 0.2 * z), y, 0.7 * z + 0.2 * y**2], axis=1)
    polished, told = [], []

    def quick(sides: Sides, one: Candidate, *, polish: bool) -> Candidate:
        polished.append(polish)
        return refined(sides, one, polish=False)

    monkeypatch.setattr(_match, "refined", quick)
    found = symmetry(
        (egg, ball.faces), n_eigenpairs=30, progress=lambda *stage: told.append(stage), **options
    )
    assert np.abs(egg[found.source_to_target] * MIRROR - egg).max() < 1e-9
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


def test_what_is_wrong_is_said(blob: Mesh, moebius_strip: Mesh) -> None:
    with pytest.raises(MeshError, match="only one side"):
        match(moebius_strip, blob)
    with pytest.raises(InputError, match="needs faces"):
        match(blob.vertices, blob)
    with pytest.raises(InputError, match="method"):
        match(blob, blob, method="magic")
    with pytest.raises(InputError, match="n_eigenpairs"):
        match(blob, blob, n_eigenpairs=2)


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
