import json

import numpy as np
import pytest

from terminal import invoke
from unbend import distance, write_mesh


@pytest.fixture
def mesh(blob, tmp_path):
    write_mesh(tmp_path / "blob.off", blob)
    return str(tmp_path / "blob.off")


@pytest.mark.parametrize("suffix", [".npy", ".csv", ".ply"])
def test_writes_one_column_per_source(mesh, blob, tmp_path, suffix):
    out = tmp_path / f"field{suffix}"
    options = ["--from", "12", "--from", "500", "--distance", "commute-time", "-o", str(out)]
    done = invoke(["distance", mesh, *options])
    assert done.exit_code == 0, done.output
    expected = distance(blob, [12, 500], distance="commute-time").T
    if suffix == ".ply":
        import trimesh

        data = trimesh.load(out, process=False).metadata["_ply_raw"]["vertex"]["data"]
        found = np.stack([data["distance_12"], data["distance_500"]], axis=1).reshape(-1, 2)
    elif suffix == ".npy":
        found = np.load(out)
    else:
        assert out.read_text().splitlines()[0] == "distance_12,distance_500"
        found = np.loadtxt(out, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(found, expected)


def test_the_page_says_which_distance_it_shows(mesh, tmp_path):
    page = tmp_path / "page.html"
    options = ["--from", "12", "--distance", "biharmonic", "--report", str(page)]
    assert invoke(["distance", mesh, *options]).exit_code == 0
    html = page.read_text("utf-8")
    assert "by biharmonic distance</option>" in html
    assert " From vertex 12.</p>" in html
    assert invoke(["distance", mesh, *options, "--from", "40"]).exit_code == 0
    assert " From the nearest of the vertices 12, 40.</p>" in page.read_text("utf-8")


def test_prints_the_farthest_vertex(mesh, blob):
    field = distance(blob, 7, distance="geodesic")[0]
    arguments = ["distance", mesh, "--from", "7"]
    done = invoke(arguments)
    assert f"farthest is vertex {field.argmax()}, at {field.max():.5g}" in done.stdout
    found = json.loads(invoke([*arguments, "--json"]).stdout)
    assert found["sources"][0]["farthest"] == field.argmax()
    assert found["sources"][0]["distance"] == pytest.approx(field.max())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--from", "642"], "there is no vertex 642"),
        (["--from", "3", "--from", "7", "--from", "03"], "--from 3 is given twice; leave one out"),
        (["--from", "0", "-o", "field.obj"], "use .ply, .vtp, .npy or .csv"),
        (["--from", "0", "--distance", "diffusion", "--time", "-1"], "time must be positive"),
    ],
)
def test_mistakes_get_one_sentence(mesh, options, message):
    done = invoke(["distance", mesh, *options])
    assert done.exit_code == 2
    assert message in done.stderr
    assert done.stderr.count("\n") == 1


def test_draws_the_distance_to_the_nearest_source(mesh, tmp_path):
    done = invoke(["distance", mesh, "--from", "7", "--figure", str(tmp_path / "a.png")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "a.png").stat().st_size > 10_000


def test_what_is_no_vertex_number_is_called_so(mesh):
    done = invoke(["distance", mesh, "--from", "nose"])
    assert done.exit_code == 2
    assert "'nose' is no vertex number; vertices are counted from 0" in done.stderr
