"""What the benchmark of poses that share their vertices draws, measures and prints."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from unbend import write_mesh
from unbend.datasets import make_quadruped

FOLDER = Path(__file__).parents[1] / "benchmarks"
pytestmark = pytest.mark.skipif(
    not FOLDER.exists(), reason="the benchmarks are not part of a release"
)


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(FOLDER))
    script = import_module("sequences")
    monkeypatch.setattr(script, "_MOST", 1000)
    monkeypatch.setattr(script, "_LEFT", (700, 900))
    return script


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "beast").mkdir()
    for pose in ("standing", "walking"):
        mesh = make_quadruped(pose, n_vertices=1500).mesh
        write_mesh(tmp_path / "beast" / f"{pose}.obj", mesh)
    (tmp_path / "beast" / "notes.txt").write_text("not a pose")
    return tmp_path / "beast"


def test_a_pose_is_simplified_and_knows_where_its_vertices_were(script, folder):
    mesh, origin, image = script.draw_pose(folder / "standing.obj", np.random.default_rng(0))
    assert 650 < mesh.n_vertices < 950
    assert len(origin) == mesh.n_vertices
    assert len(image) == 1500
    # A vertex is what is nearest to its origin, but for a few that two of them share.
    assert (image[origin] == np.arange(len(origin))).mean() > 0.9


def test_two_poses_of_one_body_are_right(script, folder, capsys):
    row = script.run_one(folder, 0, 0)
    assert {row["source"], row["target"]} == {"standing.obj", "walking.obj"}
    assert row["error"] < 0.05
    assert row["overlap"] == 1
    script.print_table([row, row | {"shape": "other", "error": 0.5, "confidence": 0.95}])
    printed = capsys.readouterr().out
    assert "1 of 1" in printed.splitlines()[2]
    assert f"wrong: other {row['source']} to {row['target']}, error 0.500" in printed
