"""The gallery: every script compiles, and those that take little run. ``make docs`` runs all."""

import runpy
import warnings
from importlib.util import find_spec
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))
# The others match shapes, which takes seconds each.
CHEAP = ("canonical_poses", "detail_preserved", "distances", "sphere_spectrum", "trimesh")

pytestmark = pytest.mark.skipif(not SCRIPTS, reason="the gallery is not part of a release")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda one: one.stem)
def test_a_script_compiles_and_says_what_it_is_for(script):
    text = script.read_text(encoding="utf-8")
    compile(text, script.name, "exec")
    first, title, line = text.splitlines()[:3]
    assert first == '"""'
    assert line == "=" * len(title)
    assert "# %%" in text


@pytest.mark.parametrize("name", CHEAP)
def test_a_script_runs(name, tmp_path, monkeypatch):
    plt = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plt.switch_backend("agg")
        try:
            runpy.run_path(str(FOLDER / f"plot_{name}.py"))
            assert plt.get_fignums()
        finally:
            plt.close("all")


def test_pyvista_is_shown_where_it_is_installed(tmp_path, monkeypatch):
    if not find_spec("pyvista"):
        pytest.skip("PyVista is not installed: make docs runs this one")
    test_a_script_runs("pyvista", tmp_path, monkeypatch)
