"""The gallery: every script compiles, and those that take little run. ``make docs`` runs all."""

import re
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


def _fewer(given):
    """Fewer vertices than pictures need."""
    return "n_vertices=600" if given[0].startswith("n") else "make_sphere(3)"


@pytest.mark.parametrize("name", CHEAP)
def test_a_script_runs(name, tmp_path, monkeypatch):
    plt = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        plt.switch_backend("agg")
        try:
            text = (FOLDER / f"plot_{name}.py").read_text(encoding="utf-8")
            text = re.sub(r"n_vertices=\d+|make_sphere\(4\)", _fewer, text)
            exec(compile(text, name, "exec"), {"__name__": "__main__"})
            assert plt.get_fignums()
        finally:
            plt.close("all")


def test_pyvista_is_shown_where_it_is_installed(tmp_path, monkeypatch):
    if not find_spec("pyvista"):
        pytest.skip("PyVista is not installed: make docs runs this one")
    test_a_script_runs("pyvista", tmp_path, monkeypatch)
