"""The app in a real browser, through its buttons: from two dropped files to a saved map."""

import os
import re
import signal
from pathlib import Path

import numpy as np
import pytest

from browser import Browser, start_browser
from sheets import make_blob
from unbend import read_match, write_mesh
from unbend.datasets import make_quadruped

GOOD = "state.shapes.length === {} && state.shapes.every(({{state}}) => state !== 'reading')"


@pytest.fixture(scope="module")
def chromium(app, tmp_path_factory: pytest.TempPathFactory):
    browser = start_browser(tmp_path_factory.mktemp("browser"), app.origin)
    yield browser
    browser.close()


@pytest.fixture
def page(chromium: Browser, app, tmp_path: Path):
    """The app in an empty state, to whose page nothing bad happens during a test."""
    # Pages that are shown may still load what goes.
    chromium.run("document.querySelectorAll('iframe').forEach(one => one.remove())")
    for kind in ("jobs", "results", "shapes", "troubles"):
        for one in app.get("state")[kind]:
            app.send("DELETE", f"{kind}/{one['id']}")
    chromium.problems.clear()
    chromium.call("Page.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path))
    chromium.visit(app.address)
    yield chromium
    assert chromium.problems == []


@pytest.fixture(scope="module")
def dogs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder, paths = tmp_path_factory.mktemp("dogs"), []
    for pose in ("standing", "walking"):
        paths.append(folder / f"{pose}.ply")
        write_mesh(paths[-1], make_quadruped(pose, n_vertices=600).mesh)
    return paths


@pytest.fixture(scope="module")
def blobs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """What is matched sooner."""
    folder, blob = tmp_path_factory.mktemp("blobs"), make_blob(2)
    for name, height in (("small", 1), ("tall", 1.1)):
        write_mesh(folder / f"{name}.ply", (blob.vertices * [1, height, 1], blob.faces))
    return sorted(folder.iterdir())


def press(page: Browser, text: str) -> None:
    """Click a button that can be seen, by its text."""
    found = page.run(
        "((all, text) => { all.forEach(b => delete b.dataset.pressed);"
        " const b = all.find(b => b.textContent === text && !b.disabled && b.offsetParent);"
        " if (b) b.dataset.pressed = 'yes'; return !!b })"
        f"([...document.querySelectorAll('button')], {text!r})"
    )
    assert found, f"there is no button {text}"
    page.click(*page.middle("[data-pressed]"))


def frame_spot(page: Browser, right: float, down: float) -> tuple[float, float]:
    """Place within the frame, in shares of its width and in pixels from its top."""
    page.run("document.querySelector('iframe').scrollIntoView({block: 'start'})")
    left, top, width = page.run(
        "(b => [b.left, b.top, b.width])(document.querySelector('iframe').getBoundingClientRect())"
    )
    return left + right * width, top + down


def downloaded(path: Path, page: Browser) -> Path:
    for _ in range(600):
        if path.exists() and path.stat().st_size:
            return path
        page.settle()
    raise AssertionError(f"{path.name} was not saved")


def test_from_two_dropped_files_to_a_saved_map_with_hints(page, blobs, tmp_path, screenshots):
    page.drop(*page.middle("#drop"), *blobs)
    page.wait_for(GOOD.format(2))
    page.picture(save=screenshots / "app-shapes.png")
    press(page, "Place landmarks")
    page.wait_for("state.results.length === 1")
    assert page.run("part('results-head').getBoundingClientRect().top") < 100  # what is new is seen
    # The page in the frame draws when it can be seen; a click is a landmark once it has drawn.
    for side, right in ((0, 0.27), (1, 0.75)):
        placed = f"placed[shown]?.some(({{at}}) => at[{side}] >= 0)"
        for down in range(360, 520, 20):
            page.click(*frame_spot(page, right, down))
            if page.run(placed):
                break
        page.wait_for(placed)
    page.picture(save=screenshots / "app-landmarks.png")
    press(page, "Match with these")
    page.wait_for("state.results.length === 2")
    assert page.run("document.activeElement.id") == "results-head"
    frame_spot(page, 0, 0)
    page.picture(save=screenshots / "app-match.png")
    assert "The map is " in page.run("part('result').textContent")
    page.run(
        "[...document.querySelectorAll('a')].find(a => a.textContent.endsWith('.npz')).click()"
    )
    path = downloaded(tmp_path / "small-tall.npz", page)
    found = read_match(path, source=blobs[0], target=blobs[1])
    assert (found.source_to_target == np.arange(162)).mean() > 0.5
    # What a file is stands in one column with its name.
    rects = "[...document.querySelectorAll('.files li')].map(e => e.getClientRects().length)"
    for width in range(600, 1240, 80):
        page.resize(width)
        assert set(page.run(rects)) == {1}
    page.resize()
    commands = page.run("[...document.querySelectorAll('code')].map(c => c.textContent)")
    assert any("--landmarks landmarks.csv" in one for one in commands)
    press(page, "Morph")
    page.wait_for("state.results.length === 3")
    page.picture(save=screenshots / "app-morph.png")
    # After a reload all of it is there again.
    page.visit(page.run("location.href"))
    assert page.run("[state.shapes.length, state.results.length]") == [2, 3]
    assert page.run("document.querySelectorAll('#results button').length") == 3
    # A result offers nothing more when its shape is removed.
    page.run("document.querySelectorAll('#results button')[1].click()")
    page.wait_for("part('result').textContent.includes('Use this map')")
    page.run("document.querySelector('[aria-label=\"Remove small.ply\"]').click()")
    page.wait_for("part('result').textContent.includes('A shape of this result was removed')")
    assert "Use this map" not in page.run("part('result').textContent")
    # Opened again, it is a new shape, as the page says.
    page.choose_file("#choose", blobs[0])
    page.wait_for(GOOD.format(2))
    assert "open it and do the same again" in page.run("part('result').textContent")
    press(page, "Remove this result")
    page.wait_for("state.results.length === 2")
    assert page.run("document.activeElement.id") == "results-head"  # the button is gone


def test_a_bad_file_is_a_sentence_beside_good_ones(page, blobs, tmp_path, screenshots):
    (tmp_path / "<b>bad.off").write_text("OFF\n9000000 1 0\n0 0 0\n", "utf-8")
    page.choose_file("#choose", tmp_path / "<b>bad.off", blobs[0])
    page.wait_for(GOOD.format(2))
    told = page.run("part('shapes').textContent")
    assert "<b>bad.off" in told
    assert "9,000,000" in told
    assert page.run("part('shapes').querySelectorAll('.bad').length") == 1
    page.picture(save=screenshots / "app-bad-file.png")
    (tmp_path / "text.docx").write_text("x", "utf-8")
    page.run("scrollTo(0, document.body.scrollHeight)")
    page.choose_file("#choose", tmp_path / "text.docx")
    page.wait_for("part('troubles').textContent.includes('text.docx')")
    assert page.run("part('troubles').getBoundingClientRect().top") >= 0  # it is seen
    gone = "(g => { g.hidden = false; return [g.innerText, g.getBoundingClientRect().top] })"
    sentence, top = page.run(f"{gone}(part('gone'))")  # hidden again by the next look
    assert (sentence.count("\n"), top >= 0) == (0, True)
    press(page, "Close")
    (tmp_path / "scans.ply").mkdir()
    page.drop(*page.middle("#drop"), tmp_path / "scans.ply", blobs[1])
    page.wait_for(GOOD.format(3))
    assert "scans.ply cannot be read" in page.run("part('troubles').textContent")
    press(page, "Close")
    assert page.run("part('troubles').textContent") == ""
    assert [one for one in page.problems if "400" not in one] == []  # which the browser logs
    page.problems.clear()


def test_what_a_search_finds_is_opened(page, blobs):
    press(page, "Group the collection")
    page.wait_for("state.results.length === 1")
    assert page.run("document.querySelector('iframe').title") == "Groups of the collection"
    page.choose_file("#choose", blobs[1])
    page.wait_for(GOOD.format(1))
    press(page, "Search the collection")
    page.wait_for("state.results.length === 2")
    press(page, "dog-standing.ply")
    page.wait_for(GOOD.format(2))
    assert page.run("part('second').selectedOptions[0].textContent") == "dog-standing.ply"


def test_two_tabs_show_one_session(page, app, blobs):
    page.choose_file("#choose", *blobs)
    page.wait_for(GOOD.format(2))
    other = page.call("Target.createTarget", url=app.address)["targetId"]
    try:
        session = page.call("Target.attachToTarget", targetId=other, flatten=True)["sessionId"]
        page.switch(session)
        page.wait_for("typeof state !== 'undefined' && " + GOOD.format(2))
        press(page, "Canonical form (without its pose)")
        page.wait_for("state.results.length === 1")
    finally:
        page.switch(None)
        page.call("Target.closeTarget", targetId=other)
    page.wait_for("document.querySelectorAll('#results button').length === 1")


def test_what_stands_in_for_a_removed_shape_is_another_one(page, blobs):
    page.choose_file("#choose", *blobs)
    page.wait_for(GOOD.format(2))
    page.run("document.querySelector('[aria-label=\"Take tall.ply as the second\"]').click()")
    page.run("document.querySelector('[aria-label=\"Remove small.ply\"]').click()")
    page.wait_for(GOOD.format(1))
    page.choose_file("#choose", blobs[0])
    page.wait_for(GOOD.format(2))
    chosen = "[...document.querySelectorAll('#first, #second')].map(e => e.selectedOptions[0].text)"
    assert page.run(chosen) == ["small.ply", "tall.ply"]


def test_it_fits_a_telephone_and_the_dark(page, blobs, tmp_path, screenshots):
    long = tmp_path / f"{'name' * 40}.ply"
    long.write_bytes(blobs[0].read_bytes())
    page.choose_file("#choose", long, *blobs)
    page.wait_for(GOOD.format(3))
    press(page, "Landmarks, distances")
    page.wait_for("state.results.length === 1")
    page.resize(360, mobile=True)
    page.call(
        "Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": "dark"}]
    )
    wide = page.run("document.documentElement.scrollWidth")
    dark = page.picture(save=screenshots / "app-narrow.png").mean()
    page.call("Emulation.setEmulatedMedia", features=[])
    page.resize()
    assert wide == 360
    assert dark < 0.4 < page.picture().mean()


