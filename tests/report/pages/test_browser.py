"""Pages in a real browser, from disk and without a network: what is seen is what was computed.

Skipped where there is no Chromium; ``make test-browser`` installs it and fails without one. The
screenshots are kept where UNBEND_SCREENSHOTS says.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from browser import Browser, changed, drawn
from unbend import Mesh, canonical_form, distance, lay_into_pose
from unbend.datasets import make_quadruped, make_sphere
from unbend.errors import UnbendWarning
from unbend.io import invert_map
from unbend.matching import Hypothesis, Match
from unbend.report import form_page, match_page, view
from unbend.report.pages import _match_page
from unbend.report.pages._shown import show

N = 900
SHUFFLE = np.random.default_rng(0).permutation(N)
# Source vertices without a partner: the ones from here on.
LOST = 880
MIRRORED = np.argsort(SHUFFLE)[::-1].copy()


@pytest.fixture(scope="module")
def dogs() -> tuple[Mesh, Mesh, np.ndarray]:
    """A dog in two poses, the second one's vertices shuffled, and the map between them."""
    first, second = (make_quadruped(pose, n_vertices=N).mesh for pose in ("standing", "walking"))
    forward = np.argsort(SHUFFLE)
    forward[LOST:] = -1
    target = Mesh(second.vertices[SHUFFLE], np.argsort(SHUFFLE)[second.faces], name="walking")
    return Mesh(first.vertices, first.faces, name="standing <b>"), target, forward


@pytest.fixture(scope="module")
def match_html(dogs, tmp_path_factory: pytest.TempPathFactory) -> Path:
    source, target, forward = dogs
    path = tmp_path_factory.mktemp("pages") / "match.html"
    known = np.flatnonzero(forward >= 0)
    found = Match(
        source_to_target=forward,
        target_to_source=invert_map(forward, target),
        functional_map=np.eye(2),
        orientation=0.9,
        confidence=0.9,
        hypotheses=(Hypothesis(0.2, 0.9), Hypothesis(0.3, 0.8)),
        mirrored=MIRRORED,
        expected_error=np.where(forward >= 0, np.linspace(0, 0.2, len(forward)), np.nan),
    )
    match_page(source, target, found, path, truth=(known, np.roll(forward[known], 1)))
    return path


def numbers(browser: Browser) -> list[int]:
    boxes = "[...document.querySelectorAll('#source-vertex, #target-vertex')]"
    return browser.run(f"{boxes}.map(box => box.value === '' ? -1 : +box.value)")


def test_both_shapes_and_forms_are_drawn(browser, match_html, screenshots) -> None:
    browser.open(match_html)
    for name in ("source", "target", "before", "after"):
        assert drawn(browser.picture(f"#{name}")) > 0.01, f"{name} is blank"
    browser.picture(save=screenshots / "match.png")
    assert "standing <b>" in browser.run("document.querySelector('h1').textContent")


def test_a_click_tells_the_partner_on_either_side(browser, match_html, dogs, screenshots) -> None:
    _, target, forward = dogs
    backward = invert_map(forward, target)
    browser.open(match_html)
    plain = browser.picture("#target")
    seen = set()
    for right in (-0.3, 0.0, 0.2):
        browser.click(*browser.middle("#source", right, 0.1))
        ours, theirs = numbers(browser)
        assert ours >= 0
        assert theirs == forward[ours]
        seen.add(ours)
        told = browser.run("document.querySelector('#readout').textContent")
        assert f"source vertex {ours}" in told
    assert len(seen) == 3
    # The partner is marked on the other shape.
    browser.run("document.activeElement.blur()")
    assert 0 < changed(plain, browser.picture("#target")) < 0.05
    browser.picture(save=screenshots / "match-marked.png")
    browser.click(*browser.middle("#target", 0.0, 0.1))
    ours, theirs = numbers(browser)
    assert ours == backward[theirs]


