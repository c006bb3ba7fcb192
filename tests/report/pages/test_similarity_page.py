"""Pages of many shapes hold what they show, stay small, and let no name become HTML."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from unbend import Mesh
from unbend.errors import FileError, InputError
from unbend.report import check_count, search_page, similarity_page
from unbend.report.pages import _similarity_page

EVIL = "<script>alert('x')</script>&\"</title>"
TABLE = np.array([[1.0, 0.8, 0.9], [0.8, 1.0, np.nan], [0.9, np.nan, 1.0]])


def data_of(html: str) -> dict:
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html)
    return json.loads(found)


@pytest.fixture
def three(blob: Mesh) -> list[Mesh]:
    names = ("first", EVIL, "third")
    return [Mesh(blob.vertices, blob.faces, name=name, notes=(name,)) for name in names]


@pytest.mark.parametrize("kind", ["all", "groups", "search"])
def test_a_name_is_never_html(three: list[Mesh], kind: str) -> None:
    command = f"unbend similarity '{EVIL}'"
    if kind == "search":
        html = search_page(three[1], three, [0, 1, np.inf], command=command).html
        assert "1. distance 0.0000" in html
        assert "3. distance unknown" in html
    else:
        groups = [0, 1, 0] if kind == "groups" else None
        html = similarity_page(three, TABLE, groups=groups, command=command).html
        assert ("Group 1: 1 shape<" in html) == (kind == "groups")
    assert "<script>alert" not in html
    assert html.count("</title>") == 1
    assert html.count("&lt;script&gt;alert") >= 5
    assert data_of(html)["shapes"][1]["name"] in (EVIL, "first")
    assert "default-src 'none'" in html
    assert not re.search(r"(src|href)\s*=|url\(|https?://", html)


def test_the_table_is_told_in_the_order_of_the_tree(three: list[Mesh], tmp_path: Path) -> None:
    page = similarity_page(three, TABLE, tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page.html
    assert page.title == "How alike 3 shapes are"
    order = data_of(page.html)["order"]
    assert sorted(order) == [0, 1, 2]
    assert abs(order.index(0) - order.index(2)) == 1  # the most alike
    assert "Similarity is 0.8000 to 0.9000 between different shapes." in page.html
    rows = re.findall(r"<tr><td>.*?</tr>", page.html)
    numbers = re.findall(r"<td>(\d\.\d{4}|unknown)</td>", rows[order.index(1)])
    want = TABLE[1, order]
    assert numbers == ["unknown" if np.isnan(one) else f"{one:.4f}" for one in want]


def test_a_table_of_which_nothing_is_known_or_that_is_too_large_to_read(
    three: list[Mesh], monkeypatch: pytest.MonkeyPatch
) -> None:
    unknown = np.where(np.eye(3), 1.0, np.nan)
    html = similarity_page(three, unknown).html
    assert "no pair is known" in html
    assert "As a table" in html
    monkeypatch.setattr(_similarity_page, "_MOST_TOLD", 2)
    assert "As a table" not in similarity_page(three, unknown).html


def test_many_shapes_are_thinned_together(
    three: list[Mesh], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = similarity_page(three, TABLE).html
    assert "all shapes are drawn as they are" in whole
    monkeypatch.setattr(_similarity_page, "_VERTICES_IN_ALL", 600)
    html = similarity_page(three, TABLE).html
    assert "3 of 3 shapes are drawn with 200 vertices; results were computed on all" in html
    assert "642 vertices, 1,280 faces" in data_of(html)["shapes"][0]["told"]
    assert len(json.dumps(data_of(html))) < 0.7 * len(json.dumps(data_of(whole)))


def test_what_has_no_faces_has_no_picture(blob: Mesh) -> None:
    data = data_of(search_page(blob, [blob.vertices, blob], [0.1, 0.2]).html)
    assert [one["drawn"] is None for one in data["shapes"]] == [False, True, False]


def test_there_is_room_for_so_many_shapes() -> None:
    check_count(300)
    with pytest.raises(InputError, match="300 shapes at most, not 1,301"):
        check_count(1301)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"values": TABLE[:2]}, r"\(3, 3\), not \(2, 3\)"),
        ({"values": TABLE - 1}, "not negative"),
        ({"values": np.triu(TABLE)}, "symmetric"),
        ({"measure": "size"}, "measure must be"),
        ({"groups": [0, 1]}, "3 whole numbers"),
        ({"up": "w"}, "up must be"),
    ],
)
def test_what_does_not_fit_is_refused(
    three: list[Mesh], tmp_path: Path, change: dict, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        similarity_page(three, **({"values": TABLE, "path": tmp_path / "a.html"} | change))
    assert not list(tmp_path.iterdir())


def test_shapes_may_come_one_by_one(three: list[Mesh]) -> None:
    values = np.eye(3)
    page = similarity_page(iter(three), values)
    assert page.html == similarity_page(three, values).html
    found = search_page(three[0], iter(three), values[0])
    assert found.html == search_page(three[0], three, values[0]).html


def test_a_search_needs_something_found(blob: Mesh, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="one at least"):
        search_page(blob, [], [])
    with pytest.raises(FileError, match=r"\.html"):
        search_page(blob, [blob], [0], tmp_path / "page.pdf")


def test_values_of_any_size_are_told(three: list[Mesh], tmp_path: Path) -> None:
    tiny = 1e-7 * np.array([[0, 4, 1], [4, 0, 2], [1, 2, 0]])
    page = similarity_page(three, tiny, measure="distance")
    assert "Distance is 1.000e-07 to 4.000e-07 between different shapes" in page.html
    assert 'distance 4.000e-07 <span class="scale viridis"></span> 0.0000' in page.html
    assert "2. score -0.2500" in search_page(three[0], three[1:], [1, -0.25], measure="score").html


def test_joined_seams_are_not_thinned(three: list[Mesh]) -> None:
    ball = three[0]
    soup = Mesh(ball.vertices[ball.faces.ravel()], np.arange(ball.faces.size).reshape(-1, 3))
    assert "all shapes are drawn as they are" in similarity_page([soup, ball], np.eye(2)).html