def test_keyboard_alone_reaches_every_control_and_all_have_names(page, blobs):
    page.choose_file("#choose", *blobs)
    page.wait_for(GOOD.format(2))
    page.run("document.activeElement.blur()")
    reached = []
    for _ in range(40):
        page.press("Tab", windowsVirtualKeyCode=9)
        reached.append(page.run("document.activeElement.textContent + document.activeElement.id"))
    for name in ("choose", "sample", "first", "second", "up", "mirror", "Match", "Remove"):
        assert any(re.search(rf"{name}$", one) for one in reached), name
    # What has the focus keeps it, although the cards are drawn again and work goes on.
    enter = {"windowsVirtualKeyCode": 13, "text": "\r"}
    page.run("document.querySelector('[aria-label=\"Take tall.ply as the first\"]').focus()")
    page.press("Enter", **enter)
    assert page.run("document.activeElement.ariaLabel") == "Take tall.ply as the first"
    assert page.run("document.activeElement.ariaPressed") == "true"
    page.run("document.querySelector('[data-do=form]').focus()")
    page.press("Enter", **enter)
    page.run("part('first').focus()")
    page.wait_for("state.jobs.length === 1 || state.results.length === 1")
    assert page.run("document.activeElement.id") in ("first", "results-head")
    page.wait_for("state.results.length === 1")
    tree = page.call("Accessibility.getFullAXTree")["nodes"]
    controls = ("button", "checkbox", "combobox", "link", "textbox", "Iframe", "image")
    unnamed = [
        node["role"]["value"]
        for node in tree
        if not node.get("ignored")
        and node.get("role", {}).get("value") in controls
        and not node.get("name", {}).get("value")
    ]
    assert unnamed == []
    assert any(node.get("role", {}).get("value") == "status" for node in tree)


