"""The match page holds what it shows, asks no network, and lets no name become HTML."""

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from unbend import Match, Mesh, evaluate, match
from unbend.datasets import make_biped
from unbend.errors import FileError, InputError
from unbend.matching import Hypothesis
from unbend.report import match_page
from unbend.report.pages import _match_page
from unbend.report.pages._match_page import _errors_of_vertices, _standing_alike
from unbend.report.pages._shown import show

EVIL = "<script>alert('x')</script>&\"</title>"


def data_of(html: str) -> dict:
    (found,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', html)
    return json.loads(found)


@pytest.fixture(scope="module")
def found(blob: Mesh) -> Match:
    tried = (Hypothesis(0.2, 0.9), Hypothesis(0.3, -0.8, 0.25))
    one = replace(match(blob, blob, refine=False), alternatives=(), hypotheses=tried)
    return replace(one, confidence=0.75)


def test_a_page_is_of_one_file_that_asks_no_network_and_no_name_is_html(
    blob: Mesh, tmp_path: Path
) -> None:
    page = tmp_path / "match.html"
    mesh = Mesh(blob.vertices, blob.faces, name=EVIL, notes=(EVIL,))
    command = f"unbend match '{EVIL}'"
    html = match_page(mesh, mesh, np.arange(642), page, command=command).html
    assert page.read_text(encoding="utf-8") == html
    assert match_page(mesh, mesh, np.arange(642), command=command).html == html
    assert "<script>alert" not in html
    assert html.count("</title>") == 1
    assert html.count("&lt;script&gt;alert") >= 5
    assert "default-src 'none'" in html
    assert not re.search(r"(src|href)\s*=|url\(|https?://", html)


def test_a_page_shows_itself_and_can_be_written_later(blob: Mesh, tmp_path: Path) -> None:
    page = match_page(blob, blob, np.arange(642))
    assert repr(page) == "Page('blob to blob', 0.1 MB)"
    page.write(tmp_path / "later.html")
    assert (tmp_path / "later.html").read_text("utf-8") == page.html
    (shown,) = re.findall(r'^<iframe [^>]* srcdoc="([^"]*)"></iframe>$', page._repr_html_())
    assert unescape(shown) == page.html
    with pytest.raises(FileError, match=r"\.html"):
        page.write(tmp_path / "page.txt")
    with pytest.raises(FileError, match=r"\.html"):
        match_page(blob, blob, np.arange(642), tmp_path / "match.pdf")


def test_the_page_tells_of_the_match_and_its_errors(blob: Mesh, found: Match) -> None:
    every = np.arange(642)
    truth = every[::2], every[::2]
    html = match_page(blob, blob, found, truth=truth, command="unbend match a b").html
    assert re.sub("<.*?>", "", re.findall("<h1>.*</h1>", html)[0]) == f"{blob.name} → {blob.name}"
    assert "642 vertices matched to a shape of 642; confidence 0.75." in html
    assert "mean error" in html
    assert "points counted</th><td>321" in html
    assert "unbend match a b" in html
    assert "<tr><td>2</td><td>30.00%</td><td>+10.00%</td><td>25.0%</td><td>10%</td></tr>" in html
    assert data_of(html)["maps"][0]["errors"] is not None
    assert data_of(html)["maps"][0]["expected"] is not None
    assert "by expected error" in html
    assert "expected error" not in match_page(blob, blob, replace(found, expected_error=None)).html


def test_the_page_of_a_symmetry_names_it_and_shows_the_shape_as_it_is(found: Match) -> None:
    # Closest to its mirror image among all rotated copies of a wide body is one turned about.
    body = make_biped("standing", n_vertices=600)
    wide = Mesh(body.mesh.vertices * [3, 1, 1], body.mesh.faces, name="body")
    turned = replace(
        found,
        **{"source_to_target": body.mirror, "target_to_source": body.mirror},
        **{"orientation": -1.0, "expected_error": None},
    )
    page = match_page(wide, wide, turned)
    assert page.title == "Left and right of body"
    assert "<h1>Left and right of body</h1>" in page.html
    assert "600 vertices have a mirror partner; confidence 0.75." in page.html
    assert "mirror partners, same colour" in page.html
    for meaningless in ("right side out", "Right side out", 'id="morph"', "for display"):
        assert meaningless not in page.html
    first, second = data_of(page.html)["sides"]
    assert first == second
    doubtful = match_page(wide, wide, replace(turned, confidence=0.3)).html
    assert "This symmetry is doubtful: its confidence is 0.30." in doubtful
    other = Mesh(wide.vertices, wide.faces, name="other")
    html = match_page(wide, other, turned).html
    assert "right side out</th><td>0% of the surface" in html
    assert 'id="morph"' in html


def test_errors_against_the_mirror_image_and_of_missing_partners_are_told(blob: Mesh) -> None:
    every = np.arange(642)
    html = match_page(blob, blob, every, truth=(every, every, every)).html
    assert "mean, reflection allowed (dashed)</th><td>0.0000" in html
    assert "partners found that exist" not in html
    html = match_page(blob, blob, every, truth=(every, np.where(every < 9, -1, every))).html
    assert "share of existing partners found</th><td>100.0%" in html
    assert "reflection allowed" not in html


def test_each_map_is_evaluated_once(
    blob: Mesh, found: Match, monkeypatch: pytest.MonkeyPatch
) -> None:
    every, seen = np.arange(642), []
    monkeypatch.setattr(
        _match_page, "evaluate", lambda *given: seen.append(given[0]) or evaluate(*given)
    )
    mirrored = replace(found, mirrored=every)
    html = match_page(blob, blob, mirrored, truth=(every, every)).html
    assert "<p>Map 1: 642 vertices matched" in re.sub(" class=[^>]*", "", html)
    assert seen == [mirrored, every]


def test_what_is_told_of_the_first_of_several_maps_says_so(blob: Mesh, found: Match) -> None:
    every = np.arange(642)
    other = replace(found, source_to_target=np.where(every < 9, -1, every), missed_landmarks=(0,))
    several = replace(found, alternatives=(other,), missed_landmarks=(1,))
    rows = {"nose": (20, 20), "tail": (40, 40)}
    html = match_page(blob, blob, several, landmarks=rows, truth=(every[:9], every[:9])).html
    one, two = data_of(html)["maps"]
    assert (one["ignored"], two["ignored"]) == ([1], [0])
    assert one["errors"] is not None
    assert two["errors"] is None  # none of these rows has a partner
    assert "<h2>Errors of map 1</h2>" in html
    assert "landmarks ignored of map 1</th><td>tail" in html
    assert "of map 1" not in match_page(blob, blob, found, truth=(every, every)).html
    with pytest.raises(InputError, match="landmarks must be all those that match was given"):
        match_page(blob, blob, several, landmarks={"nose": (20, 20)})


def test_rows_without_a_mirrored_truth_have_errors(blob: Mesh) -> None:
    every = np.arange(642)
    truth = every, every, np.where(every % 2 == 0, -1, every)
    images = np.roll(every, 1)
    errors = _errors_of_vertices(blob, images, truth, evaluate(images, blob, *truth).direct)
    expected = evaluate(images, blob, every, every).direct
    np.testing.assert_allclose(errors, np.minimum(expected, 1))
    # A seam is one place, whichever of its vertices is in the truth.
    corners = blob.faces.ravel()
    soup = Mesh(blob.vertices[corners], np.arange(len(corners)).reshape(-1, 3))
    last = np.full(blob.n_vertices, 0)
    last[corners] = np.arange(len(corners))
    truth = last[truth[0]], truth[1]
    direct = evaluate(images[corners], blob, *truth).direct
    at_seams = _errors_of_vertices(soup, images[corners], truth, direct)
    np.testing.assert_allclose(at_seams, errors[corners])


def test_several_maps_can_be_chosen_from(blob: Mesh, found: Match) -> None:
    one = replace(found, confidence=np.nan)
    worse = replace(one, confidence_bound=0.5)  # of which the page does not warn
    two = replace(one, confidence=0.6, alternatives=(worse,), mirrored=np.arange(642))
    html = match_page(blob, blob, two).html
    assert len(data_of(html)["maps"]) == 3
    for i, name in enumerate(("1, confidence 0.60", "2", "reflection")):
        assert f'<option value="{i}">{name}</option>' in html
    assert 'id="map"' not in match_page(blob, blob, one).html


@pytest.mark.parametrize(("confidence", "doubtful"), [(0.21, True), (0.6, False), (np.nan, False)])
def test_a_doubtful_match_has_a_warning_above_it(
    blob: Mesh, found: Match, confidence: float, doubtful: bool
) -> None:
    one = replace(found, confidence=confidence)
    html = match_page(blob, blob, one).html
    assert ('<p class="band"' in html) == doubtful
    if doubtful:
        assert "its confidence is 0.21" in html
        assert "place one to three landmarks, as with unbend view, and match again" in html
        assert "menu Map" in match_page(blob, blob, replace(one, alternatives=(one,))).html
        assert "menu Map" not in html
        assert "each landmark" not in html
        assert "each landmark" in match_page(blob, blob, one, landmarks=[[0, 7]]).html
        other_side = match_page(blob, blob, replace(one, mirror_fits=True)).html
        assert "because the mirror image of the target fits better" in other_side
        assert "landmarks, as with unbend view" not in other_side


def test_few_partners_leave_no_morph(blob: Mesh) -> None:
    nowhere = np.full(642, -1)
    nowhere[3] = 5
    html = match_page(blob, blob, nowhere).html
    assert data_of(html)["maps"][0]["frames"] == []
    assert 'id="morph"' not in html
    assert "1 of 642 vertices matched" in html


def test_large_shapes_are_thinned_for_the_eye_alone(blob: Mesh) -> None:
    loose = np.vstack([[[np.nan] * 3], blob.vertices])
    mesh = Mesh(loose, blob.faces + 1)
    shown = show(mesh, 200)
    assert len(shown.ids) == 200
    assert shown.ids.min() > 0
    assert shown.faces.max() == 199
    assert shown.stand_ins[0] == -1
    np.testing.assert_array_equal(shown.stand_ins[shown.ids], np.arange(200))
    # What stands for a vertex is near it.
    away = mesh.vertices[1:] - mesh.vertices[shown.ids[shown.stand_ins[1:]]]
    assert np.linalg.norm(away, axis=1).max() < 0.5
    assert shown.facts == [
        "1 vertex, used by no face, not shown",
        "200 of 642 vertices are drawn; all are computed on",
    ]
    assert len(show(mesh).ids) == 642
    assert len(show(Mesh(5e6 + loose, mesh.faces), 200).ids) == 200


def test_a_part_is_as_large_as_what_it_matches(blob: Mesh) -> None:
    half = blob.faces[(blob.vertices[blob.faces][:, :, 0] < 0.3).all(axis=1)]
    used = np.isin(np.arange(642), half)
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    part = Mesh(30 * blob.vertices @ turn.T, half)
    carried = np.where(used[:, None], blob.vertices, np.nan)
    stands = _standing_alike(part, blob, carried, used)
    apart = np.linalg.norm((stands.vertices - blob.vertices)[used], axis=1)
    assert apart.max() < 0.1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"up": "w"}, "up must be"),
        ({"match": np.arange(3)}, "the map has 3"),
        ({"truth": (np.arange(3), np.arange(4))}, "3 source and 4 target"),
        ({"landmarks": [(0, 642)]}, "landmark 642 is no vertex"),
    ],
)
def test_what_does_not_fit_is_refused(
    blob: Mesh, tmp_path: Path, change: dict, message: str
) -> None:
    given = {"source": blob, "target": blob, "match": np.arange(642), **change}
    with pytest.raises(InputError, match=message):
        match_page(path=tmp_path / "match.html", **given)
    assert not list(tmp_path.iterdir())


def test_a_point_of_a_cloud_shows_its_partner(blob: Mesh) -> None:
    cloud = Mesh(blob.vertices @ np.diag([1, -1, -1]), name="cloud")
    html = match_page(cloud, blob, np.arange(642)).html
    for links in data_of(html)["maps"][0]["links"]:
        assert links["standIns"] is None  # every partner is drawn
    assert "a point cloud, drawn with triangles" in html
