"""The benchmarks run; what they find is their own affair."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks"

pytestmark = pytest.mark.skipif(
    not FOLDER.exists(), reason="the benchmarks are not part of a release"
)


def run(script, *options):
    command = [sys.executable, str(FOLDER / script), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_benchmarks_run_and_both_sides_agree(tmp_path):
    done = run("engine.py", "--quick", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "README.md").read_text()
    assert done.stdout.strip() in page
    assert "wrong against" not in page
    assert (tmp_path / "engine.png").stat().st_size > 1000


@pytest.mark.skipif(sys.platform != "linux", reason="reads memory where Linux shows it")
def test_solvers_are_measured_and_count_alike():
    names = ("multifrontal", "superlu")
    done = run("solvers.py", "--sizes", "2400", "--repeats", "1", "--solvers", *names)
    assert done.returncode == 0, done.stderr
    rows = [row.split(" | ") for row in done.stdout.splitlines()]
    counted = {row[0].strip("| "): row[7] for row in rows if len(row) > 7}
    assert counted["multifrontal"] == counted["superlu"]
    assert 90 < int(counted["multifrontal"]) < 110  # Weyl: about 100


def test_a_set_is_matched_once_and_its_rows_are_kept(tmp_path):
    rows = tmp_path / "rows.jsonl"
    command = ["match.py", "poses-1000", "--pairs", "1", "--barycentric", "--out", str(rows)]
    done = run(*command)
    assert done.returncode == 0, done.stderr
    row = json.loads(rows.read_text())
    assert 0 <= row["confidence"] <= row["confidence_bound"] <= 1
    by_vertices, on_faces, _ = row["straight"]
    assert on_faces < by_vertices
    with rows.open("a") as file:
        file.write('{"set": "poses", "pa')  # an interrupted run's
    again = run(*command)
    assert (again.returncode, again.stdout) == (0, done.stdout), again.stderr
    assert "1 of 1" not in again.stderr  # nothing was matched


def test_a_set_that_does_not_exist_is_refused_with_the_names_of_all():
    done = run("match.py", "pose")
    assert done.returncode == 2
    assert "'poses'" in done.stderr
