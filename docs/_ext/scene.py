"""The scene on the front page: a match, found while the site is built."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from unbend import match
from unbend.datasets import make_quadruped
from unbend.report import match_page


def write_scene(path: Path) -> None:
    """Write the page of a match between two dogs, as a frame within another page."""
    standing = make_quadruped("standing", n_vertices=2500).mesh
    galloping = make_quadruped("galloping", n_vertices=2200, meshing=1).mesh
    page = match_page(standing, galloping, match(standing, galloping))
    path.parent.mkdir(exist_ok=True)
    path.write_text(page._repr_html_(), encoding="utf-8")


def setup(app: Any) -> dict[str, Any]:
    """Write the scene before the front page is read."""
    app.connect("builder-inited", lambda app: write_scene(Path(app.srcdir, "_build", "scene.html")))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
