"""``unbend collection evaluate`` and ``mean``."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from stones import write_stones
from unbend.cli import app
from unbend.collection import Collection, Failure, MeanShape, retrieval_measures, shape_statistics


def run(*arguments):
    return CliRunner().invoke(app, ["collection", *map(str, arguments)])


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    folder = tmp_path_factory.mktemp("statistics")
    write_stones(folder / "stones", 5)
    Collection(folder / "shapes").add(folder / "stones", workers=0)
    return folder


@pytest.fixture
def labels(shapes):
    names = sorted(path.name for path in (shapes / "stones").iterdir())
    table = shapes / "labels.csv"
    table.write_text(
        "path,label\n" + "".join(f"{n},{'ab'[i % 2]}\n" for i, n in enumerate(names[:4]))
    )
    return table


def test_evaluate_measures_the_labelled(shapes, labels):
    done = run("evaluate", shapes / "shapes", labels, "--json")
    assert done.exit_code == 0, done.output
    assert "1 of 5 shapes have no label that counts" in done.stderr
    found = json.loads(done.stdout)
    entries, distances = Collection(shapes / "shapes").distances()
    order = np.argsort([entry.path for entry in entries])[:4]
    expected = retrieval_measures(distances[np.ix_(order, order)], list("abab"))
    for name in ("nearest_neighbor", "first_tier", "second_tier", "e_measure", "dcg", "map"):
        assert found[name] == pytest.approx(getattr(expected, name))
    assert (found["n_shapes"], found["n_classes"]) == (4, 2)
    told = run("evaluate", shapes / "shapes", labels)
    assert f"first tier         {expected.first_tier:.1%}" in told.stdout


def test_evaluate_names_a_line_that_does_not_fit(shapes, tmp_path):
    (tmp_path / "labels.csv").write_text("path,label\nnone.ply,a\n")
    done = run("evaluate", shapes / "shapes", tmp_path / "labels.csv")
    assert done.exit_code == 2
    assert "line 2: none.ply is no shape of the collection" in done.stderr


def test_identical_files_take_a_label_together_and_none_where_theirs_differ(
    shapes, labels, tmp_path
):
    copy = tmp_path / "copy.ply"
    copy.write_bytes((shapes / "stones" / "stone00.ply").read_bytes())
    store = tmp_path / "shapes"
    Collection(store).add([shapes / "stones", copy], workers=0)
    before = json.loads(run("evaluate", shapes / "shapes", labels, "--json").stdout)
    given = ("evaluate", store, tmp_path / "labels.csv", "--json")
    rows = labels.read_text()
    (tmp_path / "labels.csv").write_text(f"{rows}copy.ply,a\n")
    done = run(*given)
    told = json.loads(done.stdout)
    assert told == {**before, "store": str(store), "seconds": told["seconds"]}
    assert "warning" not in done.stderr
    (tmp_path / "labels.csv").write_text(f"{rows}copy.ply,b\n")
    done = run(*given)
    assert f"stone00.ply a a and {copy} a b, but these files are identical" in done.stderr
    assert json.loads(done.stdout)["n_shapes"] == before["n_shapes"] - 1


def test_mean_gives_all_shapes_to_the_workers_and_writes(shapes, blob, tmp_path, monkeypatch):
    asked = {}

    def mean(paths, template, **options):
        asked.update(options, paths=list(paths), template=template)
        statistics = shape_statistics([blob.vertices, 1.2 * blob.vertices * [1, 1, 1.1]])
        left_out = (Failure(asked["paths"][2], "the match's confidence is 0.10"),)
        return MeanShape(blob, statistics, ("a", "b"), np.ones(2), np.ones(2), left_out)

    monkeypatch.setattr("unbend.collection.mean_shape", mean)
    arguments = ("mean", shapes / "shapes", "--template", "t.ply", "-o", tmp_path / "out")
    done = run(*arguments, "--workers", 2, "--scale", "--n-components", 3)
    assert done.exit_code == 0, done.output
    assert [path.rsplit("/", 1)[-1] for path in asked["paths"]] == sorted(
        path.name for path in (shapes / "stones").iterdir()
    )
    assert (asked["workers"], asked["scale"], asked["n_components"]) == (2, True, 3)
    assert (tmp_path / "out" / "component_1_plus.ply").exists()
    assert "confidence is 0.10" in done.stderr
    assert "2 of 3" in done.stdout
    found = json.loads(run(*arguments, "--json").stdout)
    assert found["n_shapes"] == 2
    assert [one["reason"] for one in found["failed"]] == ["the match's confidence is 0.10"]
    assert "mean.ply" in found["files"]


def test_mean_says_which_file_is_missing_and_how_to_mend_it(shapes, tmp_path, monkeypatch, blob):
    store, here = tmp_path / "shapes", tmp_path / "stones"
    write_stones(here, 3)
    Collection(store).add(here, workers=0)
    (here / "stone01.ply").unlink()

    def mean(paths, template, **options):
        statistics = shape_statistics([blob.vertices, 1.2 * blob.vertices * [1, 1, 1.1]])
        return MeanShape(blob, statistics, tuple(paths), np.ones(2), np.ones(2), ())

    monkeypatch.setattr("unbend.collection.mean_shape", mean)
    done = run("mean", store, "--template", "t.ply", "-o", tmp_path / "out")
    assert done.exit_code == 0, done.output
    mend = f"{here}/stone01.ply (there is no such file): run unbend collection add {store} NEWF"
    assert mend in done.stderr
    assert mend in (tmp_path / "out" / "left_out.csv").read_text()
    assert "2 of 3" in done.stdout