def test_what_has_no_place_in_the_forms_is_not_marked_there(browser, dogs, tmp_path) -> None:
    source, target, forward = dogs
    ball = make_sphere(1)
    both = Mesh(
        np.vstack([source.vertices, ball.vertices / 9 + 3]),
        np.vstack([source.faces, ball.faces + source.n_vertices]),
    )
    images = np.append(forward, np.full(ball.n_vertices, -1))
    match_page(both, target, images, tmp_path / "match.html")
    browser.open(tmp_path / "match.html")
    plain = browser.picture("#before")
    loose = both.n_vertices - 1
    box = "part('source-vertex')"
    browser.run(f"{box}.value = {loose}; {box}.dispatchEvent(new Event('change'))")
    browser.settle()
    assert numbers(browser) == [loose, -1]
    assert changed(plain, browser.picture("#before")) == 0
    mesh = "part('before').view.meshes[0]"
    assert browser.run(f"{mesh}.used[{loose}]") == 0


def test_landmarks_are_shown_on_both_shapes(browser, match_html, dogs, tmp_path) -> None:
    browser.open(match_html)
    plain = [browser.picture(f"#{name}") for name in ("source", "target")]
    source, target, forward = dogs
    rows = [(i, forward[i]) for i in (10, 400)]
    match_page(source, target, forward, tmp_path / "marked.html", landmarks=rows)
    browser.open(tmp_path / "marked.html")
    marked = [browser.picture(f"#{name}") for name in ("source", "target")]
    assert min(map(changed, plain, marked)) > 0
    assert max(map(changed, plain, marked)) < 0.04
    labels = "part('{}').view.landmarks.map(l => [l.label, l.vertex])"
    assert browser.run(labels.format("source")) == [["1", 10], ["2", 400]]
    assert browser.run(labels.format("target")) == [["1", rows[0][1]], ["2", rows[1][1]]]
    back = invert_map(forward, target)
    known = Match(forward, back, np.eye(2), 0.9, 0.9, missed_landmarks=(1,))
    match_page(source, target, known, tmp_path / "ignored.html", landmarks=rows)
    assert "2: they contradict" in (tmp_path / "ignored.html").read_text("utf-8")
    several = replace(known, alternatives=(replace(known, missed_landmarks=(0,)),))
    match_page(source, target, several, tmp_path / "several.html", landmarks=rows)
    browser.open(tmp_path / "several.html")
    assert browser.run(labels.format("target"))[1] == ["2 (ignored)", rows[1][1]]
    browser.run("(s => { s.value = 1; s.dispatchEvent(new Event('change')) })(part('map'))")
    assert browser.run(labels.format("target"))[0] == ["1 (ignored)", rows[0][1]]
    browser.open(tmp_path / "marked.html")
    # They follow the morph.
    browser.run("(s => { s.value = 1; s.dispatchEvent(new Event('input')) })(part('morph'))")
    browser.settle()
    here = "(v => v.projection()(...row(v.meshes[0].positions, 400)))(part('source').view)"
    there = f"(v => v.projection()(...row(v.meshes[0].positions, {forward[400]})))"
    apart = np.subtract(browser.run(here), browser.run(f"{there}(part('target').view)"))
    assert np.hypot(*apart) < 25


def test_labels_at_the_edge_are_not_cut_off(browser, dogs, tmp_path) -> None:
    source, target, forward = dogs
    rows = {f"landmark {i} of the dog": (i, forward[i]) for i in range(0, LOST, 40)}
    match_page(source, target, forward, tmp_path / "labels.html", landmarks=rows)
    browser.open(tmp_path / "labels.html")
    browser.run(
        "written = []; CanvasRenderingContext2D.prototype.fillText = function (text, left) {"
        " written.push((left + this.measureText(text).width) / this.canvas.width) }"
    )
    browser.run("part('source').view.change({})")
    browser.settle()
    ends = browser.run("written")
    assert len(ends) >= len(rows)
    assert max(ends) <= 1


