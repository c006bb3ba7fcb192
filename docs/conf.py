"""The documentation site; ``make docs`` builds it."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
# Nothing that examples compute is taken from, or left in, the user's cache.
os.environ["UNBEND_CACHE_DIR"] = str(HERE / "_build" / "cache")
os.environ["PYVISTA_OFF_SCREEN"] = "true"

from sphinx_gallery.sorting import ExplicitOrder  # noqa: E402

import unbend  # noqa: E402

project = "unbend"
author = "the authors of unbend"
version = release = unbend.__version__
copyright = author

extensions = [
    "commands",
    "mathml",
    "myst_parser",
    "numpydoc",
    "scene",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
html_math_renderer = "mathml"
templates_path = ["_templates"]
exclude_patterns = ["_build", "**/GALLERY_HEADER.rst"]

myst_enable_extensions = ["attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"  # numpydoc says shapes and units, which types do not
numpydoc_show_class_members = False

# The order of the gallery; whatever is missing here comes last.
GALLERY = [
    *("canonical_poses", "detail_preserved", "texture", "rigging", "measure_scan", "symmetry"),
    *("species", "partial_scan", "collection", "similarity", "mean_shape", "robustness"),
    *("distances", "sphere_spectrum", "million_vertices", "trimesh", "pyvista", "sklearn"),
]
sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"/plot_",
    "within_subsection_order": ExplicitOrder([f"plot_{name}.py" for name in GALLERY] + ["*"]),
    "backreferences_dir": "api/backreferences",
    "doc_module": ("unbend",),
    "image_scrapers": ("pictures.scrape",),
    "abort_on_example_error": False,
    "download_all_examples": False,
    "remove_config_comments": True,
    "ignore_repr_types": r"matplotlib",
    "show_memory": False,
    "write_computation_times": False,
    "min_reported_time": 1,
}

highlight_language = "none"
smartquotes_action = "qe"  # no dashes: --out is an option

html_theme = "pydata_sphinx_theme"
html_title = "unbend"
html_context = {"default_mode": "auto"}
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_favicon = "_static/mark.svg"
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "logo": {"image_light": "_static/mark.svg", "image_dark": "_static/mark.svg", "text": "unbend"},
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 7,
    "show_toc_level": 2,
    "show_prev_next": True,
    # Scenes in the gallery take the whole width.
    "secondary_sidebar_items": {"[!g]**": ["page-toc"], "glossary": ["page-toc"]},
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
    "pygments_light_style": "tango",
    "pygments_dark_style": "monokai",
}
html_sidebars = {"index": [], "first-steps": []}


def _lead_to_pages(app: Any, name: str, source: list[str]) -> None:
    """Folders that readers of the repository open are pages here."""
    if name.startswith("reproduction/"):
        source[0] = re.sub(r"\]\((\w+)/\)", r"](\1/README.md)", source[0])


def setup(app: Any) -> None:
    """Connect what is ours."""
    app.connect("source-read", _lead_to_pages)
