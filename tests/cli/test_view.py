"""``unbend view`` as a command: the landmarks of one mesh."""

import json
import re
from pathlib import Path

import numpy as np

from terminal import invoke
from unbend import write_mesh
from unbend.datasets import make_sphere


def test_points_without_labels_are_landmarks_of_one_mesh(tmp_path: Path) -> None:
    ball, points, page = (str(tmp_path / name) for name in ("ball.ply", "points.csv", "ball.html"))
    mesh = make_sphere(1)
    write_mesh(ball, mesh)
    np.savetxt(points, mesh.vertices[[3, 30]], delimiter=",")
    given = ["view", ball, "-o", page, "--no-open", "--landmarks", points]
    assert invoke(given).exit_code == 0
    html = Path(page).read_text(encoding="utf-8")
    (data,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html)
    assert [one["at"] for one in json.loads(data)["landmarks"]] == [[3], [30]]
    done = invoke([*given, "--landmarks", points])
    assert done.exit_code == 2
    assert "--landmarks of one mesh takes one file of points" in done.stderr
