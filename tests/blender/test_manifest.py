"""What can be said of the extension without Blender."""

import re
import tomllib
from pathlib import Path

import pytest

import unbend

BLENDER = Path(__file__).parents[2] / "blender"
MANIFEST = tomllib.loads((BLENDER / "blender_manifest.toml").read_text("utf-8"))
CODE = (BLENDER / "__init__.py").read_text("utf-8")


def test_the_version_is_that_of_unbend() -> None:
    assert MANIFEST["version"] == unbend.__version__


@pytest.mark.parametrize(
    "field", ["id", "name", "tagline", "maintainer", "type", "license", "blender_version_min"]
)
def test_the_manifest_has_what_blender_requires(field: str) -> None:
    assert MANIFEST["schema_version"] == "1.0.0"
    assert MANIFEST[field]


def test_texts_are_as_short_as_blender_allows() -> None:
    for text in (MANIFEST["tagline"], *MANIFEST["permissions"].values()):
        assert len(text) <= 64
        assert text[-1].isalnum()


def test_the_build_finds_what_it_fills_in() -> None:
    text = (BLENDER / "blender_manifest.toml").read_text("utf-8")
    for line in ("platforms = []", "wheels = []", 'min = "4.5.0"', 'max = "5.1.0"'):
        assert text.count(line) == 1


def test_every_operator_is_a_button_of_the_panel() -> None:
    operators = re.findall(r"^class (\w+)\(_Operator, bpy", CODE, re.MULTILINE)
    listed = re.search(r"^OPERATORS = \((.*?)\)", CODE, re.DOTALL | re.MULTILINE)
    assert listed is not None
    assert re.findall(r"\w+", listed[1]) == operators
    for operator, idname in zip(operators, re.findall(r'bl_idname = "(.*)"', CODE), strict=True):
        assert operator.lower().replace("_ot_", ".") == idname