def test_the_click_hits_the_vertex_under_the_pointer(browser, match_html, dogs) -> None:
    browser.resize(scale=1)  # the mark is a thin ring
    browser.open(match_html)
    x, y = browser.middle("#source", 0.05, 0.1)
    browser.click(x, y)
    assert numbers(browser)[0] >= 0
    # The mark is drawn where the vertex is.
    picture = browser.picture("#source")
    box = browser.run("(b => [b.left, b.top])(part('source').getBoundingClientRect())")
    row, column = round(y - box[1]), round(x - box[0])
    near = picture[row - 12 : row + 12, column - 12 : column + 12]
    browser.resize()
    orange = np.array([0xD5, 0x5E, 0x00]) / 255
    assert (np.abs(near - orange).max(axis=2) < 0.06).sum() > 20


def test_a_number_can_be_typed_and_another_map_chosen(browser, match_html, dogs) -> None:
    _, target, forward = dogs
    browser.open(match_html)
    plain = browser.picture("#target")
    typed = "(b => {{ b.value = '{}'; b.dispatchEvent(new Event('change')) }})(part('{}-vertex'))"
    browser.run(typed.format(123, "source"))
    assert numbers(browser) == [123, forward[123]]
    choose = "(s => {{ s.value = '{}'; s.dispatchEvent(new Event('change')) }})(part('map'))"
    browser.run(choose.format(1))
    assert numbers(browser) == [123, MIRRORED[123]]
    browser.settle()
    assert changed(plain, browser.picture("#target")) > 0.05
    browser.run(choose.format(0))
    assert numbers(browser) == [123, forward[123]]
    browser.run(typed.format(7, "target"))
    assert numbers(browser) == [invert_map(forward, target)[7], 7]
    browser.run(typed.format(LOST + 3, "source"))
    assert numbers(browser) == [LOST + 3, -1]
    assert "no target vertex" in browser.run("part('readout').textContent")
    browser.run(typed.format(10**6, "source"))
    assert "not shown" in browser.run("part('readout').textContent")


def test_thinned_shapes_tell_the_numbers_of_the_files(
    browser, dogs, tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_match_page, "show", lambda mesh: show(mesh, 300))
    source, target, forward = dogs
    match_page(source, target, forward, tmp_path / "thin.html")
    shown = show(source, 300).ids
    assert 0 < len(shown) <= 300
    browser.open(tmp_path / "thin.html")
    for right in (-0.3, 0.0, 0.2):
        browser.click(*browser.middle("#source", right, 0.1))
        ours, theirs = numbers(browser)
        assert ours in shown
        assert theirs == forward[ours]
    (lost,) = np.setdiff1d(np.arange(N), shown)[:1]
    browser.run(f"part('source-vertex').value = {lost}")
    browser.run("part('source-vertex').dispatchEvent(new Event('change'))")
    assert browser.run("part('readout').textContent") == "that vertex is not shown"


def test_both_shapes_turn_together_by_mouse_and_keys(browser, match_html) -> None:
    browser.open(match_html)
    names = ("source", "target")
    start = [browser.picture(f"#{name}") for name in names]
    browser.drag(browser.middle("#source", 0.8, 0.8), 120, 10)
    turned = [browser.picture(f"#{name}") for name in names]
    assert min(map(changed, start, turned)) > 0.02
    browser.run("part('target').focus()")
    browser.press("ArrowLeft")
    browser.press("+")
    assert min(map(changed, turned, [browser.picture(f"#{name}") for name in names])) > 0.02
    browser.run("part('reset').click()")
    browser.run("document.activeElement.blur()")
    assert max(map(changed, start, [browser.picture(f"#{name}") for name in names])) < 0.001
    # Not linked, the one that is dragged turns alone.
    browser.run("part('linked').click()")
    browser.drag(browser.middle("#source", 0.8, 0.8), 120, 10)
    alone = [browser.picture(f"#{name}") for name in names]
    assert changed(start[0], alone[0]) > 0.02
    assert changed(start[1], alone[1]) < 0.001
    # Another axis upward is of both, and stays when they are linked again.
    browser.run("part('linked').click()")
    browser.run("part('linked').click()")
    browser.run("(s => { s.value = 'x'; s.dispatchEvent(new Event('change')) })(part('up'))")
    browser.settle()
    upward = [browser.picture(f"#{name}") for name in names]
    assert min(map(changed, start, upward)) > 0.02
    browser.run("part('linked').click()")
    browser.run("part('reset').click()")
    browser.run("document.activeElement.blur()")
    assert max(map(changed, upward, [browser.picture(f"#{name}") for name in names])) < 0.001