def test_landmarks_outlast_their_tab_and_are_its_own_and_work_is_cancelled(page, app, dogs):
    page.choose_file("#choose", *dogs)
    page.wait_for(GOOD.format(2))
    press(page, "Place landmarks")
    page.wait_for("state.results.length === 1 && frame?.greeted")
    ours, theirs = ([{"name": "ear", "at": at}] for at in ([87, 139], [328, 294]))
    page.run(f"frame.contentWindow.postMessage({{landmarks: {ours}}}, '*')")
    page.wait_for("placed[shown]?.[0]?.at[0] === 87")
    page.run("sessionStorage.clear()")  # as in a new tab
    page.visit(page.run("location.href"))
    page.wait_for("frame?.greeted && part('placed').textContent.startsWith('1 placed.')")
    there = f"{{[shown]: {theirs}, 0: {theirs}}}"
    other = f"JSON.stringify({{run: location.pathname, placed: {there}}})"
    page.run(f"localStorage.setItem('unbend', {other})")  # as another tab does
    press(page, "Match with these")
    page.wait_for("state.jobs.length === 1 && state.jobs[0].running")
    shown = "(b => b.top >= 0 && b.bottom <= innerHeight)(part('working').getBoundingClientRect())"
    page.run("scrollTo(0, document.body.scrollHeight)")
    assert page.run(shown)
    (job,) = app.session._jobs.values()
    assert job["job"]["landmarks"] == ours
    press(page, "Cancel")
    page.wait_for("!state.jobs.length")
    # What the other tab placed on other pages is kept beside ours.
    page.run(f"frame.contentWindow.postMessage({{landmarks: {ours}}}, '*')")
    last = "JSON.parse(localStorage.getItem('unbend')).placed"
    page.wait_for(f"{last}[shown][0].at[0] === 87")
    assert page.run(f"{last}[0]") == theirs


