"""Landmarks in a real browser: placed, moved, deleted, undone, saved and loaded, in every way."""

import json
from pathlib import Path

import numpy as np
import pytest

from browser import CONTEXTS, Browser, changed
from unbend import Mesh
from unbend.datasets import make_quadruped, make_sphere
from unbend.io import read_landmarks, read_markups, write_markups
from unbend.report import view
from unbend.report.pages import _view_page
from unbend.report.pages._shown import show

CTRL = {"modifiers": 2}
STATUS = "part('status').textContent"


@pytest.fixture(scope="module")
def dogs() -> tuple[Mesh, Mesh]:
    first, second = (make_quadruped(pose, n_vertices=900).mesh for pose in ("standing", "walking"))
    return Mesh(first.vertices, first.faces, name="a"), Mesh(
        second.vertices, second.faces, name="b"
    )


@pytest.fixture(scope="module")
def html(dogs, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "view.html"
    view(*dogs, path=path)
    return path


@pytest.fixture
def page(browser: Browser, html: Path, tmp_path: Path) -> Browser:
    browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    browser.open(html)
    return browser


def table(browser: Browser) -> list[list[int]]:
    """Vertices of each landmark, as the table shows them."""
    cells = "[...r.cells].slice(1, -1).map(c => c.textContent === '\u2013' ? -1 : +c.textContent)"
    return browser.run(f"[...part('landmarks').rows].map(r => {cells})")


def spot(browser: Browser, side: int, vertex: int) -> tuple[float, float]:
    """Where a vertex is on the screen; the page draws all vertices here."""
    canvas = f"part('shape-{side}')"
    browser.run(f"{canvas}.scrollIntoView({{block: 'center'}})")
    found = browser.run(
        f"(v => {{ const b = v.canvas.getBoundingClientRect(), p = v.projection()(...row("
        f"v.meshes[0].positions, {vertex})); return [b.left + p[0], b.top + p[1]] }})"
        f"({canvas}.view)"
    )
    return tuple(found)


def seen_from(side: int) -> str:
    """What tells how a shape is turned."""
    return f"part('shape-{side}').view.camera.matrix().join()"


def downloaded(browser: Browser, path: Path) -> str:
    for _ in range(400):
        if path.exists() and path.stat().st_size:
            return path.read_text("utf-8")
        browser.settle()
    raise AssertionError(f"{path.name} was not downloaded: {browser.run(STATUS)}")


def test_pairs_are_placed_dragged_deleted_and_undone_with_the_mouse(page, dogs) -> None:
    page.click(*page.middle("#shape-0", 0.0, 0.1))
    ((first, nothing),) = table(page)
    assert first >= 0
    assert nothing == -1
    page.click(*page.middle("#shape-1", 0.1, 0.1))
    page.click(*page.middle("#shape-1", -0.3, 0.1))
    placed = table(page)
    assert placed[0][0] == first
    assert min(placed[0]) >= 0
    assert placed[1][0] == -1
    # The same place on the shape is grasped, and the landmark follows the pointer.
    before = page.run(seen_from(1))
    page.drag(spot(page, 1, placed[0][1]), 40, 8)
    moved = table(page)
    assert moved[0][1] not in (placed[0][1], -1)
    assert moved[1] == placed[1]
    assert page.run(seen_from(1)) == before
    x, y = spot(page, 1, moved[0][1])
    page.mouse("mousePressed", x, y, button="left", clickCount=1)
    for right in (8, 0):
        page.mouse("mouseMoved", x + right, y, button="left", buttons=1)
    page.mouse("mouseReleased", x, y, button="left", clickCount=1)
    page.settle()
    assert page.run(STATUS) == f"Landmark 1 stays on b, vertex {moved[0][1]}."
    x, y = spot(page, 1, placed[0][1])
    there = spot(page, 1, moved[0][1])
    assert np.hypot(there[0] - x - 40, there[1] - y - 8) < 20
    page.click(*page.middle("#landmarks tr:first-child button"))
    assert table(page) == moved[1:]
    for expected in (moved, placed, placed[:1], [[first, -1]], [], []):
        page.press("z", **CTRL)
        assert table(page) == expected
    assert page.run(STATUS) == "There is nothing to undo."
    for expected in ([[first, -1]], placed[:1], placed, moved, moved[1:], moved[1:]):
        page.press("Z", modifiers=2 + 8)
        assert table(page) == expected
    assert page.run(STATUS) == "There is nothing to redo."


def test_only_single_clicks_of_the_first_button_place_landmarks(page) -> None:
    x, y = page.middle("#shape-0", 0.0, 0.1)
    for button in ("right", "middle"):
        for kind in ("mousePressed", "mouseReleased"):
            page.mouse(kind, x, y, button=button, clickCount=1)
    page.touch((x, y))
    page.settle()
    ((vertex, _),) = table(page)
    for kind in ("mousePressed", "mouseReleased") * 2:
        page.mouse(kind, x, y, button="left", clickCount=2)
    page.settle()
    assert table(page) == [[vertex, -1]]


def test_two_fingers_place_nothing(page) -> None:
    x, y = page.middle("#shape-0", 0.0, 0.1)
    fingers = [{"x": x - 20, "y": y}, {"x": x + 20, "y": y}]
    for kind, points in (("Start", fingers[:1]), ("Start", fingers), ("End", fingers[:1])):
        page.call("Input.dispatchTouchEvent", type=f"touch{kind}", touchPoints=points)
    page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    page.settle()
    assert table(page) == []


def test_everything_can_be_done_with_the_keyboard(page, tmp_path) -> None:
    def tab_to(name: str) -> None:
        for _ in range(40):
            page.press("Tab", windowsVirtualKeyCode=9)
            if page.run("document.activeElement.id") == name:
                return
        raise AssertionError(f"Tab does not reach {name}")

    for side in (0, 1):
        tab_to(f"shape-{side}")
        page.press("ArrowRight")  # the cursor appears
        seen = []
        for key in ("ArrowRight", "ArrowRight", "ArrowUp", "ArrowLeft"):
            page.press(key)
            seen.append(page.run(f"+part('vertex-{side}').value"))
        assert len(set(seen)) > 2
        page.press("Enter")
        assert table(page)[0][side] == seen[-1]
        page.press("ArrowDown")
        page.press("Enter")
    pairs = table(page)
    assert len(pairs) == 2
    page.press("n")
    page.press("ArrowUp")
    page.press("m")
    assert table(page) != pairs
    page.press("z", **CTRL)
    page.press("n")
    page.press("Delete")
    assert len(table(page)) == 1
    page.press("z", **CTRL)
    assert table(page) == pairs
    page.press("s", **CTRL)
    downloaded(page, tmp_path / "landmarks.csv")
    np.testing.assert_array_equal(read_landmarks(tmp_path / "landmarks.csv"), pairs)
    page.run("part('landmarks').querySelector('button').focus()")
    page.press("Enter", windowsVirtualKeyCode=13, text="\r")
    assert table(page) == pairs[1:]
    assert page.run("document.activeElement.id") == "undo"


@pytest.mark.parametrize("key", ["Enter", "ArrowUp"])
def test_the_cursor_appears_where_the_middle_is_empty(
    browser: Browser, tmp_path: Path, key: str
) -> None:
    ball = make_sphere(2)
    away = np.array([4, 0, 0])
    apart = np.concatenate([ball.vertices, ball.vertices + away])
    faces = np.concatenate([ball.faces, ball.faces + ball.n_vertices])
    view(Mesh(apart, faces), path=tmp_path / "apart.html")
    browser.open(tmp_path / "apart.html")
    browser.run("part('shape-0').focus()")
    browser.press(key)
    browser.press("Enter")
    ((vertex,),) = table(browser)
    assert abs(apart[vertex, 0] - 2) < 1.5


def test_arrow_keys_go_around_the_shape(page) -> None:
    """Where the surface ends on the screen, the shape turns: every side can be reached."""
    page.run("part('shape-0').focus()")
    page.press("ArrowRight")
    sides = set()
    for _ in range(60):
        page.press("ArrowRight")
        normal = page.run(
            "(v => row(v.meshes[0].normals, v.marks[0].vertex))(part('shape-0').view)"
        )
        sides.add(tuple(np.sign(np.round(normal, 1)[[0, 2]])))
        if {(1, 1), (-1, -1)} <= sides or {(1, -1), (-1, 1)} <= sides:
            return
    pytest.fail(f"these sides alone were reached: {sides}")


def test_a_finger_places_turns_and_drags(page) -> None:
    page.call("Emulation.setTouchEmulationEnabled", enabled=True)
    try:
        x, y = page.middle("#shape-0", 0.0, 0.1)
        page.touch((x, y), (x + 3, y + 2))
        ((vertex, _),) = table(page)
        assert vertex >= 0
        before = page.run(seen_from(0))
        x, y = spot(page, 0, vertex)
        page.touch((x + 8, y), (x + 30, y), (x + 40, y + 4))
        ((moved, _),) = table(page)
        assert moved not in (vertex, -1)
        assert page.run(seen_from(0)) == before
        x, y = page.middle("#shape-0", 0.9, 0.9)
        page.touch((x, y), (x - 60, y), (x - 90, y))
        assert page.run(seen_from(0)) != before
        assert table(page) == [[moved, -1]]
        # Two fingers shift what they hold: a shape that is zoomed in is reached everywhere.
        for kind, up in (("touchStart", 0), ("touchMove", 40)):
            fingers = [{"x": x - 80 * i, "y": y - up, "id": i} for i in range(2)]
            page.call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)
        page.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        page.settle()
        shift, zoom = page.run("[View.all[0].camera.y, View.all[0].camera.zoom]")
        assert shift == pytest.approx(2 * 40 / page.run("part('shape-0').clientHeight"), rel=0.05)
        assert zoom == pytest.approx(1, rel=0.05)
    finally:
        page.call("Emulation.setTouchEmulationEnabled", enabled=False)