def test_the_slider_morphs_the_source_into_the_target(browser, match_html, screenshots) -> None:
    browser.open(match_html)
    move = "(s => {{ s.value = {}; s.dispatchEvent(new Event('input')) }})(part('morph'))"
    start = browser.picture("#source")
    browser.run(move.format(0.5))
    browser.settle()
    half = browser.picture("#source", save=screenshots / "match-morph.png")
    browser.run(move.format(1))
    browser.settle()
    end = browser.picture("#source")
    assert min(changed(start, half), changed(half, end), changed(start, end)) > 0.01
    # At its end the source stands as the target does, but for what has no partner.
    target = browser.picture("#target")
    assert changed(end, target) < 0.3 * changed(start, target)
    browser.run(move.format(0))
    browser.settle()
    assert changed(start, browser.picture("#source")) < 0.001


def test_colours_by_error_and_in_the_dark(browser, match_html, screenshots) -> None:
    browser.open(match_html)
    place = browser.picture("#source")
    browser.run("(s => { s.value = '1'; s.dispatchEvent(new Event('change')) })(part('paint'))")
    browser.settle()
    by_error = browser.picture("#source")
    assert changed(place, by_error) > 0.05
    browser.run(
        "(s => { s.value = 'expected'; s.dispatchEvent(new Event('change')) })(part('paint'))"
    )
    browser.settle()
    assert changed(place, browser.picture("#source")) > 0.05
    assert changed(by_error, browser.picture("#source")) > 0.02
    dark = [{"name": "prefers-color-scheme", "value": "dark"}]
    browser.call("Emulation.setEmulatedMedia", features=dark)
    browser.settle()
    page = browser.picture(save=screenshots / "match-dark.png")
    browser.call("Emulation.setEmulatedMedia", features=[])
    assert np.median(page) < 0.2


def test_no_page_is_wider_than_a_small_telephone(browser, form_html) -> None:
    browser.open(form_html)
    browser.resize(320, mobile=True)
    wide = browser.run("document.documentElement.scrollWidth")
    browser.resize()
    assert wide == 320


def test_long_names_do_not_widen_a_page(browser, dogs, tmp_path: Path) -> None:
    long = [Mesh(one.vertices, one.faces, name="name" * 40) for one in dogs[:2]]
    match_page(*long, dogs[2], tmp_path / "long.html")
    browser.open(tmp_path / "long.html")
    browser.resize(320, mobile=True)
    wide = browser.run("document.documentElement.scrollWidth")
    browser.resize()
    assert wide == 320