def test_what_is_ready_after_a_reload_or_during_one_is_shown(page, app, blobs):
    page.choose_file("#choose", *blobs)
    page.wait_for(GOOD.format(2))
    press(page, "Landmarks, distances")
    page.wait_for("state.results.length === 1")
    address = page.run("location.href")
    for count in (2, 3):
        page.run("document.querySelector('#results button').click()")
        press(page, "Match")
        page.wait_for("state.jobs.length === 1")
        if count == 3:
            page.call("Page.navigate", url="about:blank")
            app.wait(lambda state: len(state["results"]) == 3)
        page.visit(address)
        page.wait_for(f"state.results.length === {count}")
        pressed = "[...document.querySelectorAll('#results button')].map(b => b.ariaPressed)"
        assert page.run(pressed) == ["false"] * (count - 1) + ["true"]
        assert page.run("document.activeElement.id") == "results-head"


def test_a_killed_worker_is_a_sentence(page, app, dogs):
    page.choose_file("#choose", *dogs)
    page.wait_for(GOOD.format(2))
    press(page, "Match")
    page.wait_for("state.jobs.length && state.jobs[0].stage === 'search'")
    os.kill(app.session._worker._process.pid, signal.SIGKILL)
    page.wait_for("part('troubles').textContent.includes('ended unexpectedly')")
    press(page, "Close")
    page.wait_for("!state.troubles.length")
    page.visit(page.run("location.href"))
    assert page.run("part('troubles').textContent") == ""
    press(page, "Find left and right")
    page.wait_for("state.results.length === 1")