def test_the_page_fits_a_telephone(page, screenshots) -> None:
    page.resize(278, mobile=True)  # a frame in a window of 320
    page.click(*page.middle("#shape-0", 0.0, 0.1))
    wide = page.run("document.documentElement.scrollWidth")
    tall = page.run("part('landmarks').querySelector('button').clientHeight")
    page.picture(save=screenshots / "view-narrow.png")
    page.resize()
    assert wide == 278
    assert tall == page.run("part('landmarks').querySelector('button').clientHeight")


def test_a_page_of_pictures_scrolls_under_a_finger(browser, dogs, tmp_path) -> None:
    from unbend.report import search_page

    search_page(dogs[0], [dogs[1]] * 3, [0.1, 0.2, 0.3], tmp_path / "found.html")
    browser.open(tmp_path / "found.html")
    action = "getComputedStyle(document.querySelector('{}')).touchAction"
    assert browser.run(action.format(".card canvas")) == "auto"
    assert browser.run(action.format("figure canvas")) == "none"


def test_saved_landmarks_are_loaded_again(page, dogs, tmp_path) -> None:
    rows = [[12, 40], [345, 7], [899, 0]]
    pairs = tmp_path / "pairs.csv"
    pairs.write_text("source,target\n" + "".join(f"{i},{j}\n" for i, j in rows), "utf-8")
    page.choose_file("#load", pairs)
    page.wait_for("part('landmarks').rows.length === 3")
    assert table(page) == rows
    for side, mesh in enumerate(dogs):
        page.click(*page.middle(f"#markups-{side}"))
        saved = json.loads(downloaded(page, tmp_path / f"{mesh.name}.mrk.json"))
        (markup,) = saved["markups"]
        assert saved["@schema"].endswith("markups-schema-v1.0.3.json#")
        assert (markup["type"], markup["coordinateSystem"]) == ("Fiducial", "LPS")
        points = markup["controlPoints"]
        assert [one["label"] for one in points] == ["1", "2", "3"]
        assert [one["description"] for one in points] == [f"vertex {row[side]}" for row in rows]
        size = np.ptp(mesh.vertices, axis=0).max()
        there = np.array([one["position"] for one in points])
        expected = mesh.vertices[[row[side] for row in rows]]
        np.testing.assert_allclose(there, expected, atol=2e-6 * size)
        _, vertices = read_markups(tmp_path / f"{mesh.name}.mrk.json", mesh)
        assert vertices.tolist() == [row[side] for row in rows]
        # Points that another program placed have no vertex, and perhaps the other axes.
        for one in points:
            one["position"] = (np.array(one["position"]) * (-1, -1, 1) + 1e-4 * size).tolist()
            one["description"] = ""
        markup["coordinateSystem"] = "RAS"
        (tmp_path / f"{mesh.name}.mrk.json").write_text(json.dumps(saved), "utf-8")
    while table(page):
        page.press("z", **CTRL)
    page.drop(*page.middle("#shape-1"), tmp_path / "b.mrk.json")
    page.wait_for("part('landmarks').rows.length === 3")
    page.choose_file("#load-0", tmp_path / "a.mrk.json")
    page.wait_for(f"{STATUS} === 'Loaded a.mrk.json.'")
    assert table(page) == rows


