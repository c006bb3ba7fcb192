"""What the mean of a collection is written as."""

import csv

import numpy as np
import pytest

from unbend import Mesh, read_mesh
from unbend.collection import Failure, MeanShape, shape_statistics, write_mean
from unbend.collection._statistics import draw_components
from unbend.errors import FileError
from unbend.io import value_colors
from unbend.report import shape_figures


@pytest.fixture
def found(blob: Mesh) -> MeanShape:
    shapes = [blob.vertices * [1, 1 + 0.1 * i, 1 + 0.02 * i**2] for i in range(4)]
    names = tuple(f"{i}.ply" for i in range(4))
    statistics = shape_statistics(shapes, n_components=2)
    left_out = (Failure("odd.ply", "the match's confidence is 0.10"),)
    return MeanShape(blob, statistics, names, np.full(4, 0.9), np.ones(4), left_out)


def rows(path):
    with open(path, newline="") as file:
        return list(csv.DictReader(file))


def test_components_of_an_earlier_mean_go_and_all_else_stays(found, tmp_path):
    for name in ("component_2_plus.ply", "component_3_plus.ply", "component_3_notes.ply"):
        (tmp_path / name).write_text("of another mean")
    write_mean(tmp_path, found)
    assert not (tmp_path / "component_3_plus.ply").exists()
    assert (tmp_path / "component_3_notes.ply").exists()
    assert read_mesh(tmp_path / "component_2_plus.ply").n_vertices == found.mean.n_vertices


def test_everything_is_written(found, tmp_path):
    written = write_mean(str(tmp_path / "new" / "out"), found)
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
    np.testing.assert_array_equal(read_mesh(written[0]).vertices, found.statistics.mean)
    np.testing.assert_array_equal(read_mesh(written[2]).vertices, found.statistics.at(0, 3))
    np.testing.assert_array_equal(read_mesh(written[3]).vertices, found.statistics.at(1, -3))
    folder = written[0].parent
    variances = [float(row["variance"]) for row in rows(folder / "variances.csv")]
    np.testing.assert_array_equal(variances, found.statistics.variances)
    shares = [float(row["share"]) for row in rows(folder / "variances.csv")]
    np.testing.assert_allclose(shares, np.array(variances) / found.statistics.total_variance)
    scores = rows(folder / "scores.csv")
    assert [row["path"] for row in scores] == list(found.names)
    assert float(scores[2]["score_1"]) == found.statistics.scores[2, 0]
    assert b"\r" not in (folder / "scores.csv").read_bytes()
    assert rows(folder / "left_out.csv") == [
        {"path": "odd.ply", "reason": "the match's confidence is 0.10"}
    ]


def test_the_mean_shows_its_variability(found, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    mean = trimesh.load(write_mean(tmp_path, found)[0], process=False)
    spread = found.statistics.variability
    colors = value_colors(spread, limits=(0, spread.max()))
    np.testing.assert_array_equal(mean.visual.vertex_colors[:, :3], colors)
    data = mean.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_allclose(np.ravel(data["variability"]), spread, rtol=1e-6)


def test_the_picture_shows_three_standard_deviations_on_either_side(found, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(shape_figures, "draw_variation", lambda *given: drawn.append(given))
    draw_components(found, tmp_path / "components.png")
    ((lines, heads, _),) = drawn
    assert heads == ["-3 SD", "-1.5 SD", "mean", "+1.5 SD", "+3 SD"]
    for i, (_, shapes) in enumerate(lines):
        for shape, steps in zip(shapes, (-3, -1.5, 0, 1.5, 3), strict=True):
            np.testing.assert_array_equal(shape.vertices, found.statistics.at(i, steps))


def test_without_matplotlib_there_is_no_picture(found, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    (tmp_path / "components.png").write_text("of another mean")
    assert write_mean(tmp_path, found)[-1].name == "left_out.csv"
    assert not (tmp_path / "components.png").exists()


def test_without_components_there_is_no_picture(blob, tmp_path):
    (tmp_path / "components.png").write_text("of another mean")
    same = shape_statistics([blob.vertices] * 3)
    found = MeanShape(blob, same, ("a", "b", "c"), np.ones(3), np.ones(3), ())
    assert tmp_path / "components.png" not in write_mean(tmp_path, found)
    assert not (tmp_path / "components.png").exists()


def test_a_folder_that_cannot_be_made_is_refused(found, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot make the folder"):
        write_mean(tmp_path / "file" / "out", found)
