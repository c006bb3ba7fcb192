"""Pages of many shapes in a real browser: what is pointed at is named, what is chosen opens."""

from pathlib import Path

import matplotlib
import numpy as np
import pytest

from browser import Browser, changed, drawn
from sheets import make_egg, make_torus
from unbend import Mesh
from unbend.report import search_page, similarity_page

NAMES = ("dog", "dog <script>alert('x')</script>", "giraffe", "horse", "points")
VALUES = np.array(
    [
        [1.0, 0.98, 0.61, 0.84, np.nan],
        [0.98, 1.0, 0.63, 0.86, np.nan],
        [0.61, 0.63, 1.0, 0.72, np.nan],
        [0.84, 0.86, 0.72, 1.0, np.nan],
        [np.nan, np.nan, np.nan, np.nan, 1.0],
    ]
)
READOUT = "part('readout').textContent"


@pytest.fixture(scope="module")
def animals() -> list[Mesh]:
    egg = make_egg(3)
    wide = Mesh(egg.vertices * [1.5, 1, 1], egg.faces)
    made = [egg, Mesh(egg.vertices * [1, 1.1, 1], egg.faces), make_torus(30, 20), wide]
    made.append(Mesh(egg.vertices))
    return [Mesh(one.vertices, one.faces, name=n) for one, n in zip(made, NAMES, strict=True)]