def test_tables_that_the_command_line_reads_are_read_alike(page, tmp_path) -> None:
    for i, text in enumerate(
        (
            '"source","target"\n12,40\n345,7\n',
            '"","source","target"\n"1",12,40\n"2",345,7\n',
            ",source,target\n0,12,40\n1,345,7\n",
            "target,source\n40,12\n7,345\n",
        )
    ):
        path = tmp_path / f"pairs{i}.csv"
        path.write_text(text, "utf-8")
        page.choose_file("#load", path)
        page.wait_for(f"{STATUS}.includes('{path.name}')")
        assert table(page) == read_landmarks(path).tolist() == [[12, 40], [345, 7]]
        page.press("z", **CTRL)
        assert table(page) == []


def test_files_that_do_not_fit_change_nothing(page, tmp_path) -> None:
    page.click(*page.middle("#shape-0", 0.0, 0.1))
    before = table(page)
    for text, told in (
        ("1,900\n", "vertex 900 is not on b, which has the vertices 0 to 899"),
        ("1,2\n3\n", "row 1 is 3; a landmark is two vertex numbers"),
        ("", "it holds no landmarks"),
        ("label,vertex\n1,2\n", "its columns are label,vertex; those of landmarks here are source"),
    ):
        (tmp_path / "bad.csv").write_text(text, "utf-8")
        page.choose_file("#load", tmp_path / "bad.csv")
        page.wait_for(f"{STATUS}.includes({told!r})")
        assert table(page) == before
    nowhere = {"description": "vertex 5", "position": None, "positionStatus": "missing"}
    for point, told in (
        ({"label": "nose", "position": [99, 0, 0]}, "point nose is far from a"),
        (nowhere, "no position"),
        ({"label": "nose"}, "no landmark file of 3D Slicer"),
        ({"label": "a", "position": [9, 9, 9], "description": "vertex 9"}, "point a is far from a"),
        ({"description": "vertex 900", "position": [0, 0, 0]}, "vertex 900 is not on a"),
    ):
        markups = {"markups": [{"controlPoints": [point]}]}
        (tmp_path / "bad.json").write_text(json.dumps(markups), "utf-8")
        page.drop(*page.middle("#shape-0"), tmp_path / "bad.json")
        page.wait_for(f"{STATUS}.includes({told!r})")
        assert table(page) == before


