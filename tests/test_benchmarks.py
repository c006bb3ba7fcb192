"""The benchmarks run; what they find is their own affair."""

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
