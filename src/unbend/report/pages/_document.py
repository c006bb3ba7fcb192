"""Parts of a page, put together into one HTML file with its styles, scripts and data."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import os
import tempfile
import webbrowser
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from unbend._display import table
from unbend._types import FloatArray, Progress, StrPath
from unbend.io import atomic_write, check_writable
from unbend.report.figures import upright

_SUFFIXES = (".html",)
# Scripts that every page runs before its own.
_SCRIPTS = ("shaders.js", "geometry.js", "stage.js", "scene.js", "page.js")

_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'sha256-{style_hash}'; script-src 'sha256-{script_hash}'">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
{band}<header>
<h1>{heading}</h1>
<p class="lead">{lead}</p>
<p class="trouble" id="trouble" role="alert" hidden></p>
<noscript><p class="trouble">The shapes need JavaScript, which is disabled.</p></noscript>
</header>
<main>
{body}
</main>
<footer>Made by unbend {version}. This file contains everything that it shows and uses no
network.</footer>
<script type="application/json" id="data">{data}</script>
<script>{script}</script>
</body>
</html>
"""  # noqa: E501


@dataclass(frozen=True, repr=False)
class Page:
    """A page that holds everything it shows; a notebook shows it as it is.

    Attributes
    ----------
    title : str
    html : str
        The whole file.
    """

    title: str
    html: str

    def write(self, path: StrPath) -> None:
        """Write the page to a .html file that is either complete or not there.

        Raises FileError if the file cannot be written.
        """
        check_writable(path, _SUFFIXES)
        with atomic_write(path) as file:
            file.write(self.html.encode("utf-8", "replace"))  # of names that no text can hold

    def open(self, path: StrPath | None = None) -> Path:
        """Write the page to a .html file, and open it in the browser that the system prefers.

        By default the file is a temporary one, which stays. Returns its path. Raises FileError if
        it cannot be written.
        """
        if path is None:
            number, path = tempfile.mkstemp(".html", "unbend-")
            os.close(number)
        self.write(path)
        webbrowser.open(Path(path).resolve().as_uri())
        return Path(path)

    def __repr__(self) -> str:
        return f"Page({self.title!r}, {len(self.html) / 1e6:.1f} MB)"

    def _repr_html_(self) -> str:
        sandbox, style = "allow-scripts allow-downloads", "width: 100%; height: 45rem; border: 0"
        frame = f'sandbox="{sandbox}" style="{style}"'
        return f'<iframe {frame} srcdoc="{escape(self.html)}"></iframe>'


def begin_page(path: StrPath | None, up: str, progress: Progress | None = None) -> Progress:
    """Refuse, before any work, what cannot be written and what is no axis; return `progress`."""
    if path is not None:
        check_writable(path, _SUFFIXES)
    upright(up)
    return progress or (lambda stage, share: None)


def make_page(
    title: str,
    lead: str,
    body: Sequence[str],
    data: dict[str, Any],
    scripts: Sequence[str],
    *,
    path: StrPath | None,
    heading: str = "",
    band: str = "",
) -> Page:
    """Put a page together, and write it if there is a path.

    Title, lead and band, a warning above all, are plain text. The heading, by default the title,
    and the blocks of the body are HTML in which the user's names are escaped. The scripts are files
    beside this one, and find the data unpacked.
    """
    folder = files("unbend.report.pages")
    names = ("page.css", *_SCRIPTS, *scripts)
    style, *parts = (folder.joinpath(name).read_text("utf-8") for name in names)
    script = "\n".join(['"use strict";', *parts])
    html = _PAGE.format(
        title=escape(title),
        heading=heading or escape(title),
        lead=escape(lead),
        band=f'<p class="band" role="alert">{escape(band)}</p>\n' if band else "",
        body="\n".join(body),
        version=version("unbend"),
        # Nothing in JSON needs "<" as it is, and HTML would end the script at "</script>".
        data=json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
        style=style,
        script=script,
        style_hash=_digest(style),
        script_hash=_digest(script),
    )
    page = Page(title, html)
    if path is not None:
        page.write(path)
    return page


def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")


def section(heading: str, *blocks: str) -> str:
    """Section of HTML blocks under a heading of plain text."""
    return f"<section>\n<h2>{escape(heading)}</h2>\n" + "\n".join(blocks) + "\n</section>"


def how_made(rows: Sequence[Sequence[str]], command: str) -> str:
    """Section on how the results were made: facts, and the command if there was one."""
    made = f"<pre><code>{escape(command)}</code></pre>" if command else ""
    return section("How it was made", table(rows), made)


def canvas(name: str, caption: str, description: str, box: str = "", more: str = "") -> str:
    """Canvas with a caption, alternative text, perhaps an input for a vertex number, and more."""
    entry = ""
    if box:
        entry = f'<label>vertex <input type="number" id="{box}" min="0" step="1"></label>'
    return (
        f'<figure><canvas id="{name}" tabindex="0" role="application" '
        f'aria-roledescription="3-D view" aria-label="{escape(description)}">'
        f"</canvas><figcaption><b>{escape(caption)}</b>{entry}{more}</figcaption></figure>"
    )