FCSV = '''# Markups fiducial file version = 4.6
# CoordinateSystem = 0
a,{0},{1},{z},0,0,0,1,1,1,0,"nose, ""tip""",vertex 12,
'''
PP = """<PickedPoints><point name="ear" active="0"/>
<point x="{x}" y="{y}" z="{z}" active="1" name="nose, &quot;tip&quot;"/>
</PickedPoints>"""


@pytest.mark.parametrize(("suffix", "text"), [("fcsv", FCSV), ("pp", PP)])
def test_points_of_older_slicers_and_of_meshlab_are_read_alike(
    page, dogs, tmp_path, suffix, text
) -> None:
    path, (x, y, z) = tmp_path / f"points.{suffix}", dogs[0].vertices[12].tolist()
    text = text.format(-x, -y, x=x, y=y, z=z)
    path.write_text(text, "utf-8")
    page.choose_file("#load-0", path)
    page.wait_for(f"{STATUS} === 'Loaded {path.name}.'")
    names = page.run("[...part('landmarks').querySelectorAll('input')].map(e => e.value)")
    assert read_markups(path, dogs[0])[0] == names == ['nose, "tip"']
    assert table(page) == [[12, -1]]
    for damaged, told in (
        (text[:-40], "no landmark file"),
        (text.replace(f"{z}", ""), "no position"),
    ):
        path.write_text(damaged, "utf-8")
        page.drop(*page.middle("#shape-0"), path)
        page.wait_for(f"{STATUS}.includes({told!r})")
        assert table(page) == [[12, -1]]
    assert [one for one in page.problems if "inline style" not in one] == []  # of its own note
    page.problems.clear()


