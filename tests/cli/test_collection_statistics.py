"""``unbend collection evaluate``, ``register`` and ``mean``."""

import json

import numpy as np
import pytest

from stones import write_stones
from terminal import invoke
from unbend.collection import Collection, _registering, read_registrations, retrieval_measures


def run(*arguments):
    return invoke(["collection", *map(str, arguments)])


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
    assert "shapes             4\nclasses            2\n" in told.stdout


def test_evaluate_says_that_one_class_measures_nothing(shapes, labels):
    labels.write_text(labels.read_text().replace(",b", ",a"))
    done = run("evaluate", shapes / "shapes", labels)
    assert done.exit_code == 0
    assert "warning: all labelled shapes are of one class, so that every result is" in done.stderr


def test_evaluate_names_a_line_that_does_not_fit(shapes, tmp_path):
    (tmp_path / "labels.csv").write_text("path,label\nnone.ply,a\n")
    done = run("evaluate", shapes / "shapes", tmp_path / "labels.csv")
    assert done.exit_code == 2
    assert "none.ply is no shape of the collection; add it, or remove its line" in done.stderr


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


@pytest.fixture(scope="module")
def registered(shapes):
    """Shapes registered by the command, with a file that is missing."""
    store, here = shapes / "own", shapes / "own_stones"
    write_stones(here, 4)
    Collection(store).add(here, workers=0)
    (here / "stone01.ply").unlink()
    template = here / "stone00.ply"
    arguments = ("register", store, "--template", template, "-o", shapes / "registered")
    done = run(*arguments, "--workers", 0)
    assert done.exit_code == 1, done.output
    return shapes, arguments, done


def test_register_lists_all_shapes_and_what_to_do(registered):
    shapes, arguments, done = registered
    lost = shapes / "own_stones" / "stone01.ply"
    advice = f"{lost} (there is no such file): run unbend collection add {shapes / 'own'} NEWF"
    assert advice in done.stderr
    lines = done.stdout.splitlines()
    assert " ".join(lines[0].split()) == "shape confidence covered scan covered 95% within"
    assert lines[4].split()[0] == str(lost)
    assert lines[4].endswith("failed")
    assert lines[6].startswith("registered 3, there before 0, failed 1 (")
    again = run(*arguments, "--workers", 0, "--json")
    told = json.loads(again.stdout)
    assert (told["n_registered"], told["n_skipped"]) == (0, 3)
    assert [one["path"] for one in told["failed"]] == [str(lost)]
    confidences = [one["confidence"] for one in told["shapes"]]
    shown = [float(line.split()[1]) for line in lines[1:4]]
    assert shown == sorted(np.round(confidences, 2), reverse=True)


def test_register_points_out_doubtful_shapes(registered, monkeypatch):
    shapes, arguments, _ = registered
    monkeypatch.setattr("unbend.collection._rows.is_doubtful", lambda confidence: True)
    told = run(*arguments, "--workers", 0).stdout.splitlines()
    assert [line.endswith("  doubtful") for line in told[1:5]] == [True, True, True, False]
    assert "doubtful 3" in told[6]
    assert f"unbend match {shapes / 'own_stones' / 'stone00.ply'} " in told[-1]
    assert "--landmarks" in told[-1]
    load = _registering._load
    mirrored = ("the mirror image of the target fits better",)
    monkeypatch.setattr(_registering, "_load", lambda *given: (load(*given)[0], mirrored))
    told = run(*arguments, "--workers", 0).stdout.splitlines()
    assert told[-1].endswith("--report match.html; mirror those of the other side")


def test_register_reads_landmarks(registered, tmp_path):
    shapes, arguments, _ = registered
    stone = shapes / "own_stones" / "stone02.ply"
    table = tmp_path / "hints.csv"
    table.write_text("vertex,shape,template\n" + "".join(f"{i},{stone},{i}\n" for i in (0, 50)))
    done = run(*arguments, "--workers", 0, "--landmarks", table)
    assert "registered 1, there before 2" in done.stdout, done.output
    table.write_text(f"shape,template,vertex\n{stone},0,x\n")
    done = run(*arguments, "--landmarks", table)
    assert done.exit_code == 2
    assert (
        "hints.csv: line 2: vertices are whole numbers counted from 0, not 0 and x" in done.stderr
    )


def test_mean_reads_what_is_registered(registered, tmp_path):
    shapes, _, _ = registered
    arguments = ("mean", shapes / "registered", "-o", tmp_path / "out", "--min-confidence", 0)
    done = run(*arguments, "--scale", "--n-components", 1)
    assert done.exit_code == 0, done.output
    assert "3 of 4" in done.stdout
    assert {one.name for one in (tmp_path / "out").iterdir()} >= {
        "mean.ply",
        "component_1_plus.ply",
    }
    assert "stone01.ply" in (tmp_path / "out" / "left_out.csv").read_text()
    found = json.loads(run(*arguments, "--json").stdout)
    assert (found["n_shapes"], len(found["variances"])) == (3, 2)
    assert [one["path"].rsplit("/", 1)[-1] for one in found["failed"]] == ["stone01.ply"]
    nothing = run("mean", tmp_path, "-o", tmp_path / "none")
    assert nothing.exit_code == 2
    assert "holds no registered shapes" in nothing.stderr
    assert not (tmp_path / "none").exists()


def test_mean_of_too_few_shapes_says_which_failed(registered, tmp_path, monkeypatch):
    shapes, _, _ = registered
    template, _, failures = read_registrations(shapes / "registered")
    monkeypatch.setattr("unbend.collection.read_registrations", lambda _: (template, [], failures))
    done = run("mean", "here", "-o", tmp_path / "out")
    assert done.exit_code == 2
    assert f"stone01.ply: {failures[0].reason}\nerror: statistics need at least 2" in done.stderr


def test_mean_of_identical_shapes_says_that_they_do_not_differ(registered, tmp_path, monkeypatch):
    shapes, _, _ = registered
    template, (one, *_), _ = read_registrations(shapes / "registered")
    monkeypatch.setattr("unbend.collection.read_registrations", lambda _: (template, [one] * 3, []))
    done = run("mean", "here", "-o", tmp_path / "out", "--min-confidence", 0)
    assert done.exit_code == 0, done.output
    lines = [line.split(maxsplit=1) for line in done.stdout.splitlines()]
    assert lines[1] == ["components", "none: the shapes do not differ"]
    assert (tmp_path / "out" / "variances.csv").read_text() == "component,variance,share\n"
