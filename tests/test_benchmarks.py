"""The benchmarks run; what they find is their own affair."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[1] / "benchmarks" / "engine.py"


@pytest.mark.skipif(not SCRIPT.exists(), reason="the benchmarks are not part of a release")
def test_the_benchmarks_run_and_both_sides_agree(tmp_path):
    command = [sys.executable, str(SCRIPT), "--quick", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "README.md").read_text()
    assert done.stdout.strip() in page
    assert "wrong against" not in page
    assert (tmp_path / "engine.png").stat().st_size > 1000