@pytest.fixture(scope="module")
def similarity_html(animals, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "similarity.html"
    similarity_page(animals, VALUES, path)
    return path


@pytest.fixture(scope="module")
def search_html(animals, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("pages") / "search.html"
    search_page(animals[0], animals[1:], [0.1, 0.3, 0.5, np.nan], path)
    return path


def cell(browser: Browser, row: int, column: int) -> tuple[float, float]:
    """Middle of a cell on the screen, by where the page says that it drew it."""
    where = "(b => [b.left + heatMap.tall, b.top + heatMap.top, heatMap.cell])"
    left, top, side = browser.run(f"{where}(part('heat').getBoundingClientRect())")
    return left + (column + 0.5) * side, top + (row + 0.5) * side


@pytest.fixture
def page(browser: Browser, similarity_html: Path) -> Browser:
    browser.open(similarity_html)
    browser.run("globalThis.heatMap = part('heat').shown; 0")
    return browser


def chosen(browser: Browser) -> list[str]:
    named = "document.querySelector('#{}').parentElement.querySelector('b').textContent"
    return [browser.run(named.format(one)) for one in ("first", "second")]


def shaded(picture) -> float:
    """Share of the pixels that are darker than the ground."""
    return float((picture.mean(axis=2) < 0.75).mean())


def test_the_heat_map_names_what_is_pointed_at_and_shows_its_value(page, screenshots) -> None:
    order = page.run("heatMap.order")
    page.picture(save=screenshots / "similarity.png")
    for row, column in ((0, 1), (3, 2), (1, 4)):
        x, y = cell(page, row, column)
        page.mouse("mouseMoved", x, y)
        i, j = order[row], order[column]
        value = "unknown" if np.isnan(VALUES[i, j]) else f"{VALUES[i, j]:.4f}"
        assert page.run(READOUT) == f"{NAMES[i]} \u2194 {NAMES[j]}: similarity {value}"
    # Cells have the colours of their values.
    page.mouse("mouseMoved", 1, 1)
    page.settle()
    picture = page.picture("#heat")
    places = page.run("[heatMap.tall, heatMap.top, heatMap.cell]")
    tall, top, side = np.multiply(places, page.run("devicePixelRatio"))
    known = VALUES[~np.eye(5, dtype=bool) & ~np.isnan(VALUES)]
    for row, column in ((0, 0), (0, 1), (2, 3), (4, 1)):
        y, x = round(top + (row + 0.15) * side), round(tall + (column + 0.15) * side)
        value = VALUES[order[row], order[column]]
        want = np.full(3, 153 / 255)
        if not np.isnan(value):
            share = (value - known.min()) / (1 - known.min())
            want = np.array(matplotlib.colormaps["viridis"](share)[:3])
        np.testing.assert_allclose(picture[y, x], want, atol=0.03)


def test_a_click_or_keys_open_both_shapes_which_turn_together(page, screenshots) -> None:
    order = page.run("heatMap.order")
    before = [page.picture(f"#{name}") for name in ("first", "second")]
    row, column = order.index(2), order.index(3)
    page.click(*cell(page, row, column))
    assert chosen(page) == ["giraffe", "horse"]
    page.settle()
    after = [page.picture(f"#{name}") for name in ("first", "second")]
    assert max(map(changed, before, after)) > 0.02
    assert min(map(shaded, after)) > 0.02
    page.run("part('heat').focus()")
    page.press("ArrowUp" if row else "ArrowDown")
    page.press("Enter")
    assert chosen(page) == [NAMES[order[row - 1 if row else 1]], "horse"]
    page.picture(save=screenshots / "similarity-opened.png")
    names = ("#first", "#second")
    start = [page.picture(name) for name in names]
    page.drag(page.middle("#first", 0.8, 0.8), 90, 0)
    assert min(map(changed, start, map(page.picture, names))) > 0.01


def test_pictures_are_drawn_and_open_beside_the_most_alike(page, screenshots) -> None:
    cards = {i: page.picture(f".card[data-shape='{i}'] canvas") for i in range(5)}
    assert min(shaded(cards[i]) for i in range(4)) > 0.02
    assert shaded(cards[4]) < 0.01  # points
    page.run("document.querySelector(\".card[data-shape='3']\").click()")
    assert chosen(page) == ["horse", NAMES[1]]
    assert page.run(READOUT) == f"horse \u2194 {NAMES[1]}: similarity 0.8600"
    pressed = "[...document.querySelectorAll('[aria-pressed=true]')].map(b => +b.dataset.shape)"
    assert sorted(page.run(pressed)) == [1, 3]
    # Another axis upward turns the pictures too, whether or not the large ones turn together.
    page.run("part('linked').click()")
    start = page.picture(".card[data-shape='2'] canvas")
    page.run("(s => { s.value = 'z'; s.dispatchEvent(new Event('change')) })(part('up'))")
    page.settle()
    assert changed(start, page.picture(".card[data-shape='2'] canvas")) > 0.02


def test_the_page_is_readable_in_the_dark_and_on_a_telephone(page, screenshots) -> None:
    dark = [{"name": "prefers-color-scheme", "value": "dark"}]
    page.call("Emulation.setEmulatedMedia", features=dark)
    page.settle()
    picture = page.picture(save=screenshots / "similarity-dark.png")
    page.call("Emulation.setEmulatedMedia", features=[])
    page.resize(390)
    page.settle()
    wide = page.run("document.documentElement.scrollWidth")
    page.picture(save=screenshots / "similarity-narrow.png")
    page.resize()
    assert np.median(picture) < 0.2
    assert wide == 390


def test_colours_that_mean_something_are_seen_where_colours_are_forced(page) -> None:
    forced = [{"name": "forced-colors", "value": "active"}]
    page.call("Emulation.setEmulatedMedia", features=forced)
    scale = page.picture(".scale")
    borders = page.run(
        "['true', 'false'].map(pressed => getComputedStyle("
        "document.querySelector(`[aria-pressed=${pressed}]`)).borderTopColor)"
    )
    page.call("Emulation.setEmulatedMedia", features=[])
    assert drawn(scale) > 0.9
    assert borders[0] != borders[1]


def test_what_was_found_opens_beside_what_was_looked_for(browser, search_html, screenshots) -> None:
    browser.open(search_html)
    assert chosen(browser) == ["dog", NAMES[1]]
    browser.picture(save=screenshots / "search.png")
    browser.click(*browser.middle(".card[data-shape='2']"))
    assert chosen(browser) == ["dog", "giraffe"]
    assert browser.run(READOUT) == "dog \u2194 giraffe: distance 0.3000"
    browser.settle()
    assert shaded(browser.picture("#second")) > 0.02
    browser.click(*browser.middle(".card[data-shape='4']"))
    assert chosen(browser)[1] == "points: nothing to draw"
    assert browser.run(READOUT) == "dog \u2194 points: distance unknown"
    select = "(s => { s.value = '3'; s.dispatchEvent(new Event('change')) })(part('first-choice'))"
    browser.run(select)
    assert chosen(browser)[0] == "horse"