def test_landmarks_of_one_shape_have_names(browser, dogs, tmp_path) -> None:
    browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    view(dogs[0], landmarks={"nose tip": 5, 'the "other"': 6}, path=tmp_path / "one.html")
    browser.open(tmp_path / "one.html")
    browser.click(*browser.middle("#shape-0", 0.0, 0.1))
    (_, _, (placed,)) = table(browser)
    browser.click(*browser.middle("#save"))
    text = downloaded(browser, tmp_path / "landmarks.csv")
    assert text == f'label,vertex\n"nose tip",5\n"the ""other""",6\n1,{placed}\n'
    browser.open(tmp_path / "one.html")
    browser.drop(*browser.middle("#shape-0"), tmp_path / "landmarks.csv")
    browser.wait_for("part('landmarks').rows.length === 3")
    names = browser.run("[...part('landmarks').querySelectorAll('input')].map(e => e.value)")
    assert names == ["nose tip", 'the "other"', "1"]
    assert table(browser) == [[5], [6], [placed]]


@pytest.fixture
def one(browser: Browser, dogs, tmp_path: Path) -> Browser:
    """The page of one shape with three landmarks."""
    browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    view(dogs[0], landmarks={"nose": 5, "ear": 6, "tail": 7}, path=tmp_path / "one.html")
    browser.open(tmp_path / "one.html")
    return browser


def test_what_has_been_replaced_is_selected_no_more(one, tmp_path) -> None:
    one.click(*one.middle("#shape-0", 0.0, 0.1))
    (tmp_path / "others.csv").write_text("label,vertex\nnose,15\near,16\n", "utf-8")
    one.choose_file("#load", tmp_path / "others.csv")
    one.wait_for("part('landmarks').rows.length === 2")
    one.run("part('shape-0').focus()")
    one.press("Delete")
    assert "No landmark is selected" in one.run(STATUS)
    assert table(one) == [[15], [16]]


def test_a_typed_name_counts_and_leaves_the_buttons_where_they_are(one, tmp_path) -> None:
    field = "part('landmarks').querySelector('input')"
    one.run(f"{field}.select()")
    for letter in "#one":
        one.press(letter, text=letter)
    one.press("s", **CTRL)
    assert downloaded(one, tmp_path / "landmarks.csv").splitlines()[1] == '"#one",5'
    assert one.run(f"document.activeElement === {field}")
    one.press("2", text="2")
    one.click(*one.middle("#landmarks tr:first-child button"))
    assert table(one) == [[6], [7]]
    one.choose_file("#load", tmp_path / "landmarks.csv")
    one.wait_for("part('landmarks').rows.length === 3")
    assert one.run(f"{field}.value") == "#one"


