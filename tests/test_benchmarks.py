"""The benchmarks run; what they find is their own affair."""

import json
import sys
from importlib import import_module
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks"

pytestmark = pytest.mark.skipif(
    not FOLDER.exists(), reason="the benchmarks are not part of a release"
)


@pytest.fixture
def run(monkeypatch, capsys):
    """Run a script in this process; return what it printed and what it told on stderr."""
    monkeypatch.syspath_prepend(str(FOLDER))

    def run(name, *options):
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *map(str, options)])
        import_module(name).main()
        return capsys.readouterr()

    return run


def test_the_benchmarks_run_and_both_sides_agree(run, tmp_path):
    printed, _ = run("engine", "--quick", "--out", tmp_path)
    page = (tmp_path / "README.md").read_text()
    assert printed.strip() in page
    assert "wrong against" not in page
    assert (tmp_path / "engine.png").stat().st_size > 1000


@pytest.mark.skipif(sys.platform != "linux", reason="reads memory where Linux shows it")
def test_solvers_are_measured_and_count_alike(run):
    names = ("multifrontal", "superlu")
    printed, _ = run("solvers", "--sizes", 2400, "--repeats", 1, "--solvers", *names)
    rows = [row.split(" | ") for row in printed.splitlines()]
    counted = {row[0].strip("| "): row[7] for row in rows if len(row) > 7}
    assert counted["multifrontal"] == counted["superlu"]
    assert 90 < int(counted["multifrontal"]) < 110  # Weyl: about 100


def test_a_set_is_matched_once_and_its_rows_are_kept(run, tmp_path):
    rows = tmp_path / "rows.jsonl"
    given = ("match", "poses-1000", "--pairs", 1, "--barycentric", "--out", rows)
    printed, _ = run(*given)
    row = json.loads(rows.read_text())
    assert 0 <= row["confidence"] <= row["confidence_bound"] <= 1
    by_vertices, on_faces, _ = row["straight"]
    assert on_faces < by_vertices
    with rows.open("a") as file:
        file.write('{"set": "poses", "pa')  # an interrupted run's
    again, told = run(*given)
    assert again == printed
    assert "1 of 1" not in told  # nothing was matched


def test_a_set_that_does_not_exist_is_refused_with_the_names_of_all(run, capsys):
    with pytest.raises(SystemExit, match="2"):
        run("match", "pose")
    assert "'poses'" in capsys.readouterr().err
