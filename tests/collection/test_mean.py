"""The mean of registered shapes: who counts, that the truth comes back, and what is written."""

import csv
import sys
import tracemalloc

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from unbend import Mesh, read_mesh
from unbend.collection import Failure, MeanShape, mean_shape, shape_statistics, write_mean
from unbend.collection._mean import draw_components
from unbend.correspondence import Registration, register
from unbend.datasets import make_biped, make_sphere, rest_map
from unbend.errors import FileError, InputError, UnbendWarning
from unbend.io import value_colors
from unbend.mesh import edge_ends, vertex_areas
from unbend.report import shape_figures


@pytest.fixture(scope="module")
def shapes(blob: Mesh):
    """Blobs of different heights, turned anyhow."""
    turns = Rotation.random(5, rng=np.random.default_rng(0)).as_matrix()
    return [
        Mesh(blob.vertices * [1, 1, 1 + 0.1 * i] @ turn + i, blob.faces, name=f"s{i}")
        for i, turn in enumerate(turns)
    ]


def test_a_mean_takes_a_few_times_the_memory_of_the_positions():
    ball = make_sphere(4)
    several = [registered(Mesh(ball.vertices * (1 + 0.01 * i), ball.faces)) for i in range(50)]
    size = 50 * ball.vertices.nbytes
    tracemalloc.start()
    mean_shape(several, ball, n_components=2)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 5.5 * size


def registered(mesh, confidence=0.9, coverage=1.0, name=None):
    """A registration along the truth, so that only what is made of it is tested."""
    nothing = np.zeros(mesh.n_vertices)
    mesh = Mesh(mesh.vertices, mesh.faces, name=name or mesh.name)
    return Registration(mesh, nothing, nothing > 0, coverage, 1.0, 1.0, confidence)


def test_who_does_not_match_is_left_out_and_listed(blob, shapes):
    unsure = registered(blob, confidence=0.4999, name="unsure")
    torn = registered(blob, coverage=0.4999, name="torn")
    found = mean_shape([unsure, *map(registered, shapes), torn], blob)
    assert found.names == tuple(f"s{i}" for i in range(5))
    assert [one.path for one in found.left_out] == ["unsure", "torn"]
    reasons = [one.reason for one in found.left_out]
    assert reasons[0] == "the match's confidence is 0.4999, less than 0.5"
    assert reasons[1] == "49.99% of the template lies on it, less than 50%"
    plain = shape_statistics([one.vertices for one in shapes], weights=vertex_areas(blob))
    np.testing.assert_allclose(found.statistics.variances, plain.variances, rtol=1e-5, atol=1e-12)
    # It stands as the template does.
    turn, _ = Rotation.align_vectors(
        found.mean.vertices, blob.vertices - blob.vertices.mean(axis=0)
    )
    assert turn.magnitude() < 0.05
    np.testing.assert_array_equal(found.mean.faces, blob.faces)
    np.testing.assert_allclose(found.at(0, 3).vertices, found.statistics.at(0, 3))


def test_two_shapes_must_be_left(blob):
    odd = registered(blob, confidence=0.4999, name="unsure")
    with pytest.raises(InputError, match="0 are left; unsure was left out: the match's confidence"):
        mean_shape([odd, odd], (blob.vertices, blob.faces))


def test_registrations_of_another_template_are_refused(blob, shapes):
    other = registered(make_sphere(1))
    with pytest.raises(InputError, match="is not registered to blob"):
        mean_shape([registered(shapes[0]), other], blob)


def test_a_map_that_was_given_is_trusted(blob, shapes):
    found = mean_shape([registered(one, confidence=np.nan) for one in shapes], blob)
    assert len(found.names) == 5


def test_sizes_of_different_units_are_told(blob, shapes):
    given = [
        *map(registered, shapes),
        registered(Mesh(1000 * blob.vertices, blob.faces), name="mm"),
    ]
    with pytest.warns(UnbendWarning, match=r"mm is 1,\d+ times as large as s0: .*--scale"):
        mean_shape(given, blob)
    with pytest.warns(
        UnbendWarning, match=r"times as large as s0: .* use one, or none of the sizes"
    ):
        mean_shape(given, blob, scale=True)


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan])
def test_shares_are_from_0_to_1(blob, shapes, share):
    for name in ("min_confidence", "min_coverage"):
        with pytest.raises(InputError, match=f"{name} must be from 0 to 1, not"):
            mean_shape(map(registered, shapes), blob, **{name: share})


def test_a_mirror_image_is_another_shape(blob):
    mirrored = Mesh(blob.vertices * [-1, 1, 1], blob.faces)
    shapes = shape_statistics([blob.vertices, mirrored.vertices], weights=vertex_areas(blob))
    found = mean_shape([registered(blob), registered(mirrored)], blob).statistics
    assert found.total_variance == pytest.approx(shapes.total_variance)