def test_python_reads_the_names_that_the_page_saves(browser, tmp_path) -> None:
    ball, path = make_sphere(2), tmp_path / "view.html"
    named = {"tip #1": 3, 'a "b", c': 9}
    view(ball, landmarks=named, path=path)
    browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    browser.open(path)
    browser.click(*browser.middle("#save"))
    downloaded(browser, tmp_path / "landmarks.csv")
    labels, vertices = read_markups(tmp_path / "landmarks.csv", ball)
    assert dict(zip(labels, vertices.tolist(), strict=True)) == named


def test_names_of_rows_are_not_those_of_landmarks(one, tmp_path) -> None:
    rows = '"","label","vertex"\n"1","nose, left",15\n"2","ear",16\n'
    (tmp_path / "named.csv").write_text(rows, "utf-8")
    one.choose_file("#load", tmp_path / "named.csv")
    one.wait_for("part('landmarks').rows.length === 2")
    names = one.run("[...part('landmarks').querySelectorAll('input')].map(e => e.value)")
    assert (names, table(one)) == (["nose, left", "ear"], [[15], [16]])


def test_pairs_and_fractions_are_no_landmarks_of_one_shape(one, tmp_path) -> None:
    for columns in ("source,target", "target,source"):
        (tmp_path / "pairs.csv").write_text(f"{columns}\n3,50\n", "utf-8")
        one.choose_file("#load", tmp_path / "pairs.csv")
        one.wait_for(f"{STATUS}.includes('its columns are {columns}')")
        assert table(one) == [[5], [6], [7]]
    one.run("part('vertex-0').value = 12.5")
    one.run("part('vertex-0').dispatchEvent(new Event('change'))")
    assert one.run("part('readout').textContent") == "that vertex is not shown"


def test_a_point_that_was_moved_counts_where_it_lies(one, dogs, tmp_path) -> None:
    write_markups(tmp_path / "a.mrk.json", dogs[0], [19, 20], ["nose", "ear"])
    saved = json.loads((tmp_path / "a.mrk.json").read_text("utf-8"))
    saved["markups"][0]["controlPoints"][0]["position"] = dogs[0].vertices[400].tolist()
    (tmp_path / "a.mrk.json").write_text(json.dumps(saved), "utf-8")
    one.choose_file("#load-0", tmp_path / "a.mrk.json")
    one.wait_for(f"{STATUS}.includes('taken where they lie: 1')")
    assert table(one) == [[400], [20]]


def test_far_from_the_origin_shapes_and_values_keep_their_detail(browser, dogs, tmp_path) -> None:
    browser.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    height = dogs[0].vertices[:, 1]
    there = Mesh(np.add(dogs[0].vertices, [5e5, 5.4e6, 100]), dogs[0].faces, name="far")
    view(dogs[0], values=height, path=tmp_path / "near.html")
    browser.open(tmp_path / "near.html")
    near = browser.picture("#shape-0")
    view(there, values=height + 1e7, landmarks=[12], path=tmp_path / "far.html")
    browser.open(tmp_path / "far.html")
    browser.run("part('landmarks').querySelector('button').click()")
    assert changed(near, browser.picture("#shape-0")) < 0.01
    browser.press("z", **CTRL)
    browser.click(*browser.middle("#markups-0"))
    (markup,) = json.loads(downloaded(browser, tmp_path / "far.mrk.json"))["markups"]
    size = np.ptp(there.vertices, axis=0).max()
    np.testing.assert_allclose(
        markup["controlPoints"][0]["position"], there.vertices[12], rtol=0, atol=2e-6 * size
    )
    text = browser.run("document.querySelector('.scale').parentElement.textContent")
    low, high = (float(one) for one in text.removeprefix("Value: ").removesuffix(".").split())
    np.testing.assert_allclose([low - 1e7, high - 1e7], [height.min(), height.max()], atol=1e-3)


