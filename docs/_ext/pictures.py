"""Pictures of the gallery without the white around them, so that shapes are large."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from PIL import Image, ImageChops
from sphinx_gallery.scrapers import matplotlib_scraper

_MARGIN = 12  # pixels


def scrape(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the figures of a block as Sphinx-Gallery does, then trim them."""
    rst: str = matplotlib_scraper(block, block_vars, gallery_conf)
    for path in set(re.findall(r"/[^\s,]+\.png", rst)):
        trim(Path(gallery_conf["src_dir"], path.lstrip("/")))
    return rst


def trim(path: Path) -> None:
    """Cut a picture to what is not of the colour of its corner, and a margin."""
    picture = Image.open(path).convert("RGB")
    ground = Image.new("RGB", picture.size, picture.getpixel((0, 0)))
    box = ImageChops.difference(picture, ground).getbbox()
    if box:
        left, top, right, bottom = box
        wide, high = picture.size
        picture.crop((
            max(0, left - _MARGIN), max(0, top - _MARGIN),
            min(wide, right + _MARGIN), min(high, bottom + _MARGIN),
        )).save(path)  # fmt: skip