def test_registered_bodies_give_the_mean_and_the_component_of_true_ones():
    # Bodies that differ in their legs most, each meshed on its own.
    template = make_biped("standing", n_vertices=500)
    lengths = np.array([0.8, 1.0, 1.3])
    bodies = [
        make_biped("standing", n_vertices=500, meshing=i, legs=length, head=1 + 0.05 * (-1) ** i)
        for i, length in enumerate(lengths)
    ]
    pairs = [(one.mesh, rest_map(template, one)) for one in bodies]
    found = mean_shape([register(template.mesh, *pair) for pair in pairs], template.mesh)
    assert found.left_out == ()
    weights = vertex_areas(template.mesh)
    true = shape_statistics([mesh.vertices[truth] for mesh, truth in pairs], weights=weights)
    assert abs(np.corrcoef(found.statistics.scores[:, 0], true.scores[:, 0])[0, 1]) > 0.99
    assert abs(np.corrcoef(found.statistics.scores[:, 0], np.log(lengths))[0, 1]) > 0.99
    turn = Rotation.align_vectors(true.mean, found.mean.vertices)[0].as_matrix()
    apart = np.linalg.norm(found.mean.vertices @ turn.T - true.mean, axis=1)
    ends = true.mean[edge_ends(template.mesh.faces, len(apart))]
    edge = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
    assert weights @ apart / weights.sum() < 0.5 * edge


@pytest.fixture
def made(blob: Mesh) -> MeanShape:
    shapes = [blob.vertices * [1, 1 + 0.1 * i, 1 + 0.02 * i**2] for i in range(4)]
    names = tuple(f"{i}.ply" for i in range(4))
    statistics = shape_statistics(shapes, n_components=2)
    left_out = (Failure("odd.ply", "the match's confidence is 0.10"),)
    return MeanShape(blob, statistics, names, np.full(4, 0.9), np.ones(4), left_out)


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_components_of_an_earlier_mean_go_and_all_else_stays(made, tmp_path):
    for name in ("component_2_plus.ply", "component_3_plus.ply", "component_3_notes.ply"):
        (tmp_path / name).write_text("of another mean")
    write_mean(tmp_path, made)
    assert not (tmp_path / "component_3_plus.ply").exists()
    assert (tmp_path / "component_3_notes.ply").exists()
    assert read_mesh(tmp_path / "component_2_plus.ply").n_vertices == made.mean.n_vertices


def test_everything_is_written(made, tmp_path):
    written = write_mean(str(tmp_path / "new" / "out"), made)
    assert [path.name for path in written] == [
        "mean.ply",
        "component_1_minus.ply",
        "component_1_plus.ply",
        "component_2_minus.ply",
        "component_2_plus.ply",
        "variances.csv",
        "scores.csv",
        "left_out.csv",
        "components.png",
    ]
    assert all(path.stat().st_size > 0 for path in written)
    np.testing.assert_array_equal(read_mesh(written[0]).vertices, made.statistics.mean)
    np.testing.assert_array_equal(read_mesh(written[2]).vertices, made.statistics.at(0, 3))
    np.testing.assert_array_equal(read_mesh(written[3]).vertices, made.statistics.at(1, -3))
    folder = written[0].parent
    variances = [float(row["variance"]) for row in rows(folder / "variances.csv")]
    np.testing.assert_array_equal(variances, made.statistics.variances)
    shares = [float(row["share"]) for row in rows(folder / "variances.csv")]
    np.testing.assert_allclose(shares, np.array(variances) / made.statistics.total_variance)
    scores = rows(folder / "scores.csv")
    assert [row["path"] for row in scores] == list(made.names)
    assert float(scores[2]["score_1"]) == made.statistics.scores[2, 0]
    assert b"\r" not in (folder / "scores.csv").read_bytes()
    assert rows(folder / "left_out.csv") == [
        {"path": "odd.ply", "reason": "the match's confidence is 0.10"}
    ]


def test_the_mean_shows_its_variability(made, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    mean = trimesh.load(write_mean(tmp_path, made)[0], process=False)
    spread = made.statistics.variability
    colors = value_colors(spread, limits=(0, spread.max()))
    np.testing.assert_array_equal(mean.visual.vertex_colors[:, :3], colors)
    data = mean.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_allclose(np.ravel(data["variability"]), spread, rtol=1e-6)


def test_the_picture_shows_three_standard_deviations_on_either_side(made, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(shape_figures, "draw_variation", lambda *given: drawn.append(given))
    draw_components(made, tmp_path / "components.png")
    ((lines, heads, _),) = drawn
    assert heads == ["-3 SD", "-1.5 SD", "mean", "+1.5 SD", "+3 SD"]
    for i, (_, shapes) in enumerate(lines):
        for shape, steps in zip(shapes, (-3, -1.5, 0, 1.5, 3), strict=True):
            np.testing.assert_array_equal(shape.vertices, made.statistics.at(i, steps))


def test_without_matplotlib_there_is_no_picture(made, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    (tmp_path / "components.png").write_text("of another mean")
    assert write_mean(tmp_path, made)[-1].name == "left_out.csv"
    assert not (tmp_path / "components.png").exists()


def test_without_components_there_is_no_picture(blob, tmp_path):
    (tmp_path / "components.png").write_text("of another mean")
    same = shape_statistics([blob.vertices] * 3)
    made = MeanShape(blob, same, ("a", "b", "c"), np.ones(3), np.ones(3), ())
    assert tmp_path / "components.png" not in write_mean(tmp_path, made)
    assert not (tmp_path / "components.png").exists()


def test_a_folder_that_cannot_be_made_is_refused(made, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot make the folder"):
        write_mean(tmp_path / "file" / "out", made)