def select(label: str, name: str, options: Mapping[str, str], chosen: str = "") -> str:
    """Menu of options, texts by their values."""
    items = "".join(
        f'<option value="{value}"{" selected" * (value == chosen)}>{escape(text)}</option>'
        for value, text in options.items()
    )
    return f'<label>{label} <select id="{name}">{items}</select></label>'


def controls(own: str, up: str, *, grid: bool = True, several: bool = True) -> str:
    """Put a page's own controls, as HTML, before those of its views."""
    return (
        f'<div class="controls" role="group" aria-label="Controls">{own}'
        + '<label><input type="checkbox" id="grid" checked> grid</label>' * grid
        + '<label><input type="checkbox" id="wire"> mesh edges</label>'
        + '<label><input type="checkbox" id="linked" checked> turn together</label>' * several
        + select("up", "up", {axis: axis for axis in "xyz"}, up)
        + '<button type="button" id="reset">Reset view</button>'
        '<button type="button" id="picture">Save picture</button></div>\n'
    )


def side_by_side(own: str, up: str, views: Sequence[str], usage: str = "") -> str:
    """Put views between controls and the line that tells what the pointer is on."""
    above = controls(own, up, several=len(views) > 1)
    return f'{above}<div class="pair">{"".join(views)}</div>\n{readout(usage)}'


def readout(usage: str) -> str:
    """Line that tells what the pointer is on, and at first, if at all, how to use the page."""
    text = usage and (
        f"{usage} Drag to turn, shift-drag to shift, wheel or + and - to zoom, arrow keys to turn, "
        "0 to start over."
    )
    return f'<p class="readout" id="readout" aria-live="polite">{escape(text)}</p>'


def hint(html: str) -> str:
    """Small print; the user's names in it are escaped."""
    return f'<p class="hint">{html}</p>'


def curve_svg(x: FloatArray, curves: Sequence[tuple[str, FloatArray]], x_label: str) -> str:
    """Plot of how many points lie within x, in percent; the second curve is dashed."""
    most, k = float(x.max()), len(x) // 4
    marks, facts = [], []
    for i, (name, values) in enumerate(curves):
        spots = map(_spot, x / most, values / 100)
        line = "L".join(f"{left:.1f},{down:.1f}" for left, down in spots)
        kind = "curve other" if i else "curve"
        marks.append(f'<path class="{kind}" d="M{line}"><title>{escape(name)}</title></path>')
        facts.append(f"{name}: {values[k]:.1f}% within {x[k]:g}, {values[-1]:.1f}% within {most:g}")
    return _plot(marks, most, 100.0, x_label, "points within it, %", "; ".join(facts))


def dots_svg(values: FloatArray) -> str:
    """Plot of a dot for each eigenvalue."""
    right, top = _round_above(len(values) - 1), _round_above(float(values.max()))
    marks = []
    for i, value in enumerate(values):
        x, y = _spot(i / right, value / top)
        title = f"<title>{i}: {value:.6g}</title>"
        marks.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3">{title}</circle>')
    facts = f"{len(values)} values from {values[0]:.4g} to {values[-1]:.4g}"
    return _plot(marks, right, top, "number, counted from 0", "eigenvalue, at unit area", facts)


def _round_above(value: float) -> float:
    """Smallest number not below this one whose quarters are short to write."""
    unit = 10.0 ** math.floor(math.log10(max(value, 1e-300)))
    marks = [share * unit for share in (1, 1.2, 1.6, 2, 3, 4, 6, 8, 10)]
    return float(next(mark for mark in marks if mark >= value))


def _spot(across: float, up: float) -> tuple[float, float]:
    """Coordinates in a plot of a point that is given by its shares of the axes."""
    return 58 + 420 * across, 10 + 220 * (1 - up)


def _plot(
    marks: Sequence[str], right: float, top: float, x_label: str, y_label: str, facts: str
) -> str:
    """SVG with marks, axes from 0, and alternative text."""
    axes = ""
    for share in np.linspace(0, 1, 5):
        x, y = _spot(share, share)
        axes += (
            f'<path class="axis" d="M58 {y:.1f}h420"/>'
            f'<text x="52" y="{y + 4:.1f}" text-anchor="end">{share * top:.4g}</text>'
            f'<text x="{x:.1f}" y="248" text-anchor="middle">{share * right:.4g}</text>'
        )
    return (
        f'<svg viewBox="0 0 500 276" width="500" role="img" aria-label="{escape(facts)}">'
        f'{axes}{"".join(marks)}<text x="268" y="268" text-anchor="middle">{escape(x_label)}</text>'
        '<text transform="translate(12 120) rotate(-90)" text-anchor="middle">'
        f"{escape(y_label)}</text></svg>"
    )
