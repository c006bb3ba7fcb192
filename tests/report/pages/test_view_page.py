"""The page of one or two meshes holds what it shows, and refuses what does not fit."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from terminal import invoke
from unbend import Mesh
from unbend.errors import FileError, InputError, MeshError
from unbend.io import _markups, write_markups, write_mesh
from unbend.report import view
from unbend.report.pages import _document


def test_large_meshes_are_thinned() -> None:
    n = 250
    x, y = np.meshgrid(np.arange(n), np.arange(n))
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [
            np.stack([first, first + 1, first + n], 1),
            np.stack([first + 1, first + n + 1, first + n], 1),
        ]
    )
    sheet = Mesh(np.stack([x.ravel(), y.ravel(), np.sin(x / 9).ravel()], 1), faces)
    assert re.search(r"60,000 of 62,500 vertices are drawn", view(sheet).html)


def test_a_point_cloud_is_drawn_with_triangles(blob: Mesh) -> None:
    page = view(Mesh(blob.vertices, name="cloud"), landmarks=np.arange(642))
    assert "a point cloud, drawn with triangles between its points" in page.html


def test_what_does_not_fit_is_refused(blob: Mesh, tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="too few for a surface"):
        view(Mesh(blob.vertices[:99]))
    with pytest.raises(InputError, match="up must be"):
        view(blob, up="w")
    for values, told in (
        (np.zeros(5), "one value for each of 642 vertices"),
        (np.zeros((642, 2)), "one value for each of 642 vertices"),
        (np.full(642, np.nan), "none of the values"),
        (["leg"] * 5, "one value for each of 642 vertices"),
    ):
        with pytest.raises(InputError, match=told):
            view(blob, values=values)
    loose = Mesh(np.vstack([blob.vertices, [[9, 9, 9]]]), blob.faces, name="loose")
    for wrong in ([(0, 642)], [(0, -1)], [(0, 700)]):
        with pytest.raises(InputError, match=rf"landmark {wrong[0][1]} .* loose, .* 643 vertices"):
            view(blob, loose, landmarks=wrong)
    for wrong in ([1, 2], [(1, 2, 3)], [(0.5, 1)]):
        with pytest.raises(InputError, match="pairs of vertices"):
            view(blob, blob, landmarks=wrong)
    with pytest.raises(InputError, match="must be vertices"):
        view(blob, landmarks=[(0, 1)])
    with pytest.raises(FileError, match=r"\.html"):
        view(blob, path=tmp_path / "page.txt")


def test_pages_read_landmarks_of_3d_slicer_as_python_does(blob: Mesh) -> None:
    html = view(blob).html
    for name in ("SCHEMA", "FARTHEST", "MOVED"):
        (value,) = re.findall(rf"^const {name} = (.*?);", html, re.MULTILINE)
        assert json.loads(value) == getattr(_markups, f"_{name}")


def test_constant_values_are_shown(blob: Mesh) -> None:
    assert "value: 3 to 3" in view(blob, values=np.full(642, 3.0)).html


def test_a_page_says_what_its_values_are(blob: Mesh) -> None:
    html = view(blob, values=np.arange(642.0), label="height <b>", note="Of 1 & 2.").html
    for told in ("height &lt;b&gt;: 0 to 641. Of 1 &amp; 2.</p>", "by height &lt;b&gt;<"):
        assert told in html
    assert 'Height &lt;b&gt;: 0 <span class="scale">' in html


def test_numbers_of_both_signs_have_a_scale_around_zero(blob: Mesh) -> None:
    change = np.linspace(-2, 5, 642)
    change[9] = np.nan
    html = view(blob, values=change, label="change").html
    assert "change: -2 to 5" in html
    assert 'Change: -5 <span class="scale signed"></span> 5.' in html
    assert 'class="scale signed"' not in view(blob, values=np.linspace(-0.2, 5, 642)).html


def test_whole_numbers_and_text_are_labels(blob: Mesh) -> None:
    parts = np.resize(["", "<leg>", "tail"], 642).astype(object)  # as pandas holds text
    html = view(blob, values=parts, label="part").html
    assert "part: 3 labels" in html
    legend = re.findall(r'fill="rgb(\(.*?\))"/></svg> (.*?)[,.]<?', html)
    assert legend == [
        ("(153, 153, 153)", "none"),
        ("(0, 114, 178)", "&lt;leg&gt;"),
        ("(230, 159, 0)", "tail"),
    ]
    html = view(blob, values=np.resize(np.arange(20), 642)).html
    assert "value: 20 labels" in html
    assert "</svg> 11, and 8 more." in html


def test_a_page_opens_in_a_browser(
    blob: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(_document.webbrowser, "open", opened.append)
    page = view(blob)
    assert page.open(tmp_path / "blob.html") == tmp_path / "blob.html"
    monkeypatch.setattr(_document.tempfile, "tempdir", str(tmp_path))
    elsewhere = page.open()
    assert elsewhere.parent == tmp_path
    assert opened == [(tmp_path / "blob.html").as_uri(), elsewhere.as_uri()]
    assert elsewhere.read_text("utf-8") == page.html


def test_the_command_writes_and_opens_a_page(
    blob: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(_document.webbrowser, "open", opened.append)
    monkeypatch.chdir(tmp_path)
    write_mesh("a.ply", blob)
    write_mesh("b.ply", blob)
    Path("pairs.csv").write_text("source,target\n3,4\n", "utf-8")
    np.save("values.npy", np.arange(642.0))
    arguments = ["view", "a.ply", "b.ply", "--landmarks", "pairs.csv", "--values", "values.npy"]
    result = invoke([*arguments, "-o", "page.html", "--no-open"])
    assert result.exit_code == 0
    assert "written: page.html" in result.stdout
    assert "unbend match a.ply b.ply --landmarks landmarks.csv" in result.stdout
    html = Path("page.html").read_text("utf-8")
    assert '"landmarks": [{"name": "1", "at": [3, 4]}]' in html
    assert "value: 0 to 641" in html
    assert not opened
    write_mesh("two.ply", blob, scalars={"heat": np.arange(642.0), "cold": np.arange(3.0, 645)})
    line = ["view", "a.ply", "--values", "two.ply", "-o", "page.html", "--no-open"]
    assert invoke([*line, "--property", "cold"]).exit_code == 0
    assert "cold: 3 to 644" in Path("page.html").read_text("utf-8")
    assert "name one of them with --property" in invoke(line).output
    assert invoke(["view", "a.ply", "--property", "cold"]).exit_code == 2
    assert invoke(["view", "a.ply", "-o", "one.html"]).exit_code == 0
    assert opened == [Path("one.html").resolve().as_uri()]
    write_markups("nose.mrk.json", blob, [7], ["nose"])
    result = invoke(["view", "a.ply", "--landmarks", "nose.mrk.json", "-o", "n.html"])
    assert '"landmarks": [{"name": "nose", "at": [7]}]' in Path("n.html").read_text("utf-8")
    write_markups("a.mrk.json", blob, [7, 5], ["2", "1"])
    write_markups("b.mrk.json", blob, [8, 9], ["1", "2"])
    hints = ["--landmarks", "a.mrk.json", "--landmarks", "b.mrk.json"]
    result = invoke(["view", "a.ply", "b.ply", *hints, "-o", "ab.html"])
    named = '"landmarks": [{"name": "2", "at": [7, 9]}, {"name": "1", "at": [5, 8]}]'
    assert named in Path("ab.html").read_text("utf-8")
    write_markups("twice.mrk.json", blob, [7, 8], ["nose", "nose"])
    for refused in ("pairs.csv", "twice.mrk.json"):
        result = invoke(["view", "a.ply", "--landmarks", refused, "-o", "refused.html"])
        assert result.exit_code == 2
        assert not Path("refused.html").exists()
    result = invoke(["view", "a.ply", "--no-open"])
    assert result.exit_code == 2
    assert "-o" in str(result.exception) + result.output