def test_colours_are_those_of_the_legend(browser, dogs, tmp_path) -> None:
    """Whatever values have vertices that are not drawn."""
    loose = Mesh(np.vstack([dogs[0].vertices, [[9, 9, 9]] * 2]), dogs[0].faces, name="loose")
    values = np.append(np.arange(900.0), [1e4, np.inf])
    values[3] = -np.inf
    page = view(loose, values=values, path=tmp_path / "values.html")
    assert "value: 0 to 899" in page.html
    browser.open(tmp_path / "values.html")
    shares = browser.run("[...part('shape-0').view.meshes[0].value]")
    known = np.arange(900) != 3
    np.testing.assert_allclose(np.array(shares)[known], values[:900][known] / 899, atol=1e-5)
    assert browser.run("[...part('shape-0').view.meshes[0].known]") == known.tolist()


def test_thinned_shapes_have_the_numbers_of_the_files(
    browser, dogs, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_view_page, "show", lambda mesh: show(mesh, 300))
    shown = show(dogs[0], 300).ids
    (lost,) = np.setdiff1d(np.arange(900), shown)[:1]
    view(dogs[0], landmarks=[lost], path=tmp_path / "thin.html")
    browser.open(tmp_path / "thin.html")
    browser.click(*browser.middle("#shape-0", 0.0, 0.1))
    ((first,), (second,)) = table(browser)
    assert first == lost
    assert second in shown
    # What lies where it is described to lie is not moved, drawn or not.
    write_markups(tmp_path / "all.mrk.json", dogs[0], range(900), [f"p{i}" for i in range(900)])
    browser.choose_file("#load-0", tmp_path / "all.mrk.json")
    browser.wait_for(f"{STATUS} === 'Loaded all.mrk.json.'")
    assert table(browser) == [[i] for i in range(900)]


def test_what_does_nothing_cannot_be_pressed(page) -> None:
    faint = "['undo', 'grid'].map(id => part(id)).filter(e => e.matches(':disabled') &&"
    faint += " getComputedStyle(e.closest('label') || e).opacity < 1).map(e => e.id)"
    assert page.run(faint) == ["undo", "grid"]  # nothing is placed, and the colour is plain
    page.run("(s => { s.value = '0'; s.dispatchEvent(new Event('change')) })(part('paint'))")
    page.click(*page.middle("#shape-0"))
    assert page.run(faint) == []


def test_values_and_edges_are_drawn_and_told(browser, dogs, tmp_path, screenshots) -> None:
    values = dogs[0].vertices[:, 1].copy()
    values[:50] = np.nan
    view(dogs[0], values=values, path=tmp_path / "values.html")
    browser.open(tmp_path / "values.html")
    start = browser.picture("#shape-0", save=screenshots / "values.png")
    browser.click(*browser.middle("#shape-0", 0.0, 0.1))
    vertex = browser.run("+part('vertex-0').value")
    shown = f"{float(f'{values[vertex]:.5g}'):g}" if vertex >= 50 else "unknown"
    told = browser.run("part('readout').textContent")
    assert told.startswith(f"a: vertex {vertex} at (")
    assert f"value {shown[:5]}" in told
    browser.press("z", **CTRL)
    browser.run("part('wire').click()")
    browser.settle()
    assert changed(start, browser.picture("#shape-0", save=screenshots / "edges.png")) > 0.03
    height = dogs[0].vertices[:, 1]
    labels = np.where(height > np.median(height), 1000, 17)
    view(dogs[0], values=labels, path=tmp_path / "labels.html")
    browser.open(tmp_path / "labels.html")
    browser.picture("#shape-0", save=screenshots / "labels.png")
    browser.click(*browser.middle("#shape-0", 0.0, 0.1))
    vertex = browser.run("+part('vertex-0').value")
    assert browser.run("part('readout').textContent").endswith(f", value {labels[vertex]}")
    drawn = "View.all[0].meshes[0].place.map((share) => Math.round(255 * share))"
    colors = np.reshape(browser.run(f"Array.from({drawn})"), (-1, 3))
    assert np.unique(colors, axis=0).tolist() == [[0, 114, 178], [230, 159, 0]]