@pytest.fixture(scope="module")
def form_html(dogs, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "form.html"
    form = canonical_form(dogs[0])
    form_page(dogs[0], form, path, posed=lay_into_pose(dogs[0], form))
    return path


def test_shape_and_form_are_drawn_and_turn_together(browser, form_html, screenshots) -> None:
    browser.open(form_html)
    names = ("shape", "form", "surface")
    start = [browser.picture(f"#{name}") for name in names]
    assert min(map(drawn, start)) > 0.01
    browser.picture(save=screenshots / "form.png")
    browser.drag(browser.middle("#form", 0.9, 0.9), 120, 10)
    assert min(map(changed, start, [browser.picture(f"#{name}") for name in names])) > 0.01


def test_large_shapes_are_coarse_while_they_move_without_a_graphics_processor(
    browser, tmp_path
) -> None:
    ball = make_sphere(5)
    view(ball, path=tmp_path / "ball.html")
    browser.open(tmp_path / "ball.html")
    browser.run(
        "globalThis.drawn = []; (gl => { const draw = gl.drawElements; gl.drawElements ="
        " (kind, n, ...more) => { drawn.push(n / 3); draw.call(gl, kind, n, ...more) } })"
        "(stage.gl)"
    )
    browser.drag(browser.middle("#shape-0", 0.9, 0.9), 90, 0)
    still = f"drawn.at(-1) === {ball.n_faces} ? r() : setTimeout(w, 20)"
    browser.run(f"new Promise(r => {{ const w = () => {still}; w() }})")
    assert 100 < browser.run("Math.min(...drawn)") < 0.6 * ball.n_faces


def test_two_places_tell_their_distances(browser, form_html, dogs, screenshots) -> None:
    form = canonical_form(dogs[0])
    browser.open(form_html)
    browser.click(*browser.middle("#shape", 0.0, 0.1))
    first = browser.run("+part('shape-vertex').value")
    browser.mouse("mouseMoved", *browser.middle("#shape", -0.3, 0.1))
    browser.settle()
    browser.settle()
    told = browser.run("part('readout').textContent")
    names, far, straight = re.fullmatch(
        r"(.*): biharmonic distance (\S+), straight in the form (\S+)", told
    ).groups()
    ids = [int(one) for one in re.findall(r"\d+", names)]
    assert ids[0] == first != ids[1]
    exact = distance(dogs[0], first, distance="biharmonic")[0, ids[1]] / np.sqrt(form.area)
    assert float(far) == pytest.approx(exact, rel=0.05)
    apart = np.linalg.norm(form.points[first] - form.points[ids[1]])
    assert float(straight) == pytest.approx(apart, abs=1e-3)


def test_a_place_that_has_no_distances_is_named(browser, dogs, tmp_path) -> None:
    ball = make_sphere(1)
    both = Mesh(
        np.vstack([dogs[0].vertices, ball.vertices * 0.1 + 1.5]),
        np.vstack([dogs[0].faces, ball.faces + dogs[0].n_vertices]),
    )
    with pytest.warns(UnbendWarning, match="component 0 of 2"):
        form = canonical_form(both, component="largest")
    form_page(both, form, tmp_path / "two.html")
    browser.open(tmp_path / "two.html")
    browser.run("part('shape-vertex').value = " + str(dogs[0].n_vertices + 3))
    browser.run("part('shape-vertex').dispatchEvent(new Event('change'))")
    told = f"vertex {dogs[0].n_vertices + 3} has no place in the form, and no distances"
    assert browser.run("part('readout').textContent") == told
    assert browser.run("part('form').view.marks") == []


def test_shapes_are_coloured_by_functions_and_distances(browser, form_html, screenshots) -> None:
    browser.open(form_html)
    browser.click(*browser.middle("#shape", 0.0, 0.1))
    seen = [browser.picture("#shape")]
    choose = "(s => {{ s.value = '{}'; s.dispatchEvent(new Event('change')) }})(part('paint'))"
    for kind in ("distance", "function-0", "function-5", "plain"):
        browser.run(choose.format(kind))
        browser.settle()
        seen.append(browser.picture("#shape", save=screenshots / f"form-{kind}.png"))
    assert min(map(changed, seen, seen[1:])) > 0.02
    thin = browser.picture("#form")
    browser.run("(s => { s.value = 4; s.dispatchEvent(new Event('input')) })(part('thicken'))")
    browser.settle()
    assert changed(thin, browser.picture("#form")) > 0.002


def test_a_name_is_text_and_nothing_else(browser, tmp_path: Path) -> None:
    name = "<script>document.title = 'run'</script><img src=x onerror=\"document.title = 'run'\">"
    sphere = make_sphere(2)
    view(Mesh(sphere.vertices, sphere.faces, name=name), path=tmp_path / "name.html")
    browser.open(tmp_path / "name.html")
    assert browser.run("document.querySelector('h1').textContent") == name
    assert browser.run("document.images.length") == 0
    assert browser.run("document.title") != "run"
