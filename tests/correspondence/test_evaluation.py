"""Evaluation: protocols, curve and geodesics on surfaces where distances are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from unbend import Mesh
from unbend.correspondence import THRESHOLDS, _evaluation, evaluate
from unbend.datasets import make_sphere
from unbend.errors import InputError, MeshError, UnbendWarning

BALL = make_sphere(3)
EVERY = np.arange(BALL.n_vertices)
AREA = 4 * np.pi


def _antipodes() -> np.ndarray:
    return np.argmin(BALL.vertices @ BALL.vertices.T, axis=1)


def _mirror() -> np.ndarray:
    return np.argmax((BALL.vertices * [-1, 1, 1]) @ BALL.vertices.T, axis=1)


def test_identity_has_no_error() -> None:
    found = evaluate(EVERY, BALL, EVERY, EVERY)
    assert found.direct.max() == 0
    assert found.direct.dtype == np.float64
    assert found.coverage == pytest.approx(1)
    assert found.auc() == 1
    assert (found.curve() == 100).all()
    assert found.map_min is None


@pytest.mark.parametrize("distance", ["geodesic", "geodesic-exact"])
def test_antipodes_are_half_a_great_circle_away(distance: str) -> None:
    if distance == "geodesic-exact":
        pytest.importorskip("pygeodesic")
    found = evaluate(_antipodes(), BALL, EVERY[:20], EVERY[:20], distance=distance)
    np.testing.assert_allclose(found.direct, np.pi / np.sqrt(AREA), rtol=0.03)


def test_progress_is_told_of_every_vertex_from_which_distances_are_computed() -> None:
    told: list[tuple[str, float]] = []
    egg = Mesh(BALL.vertices * [1, 1, 2], BALL.faces)
    evaluate(EVERY, egg, EVERY[:4], EVERY[:4], progress=lambda *step: told.append(step))
    assert told == [("geodesic distances", share) for share in (0, 0.25, 0.5, 0.75)]


def test_errors_do_not_depend_on_the_unit() -> None:
    images = np.roll(EVERY, 7)
    small = evaluate(images, BALL, EVERY[:30], EVERY[:30])
    large = evaluate(images, Mesh(BALL.vertices * 1000, BALL.faces), EVERY[:30], EVERY[:30])
    np.testing.assert_allclose(small.direct, large.direct, rtol=1e-4)


def test_protocols_of_a_mirrored_map() -> None:
    mirror = _mirror()
    found = evaluate(mirror, BALL, EVERY, EVERY, mirror)
    assert found.mean("map-min") == 0
    assert found.mean("vertex-min") == 0
    assert found.mean("direct") > 0.1
    # Half mirrored: no single choice is right, each row on its own is.
    half = np.where(BALL.vertices[:, 2] > 0, mirror, EVERY)
    found = evaluate(half, BALL, EVERY, EVERY, mirror)
    assert found.mean("vertex-min") == 0
    assert 0 < found.mean("map-min") <= found.mean("direct")


def test_curve_counts_errors_up_to_each_threshold() -> None:
    found = evaluate(np.roll(EVERY, 3), BALL, EVERY, EVERY)
    curve = found.curve()
    assert THRESHOLDS.shape == curve.shape == (17,)
    assert THRESHOLDS[-1] == 0.2
    assert not THRESHOLDS.flags.writeable  # or a plot in percent would change all later curves
    assert (np.diff(curve) >= 0).all()
    assert curve[4] == pytest.approx(100 * (found.direct <= 0.05).mean())
    assert found.median() == np.median(found.direct)
    assert 0 <= found.auc() < 1
    # Errors of a tenth: the curve is 0 up to 0.0875 and 1 from 0.1.
    assert replace(found, direct=np.array([0.1])).auc() == 8.5 / 16


def test_errors_on_a_threshold_are_within_it() -> None:
    side = np.arange(81) / 80
    x, y = np.meshgrid(side, side, indexing="ij")
    corner = (81 * np.arange(80)[:, None] + np.arange(80)).ravel()
    faces = (corner[:, None, None] + np.array([[0, 81, 1], [1, 81, 82]])).reshape(-1, 3)
    square = Mesh(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), faces)
    rows = 81 * np.arange(0, 80, 20)
    for k in (1, 2, 3):
        found = evaluate(np.arange(x.size), square, rows, rows + k, distance="geodesic-exact")
        assert found.curve()[k] == 100


def test_what_distances_warn_of_is_told_every_time() -> None:
    way = np.random.default_rng(0).normal(size=(60, 3)) * [1, 1, 100]
    caps = ConvexHull(way / np.linalg.norm(way, axis=1, keepdims=True))  # far apart
    mesh, every = Mesh(caps.points, caps.simplices), np.arange(60)
    for _ in range(2):
        with pytest.warns(UnbendWarning, match="falls short of the straight line"):
            evaluate(every, mesh, every, np.roll(every, 1))


def test_rows_without_a_mirrored_image_count_for_the_direct_protocol() -> None:
    mirror = _mirror()
    partly = np.where(EVERY % 3 == 0, -1, mirror)
    found = evaluate(mirror, BALL, EVERY, EVERY, partly)
    np.testing.assert_array_equal(found.direct, evaluate(mirror, BALL, EVERY, EVERY).direct)
    assert len(found.direct) == len(EVERY)
    for protocol in ("map-min", "vertex-min"):
        np.testing.assert_array_equal(found.errors(protocol), np.zeros((partly >= 0).sum()))
    with pytest.raises(InputError, match="mirrored_target_points: no row has both"):
        evaluate(mirror, BALL, EVERY, EVERY, np.full_like(EVERY, -1))


def test_repeated_faces_are_no_more_surface() -> None:
    doubled = Mesh(BALL.vertices, np.concatenate([BALL.faces, BALL.faces[:800, [1, 0, 2]]]))
    images = np.where(EVERY % 2 == 0, EVERY, 17)
    one, other = (
        evaluate(images, mesh, EVERY, EVERY, distance="geodesic") for mesh in (BALL, doubled)
    )
    np.testing.assert_allclose(other.direct, one.direct, rtol=1e-6, atol=1e-9)
    assert other.coverage == pytest.approx(one.coverage)


def test_an_image_that_no_face_uses_is_infinitely_far() -> None:
    target = Mesh(np.append(BALL.vertices, [[np.nan] * 3], axis=0), BALL.faces)
    images = np.where(EVERY == 5, len(EVERY), EVERY)
    with pytest.warns(UnbendWarning, match="no path joins 1 of 642 images to the truth"):
        assert evaluate(images, target, EVERY, EVERY).direct[5] == np.inf


def test_coverage_of_a_constant_map() -> None:
    found = evaluate(np.zeros_like(EVERY), BALL, EVERY[:5], EVERY[:5])
    assert found.coverage == pytest.approx(1 / BALL.n_vertices, rel=0.5)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((EVERY, BALL, EVERY, EVERY[:3]), "source and"),
        ((EVERY + 1, BALL, EVERY, EVERY), "names target vertex 642, but .* has 642"),
        ((EVERY, BALL, [-1], [0]), "source_points: there is no vertex -1"),
        ((EVERY, BALL, [[0], [0, 1]], [0, 1]), "source_points: vertex ids: rows have"),
        ((EVERY, BALL, [0], [642]), "target_points names target vertex 642, but .* has 642"),
        ((EVERY * 1.0, BALL, EVERY, EVERY), "list of vertex numbers"),
        ((np.full_like(EVERY, -1), BALL, EVERY, EVERY), "no row"),
    ],
)
def test_what_is_wrong_is_said(arguments: tuple, message: str) -> None:
    with pytest.raises(InputError, match=message):
        evaluate(*arguments)


def test_unknown_choices_are_refused() -> None:
    with pytest.raises(InputError, match="distance must be"):
        evaluate(EVERY, BALL, EVERY, EVERY, distance="dijkstra")
    found = evaluate(EVERY, BALL, EVERY[:3], EVERY[:3])
    with pytest.raises(InputError, match="mirrored ground truth"):
        found.mean("map-min")
    with pytest.raises(InputError, match="protocol"):
        found.mean("best")


def _two_balls_and_a_stray() -> Mesh:
    """Vertices 0 to n - 1: a ball; n to 2 n - 1: another, apart; 2 n: used by no face."""
    n = BALL.n_vertices
    points = np.vstack([BALL.vertices, BALL.vertices + 5, [[9, 9, 9]]])
    return Mesh(points, np.vstack([BALL.faces, BALL.faces + n]), name="two balls")


@pytest.mark.parametrize("distance", ["geodesic", "geodesic-exact"])
def test_what_no_path_leads_to_is_infinitely_far(distance: str) -> None:
    if distance == "geodesic-exact":
        pytest.importorskip("pygeodesic")
    target, n = _two_balls_and_a_stray(), BALL.n_vertices
    images = np.array([0, n + 1, 2 * n, n + 3])
    truth = np.array([0, 1, 2, n + 4])
    with pytest.warns(UnbendWarning, match="no path joins 2 of 4 images to the truth"):
        found = evaluate(images, target, np.arange(4), truth, distance=distance)
    np.testing.assert_array_equal(np.isinf(found.direct), [False, True, True, False])
    assert found.direct[0] == 0
    # The second ball is measured as if it stood alone, in units of both areas.
    alone = evaluate([3], BALL, [0], [4], distance=distance)
    assert found.direct[3] == pytest.approx(alone.direct[0] / np.sqrt(2), rel=1e-5)
    assert found.mean() == np.inf
    assert found.curve()[-1] <= 50


def test_one_row_without_a_path_does_not_choose_between_a_truth_and_its_mirror_image() -> None:
    target, n = _two_balls_and_a_stray(), BALL.n_vertices
    images = np.concatenate([_mirror(), EVERY + n, [-1]])
    mirrored = images.copy()
    mirrored[3] = n
    every = np.arange(2 * n + 1)
    with pytest.warns(UnbendWarning, match="no path joins 1 of .* to the mirrored truth alone"):
        found = evaluate(images, target, every[:-1], every[:-1], mirrored[:-1])
    assert found.auc("map-min") > 0.99 > found.auc("direct")
    assert np.isinf(found.errors("map-min")).sum() == 1


def test_ground_truth_off_the_surface_is_refused() -> None:
    target, n = _two_balls_and_a_stray(), BALL.n_vertices
    with pytest.raises(InputError, match=f"target_points: row 1 is {2 * n}, a vertex that no face"):
        evaluate([0, 1], target, [0, 1], [0, 2 * n])
    assert evaluate([0, -1], target, [0, 1], [0, 2 * n]).mean() == 0  # it does not count
    strays = Mesh(np.vstack([[[9, 9, 9]] * 2, BALL.vertices]), BALL.faces + 2)
    assert evaluate([2, -1], strays, [0, 1], [2, 3]).mean() == 0
    with pytest.raises(InputError, match="target_points: row 0 is 0, a vertex that no face"):
        evaluate([2], strays, [0], [0])


def test_point_clouds_are_refused() -> None:
    with pytest.raises(MeshError, match="point cloud"):
        evaluate(EVERY, BALL.vertices, EVERY, EVERY)


def test_overlap_is_counted_in_closed_form() -> None:
    truth = np.where(EVERY < 400, EVERY, -1)
    images = np.where((EVERY >= 100) & (EVERY < 600), EVERY, -1)
    found = evaluate(images, BALL, EVERY, truth)
    assert len(found.direct) == 300
    assert found.mean() == 0
    assert found.coverage < 1
    assert found.overlap.precision == pytest.approx(300 / 500)
    assert found.overlap.recall == pytest.approx(300 / 400)
    assert found.overlap.iou == pytest.approx(300 / 600)
    assert evaluate(EVERY, BALL, EVERY, EVERY).overlap.iou == 1


def test_distances_kept_are_counted_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of many small targets there are very many, and other threads may add some meanwhile."""
    kept = {(2, i): range(10) for i in range(4)}  # ten rows of two numbers of 4 bytes
    monkeypatch.setattr(_evaluation, "_kept", kept)
    monkeypatch.setattr(_evaluation, "_KEPT_BYTES", 160)
    _evaluation._forget()
    assert list(kept) == [(2, 2), (2, 3)]


def test_distances_are_kept_up_to_a_size(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_evaluation, "_kept", {})

    def kept_after(size: int) -> int:
        evaluate([1], Mesh(size * BALL.vertices, BALL.faces), [0], [0])
        return len(_evaluation._kept)

    assert [kept_after(size) for size in (1, 2, 2, 3)] == [1, 2, 2, 3]
    monkeypatch.setattr(_evaluation, "_KEPT_BYTES", 0)
    assert kept_after(4) == 1
    assert all(_evaluation._kept.values())
    # Of a mesh of 50,000 vertices all would be 10 GB.
    monkeypatch.setattr(_evaluation, "available_memory", lambda: 0)
    assert kept_after(5) == 1
    assert not any(_evaluation._kept.values())