def test_a_picture_is_saved(page, tmp_path) -> None:
    import matplotlib.image

    width, height = page.run("[part('shape-0').width, part('shape-0').height]")
    page.click(*page.middle("#picture"))
    path = tmp_path / "a and b.png"
    page.wait_for("true")
    for _ in range(400):
        if path.exists() and path.stat().st_size:
            break
        page.settle()
    picture = matplotlib.image.imread(path)
    assert picture.shape == (2 * height, 4 * width, 4)
    opaque = picture[..., 3] > 0.99
    assert opaque[:, : 2 * width].mean() > 0.02
    assert opaque[:, 2 * width :].mean() > 0.02
    assert picture[0, 0, 3] == 0


def test_a_lost_context_is_replaced_by_another_or_a_sentence(page) -> None:
    before = page.picture("#shape-0")
    page.run("stage.gl.getExtension('WEBGL_lose_context').loseContext()")
    page.settle()
    assert changed(before, page.picture("#shape-0")) == 0
    page.drag(page.middle("#shape-0", 0.9, 0.9), 60, 0)
    assert changed(before, page.picture("#shape-0")) > 0.02
    page.run("part('reset').click(); document.activeElement.blur()")
    page.settle()
    assert changed(before, page.picture("#shape-0")) < 0.001
    # Without any other, one sentence is shown.
    page.run("stage.gl.getExtension('WEBGL_lose_context').loseContext()")
    page.run(
        "HTMLCanvasElement.prototype.getContext = (own => function (kind, more) {"
        " return kind === 'webgl2' ? null : own.call(this, kind, more) })"
        "(HTMLCanvasElement.prototype.getContext)"
    )
    page.drag(page.middle("#shape-0", 0.9, 0.9), 60, 0)
    assert "Reload" in page.run("part('trouble').textContent")
    assert page.run("!part('trouble').hidden")
    page.run("part('shape-0').style.width = '200px'")  # the picture stays in any size
    page.settle()
    page.run("part('shape-0').style.width = ''")
    page.settle()
    assert changed(before, page.picture("#shape-0")) < 0.01


def test_many_pages_in_one_notebook_stay_visible(browser, dogs, tmp_path, screenshots) -> None:
    cell = tmp_path / "notebook.html"
    frame = view(dogs[0], values=range(900))._repr_html_()
    ready = "<script>document.documentElement.dataset.ready = 'yes'</script>"
    cell.write_text(f"<!doctype html><body>{frame * (CONTEXTS + 2)}{ready}", encoding="utf-8")
    browser.open(cell)

    def settled(i: int, pictures: int) -> np.ndarray:
        """Picture of a frame as soon as so many in a row are the same and have colours."""
        browser.run(f"document.querySelectorAll('iframe')[{i}].scrollIntoView()")
        alike: list[np.ndarray] = []
        for _ in range(100):
            picture = browser.picture(f"iframe:nth-of-type({i + 1})")
            coloured = (np.ptp(picture, axis=2) > 0.1).mean() > 0.01
            same = not alike or changed(alike[-1], picture) == 0
            alike = [*(alike if same else []), picture] if coloured else []
            if len(alike) == pictures:
                return picture
        pytest.fail(f"frame {i} is blank or keeps changing")

    first = settled(0, 2)
    browser.picture(save=screenshots / "notebook.png")
    for i in range(1, CONTEXTS + 2):
        settled(i, 1)
    again = settled(0, 2)
    assert "Too many active WebGL contexts" in " ".join(browser.notes)
    assert changed(first, again) < 0.01
