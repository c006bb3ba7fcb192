"""The documentation: code in it runs, commands exist, links lead somewhere, nothing is missing.

``make docs`` builds all of it with warnings as errors; here is what can be told without Sphinx.
"""

import contextlib
import functools
import io
import re
import shlex
from collections import defaultdict
from importlib import import_module
from importlib.util import find_spec
from inspect import isfunction
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer.main

import unbend
from sheets import make_egg
from stones import computed_once  # noqa: F401
from terminal import invoke
from unbend import Mesh, write_mesh
from unbend.cli import app
from unbend.collection import _collection, _engine
from unbend.datasets import make_sphere
from unbend.io import write_markups, write_values

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.glob("*.md"), *DOCS.glob("reproduction/**/*.md")])
WRITTEN = [*PAGES, *ROOT.glob("*.md"), *ROOT.glob("benchmarks/*.md")]
BLOCK = re.compile(r"^```(python|sh)\n(.*?)^```", re.DOTALL | re.MULTILINE)
OTHERS = ("dask_kubernetes", "meshio", "nibabel", "pyvista")  # programs that may be missing
# What the build makes, and what it is made from.
MADE = {"gallery": ROOT / "examples", "commands": DOCS, "api": DOCS / "api"}

pytestmark = pytest.mark.skipif(not DOCS.exists(), reason="the site is not part of a release")


def blocks(page, language):
    return [code for kind, code in BLOCK.findall(page.read_text("utf-8")) if kind == language]


def write_abaqus(path, nodes, kind, elements):
    lines = ["*NODE", *(f"{i}, {str(row)[1:-1]}" for i, row in enumerate(nodes.tolist()))]
    lines += [f"*ELEMENT, TYPE={kind}"]
    lines += [f"{i}, {str(row)[1:-1]}" for i, row in enumerate(elements.tolist())]
    path.write_text("\n".join(lines))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the files that the pages speak of, as the current one."""
    egg = make_egg(2)
    for i, name in enumerate(("dog.ply", "scans/first.ply", "models/a/second.obj")):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_mesh(path, (egg.vertices * [1, 1, 1 + 0.1 * i], egg.faces))
    for i, name in enumerate(("template", "anna", "ben", "cup", "mug", "eve", "left")):
        body = Mesh(egg.vertices * [1, 1 + 0.1 * i, 1], egg.faces)
        write_mesh(tmp_path / f"{name}.ply", body)
        ends = body.vertices.argmax(axis=0)[:2]
        write_markups(tmp_path / f"{name}.mrk.json", body, ends, ["left hand", "head"])
    write_mesh(tmp_path / "scan.glb", body, uvs=body.vertices[:, :2])
    for name in ("bracket", "fossil", "patient", "visit1", "visit2"):
        write_mesh(tmp_path / f"{name}.stl", body)
    inside = np.vstack([egg.vertices, egg.vertices.mean(axis=0)])
    solid = np.insert(egg.faces[:, ::-1], 3, egg.n_vertices, axis=1)
    write_abaqus(tmp_path / "shells.inp", egg.vertices, "S3", egg.faces)
    write_abaqus(tmp_path / "solid.inp", inside, "C3D4", solid)
    np.save(tmp_path / "thickness.npy", np.ones(egg.n_vertices))
    (tmp_path / "movie").mkdir()
    for name in ("movie/frame_0.vtp", "movie/frame_1.vtp", "cells.vtp"):
        write_values(tmp_path / name, np.ones(egg.n_vertices), body, names=["fluorescence"])
    monkeypatch.chdir(tmp_path)
    return tmp_path


WITH_CODE = [one for one in PAGES if blocks(one, "python") and one.stem != "first-steps"]


@pytest.fixture
def here(monkeypatch):
    """Collections are worked on in this process: what workers do is tested elsewhere."""
    monkeypatch.setattr(_collection, "engine", lambda **_: _engine.engine(workers=0))


@pytest.mark.parametrize("page", WITH_CODE, ids=lambda one: one.stem)
def test_python_on_a_page_runs_from_top_to_bottom(page, folder, here):
    known = {}
    for code in blocks(page, "python"):
        compiled = compile(code, page.name, "exec")
        if any(one in code and not find_spec(one) for one in OTHERS):
            continue  # it is checked to be Python, and no more
        with contextlib.redirect_stdout(io.StringIO()):
            exec(compiled, known)


@pytest.mark.parametrize("hand", [1, -1])
def test_change_between_two_visits_is_measured_where_both_scans_have_a_surface(folder, hand):
    """Scans have holes and seams, repeat faces, and may be inside out."""
    (code,) = (one for one in blocks(DOCS / "scans.md", "python") if "change.ply" in one)
    egg = make_egg(3)
    places = egg.vertices * [10, 16, 25]
    places += [2, 0, 0] * np.sin(places[:, 2:] / 10)
    loose = len(places)
    first = np.vstack([places, [0, 30, 0]])
    write_mesh("visit1.stl", (first, [*egg.faces[:, ::hand], [0, 1, loose], [1, 0, loose]]))
    places[:, 2] -= places[:, 2] < -15
    end = places[:, 2] > 15
    faces = egg.faces[~end[egg.faces].any(axis=1)]
    faces[places[faces[:, 0], 0] > 0] += loose  # a seam
    used, faces = np.unique(faces, return_inverse=True)
    write_mesh("visit2.ply", (places[used % loose] + 2, faces.reshape(-1, 3)))
    known = {}
    exec(code.replace("visit2.stl", "visit2.ply"), known)
    _, y, z = known["first"].vertices.T
    assert np.isnan(known["change"][(z > 17) | (y > 25)]).all()
    assert np.abs(known["change"][(np.abs(z) < 10) & (y < 25)]).max() < 0.05
    assert known["change"][z.argmin()] > 0.7


def test_a_girth_is_that_of_a_tape(capsys):
    (code,) = (one for one in blocks(DOCS / "scans.md", "python") if "def girth" in one)
    ball = make_sphere(4)
    limb = Mesh(
        ball.vertices * [50, 50, 200], ball.faces[ball.vertices[ball.faces[:, 0], 0] < 0.98]
    )
    exec(code, {"np": np, "first": limb, "second": limb, "places": limb.vertices})
    level, first, second = np.loadtxt(capsys.readouterr().out.splitlines()).T
    truth = 100 * np.pi * np.sqrt(1 - (level / 200) ** 2)
    np.testing.assert_allclose([first, second], [truth, truth], rtol=0.01)


def test_a_girth_of_registered_shapes_is_of_one_part_alone(folder, capsys):
    (code,) = (one for one in blocks(DOCS / "statistics.md", "python") if "ConvexHull" in one)
    ball = make_sphere(4)
    n, mark = ball.n_vertices, 12
    both = np.vstack(
        [ball.vertices, ball.vertices + np.eye(3)[0] * 2.5]
    )  # a trunk and an arm beside it
    write_mesh("template.ply", (both, np.vstack([ball.faces, ball.faces + n])))
    (folder / "registered").mkdir()
    turned = both[:, [2, 0, 1]] * 3
    np.save("registered/vertices.npy", [both, turned, both])
    covered = np.arange(2 * n) < n, np.ones(2 * n, dtype=bool), np.arange(2 * n) >= n
    exec(code, {"np": np, "registrations": [SimpleNamespace(covered=one) for one in covered]})
    truth = 2 * np.pi * np.sqrt(1 - ball.vertices[mark, 1] ** 2)
    np.testing.assert_allclose(
        np.loadtxt(capsys.readouterr().out.splitlines()), [truth, 3 * truth, np.nan], rtol=0.01
    )


@pytest.mark.parametrize(
    "page", [ROOT / "README.md", DOCS / "first-steps.md"], ids=lambda one: one.stem
)
def test_code_and_commands_on_a_page_run_in_their_order(page, here, tmp_path, monkeypatch):
    """On smaller shapes than are spoken of, which is faster."""
    monkeypatch.chdir(tmp_path)
    known = {}
    text = re.sub(r"n_vertices=1\d00", "n_vertices=500", page.read_text("utf-8"))
    assert text.count("n_vertices=500") == 2
    for kind, code in BLOCK.findall(text):
        if kind == "python":
            with contextlib.redirect_stdout(io.StringIO()):
                exec(code, known)
        else:
            for words in commands_in(f"```sh\n{code}```"):
                done = invoke(words[1:])
                assert done.exit_code == 0, done.output
    assert (tmp_path / "match.html").exists()


def commands_in(text):
    """Every call of unbend in blocks of shell, indented ones too."""
    code = "\n".join(code for kind, code in BLOCK.findall(text) if kind == "sh")
    code += "\n".join(re.findall(r"^    (unbend .*)", text, re.MULTILINE))
    for line in code.replace("\\\n", " ").splitlines():
        if line.strip().startswith("unbend "):
            yield shlex.split(line, comments=True)


@functools.cache
def never_run():
    """Commands of their own: those that are read without their group lose its option -h."""
    return typer.main.get_command(app)


def check_command(words):
    """Let the command line read the words, and do nothing; patterns stand for two files."""
    command, name = never_run(), "unbend"
    words = [one for word in words[1:] for one in [word] * (1 + ("*" in word))]
    while hasattr(command, "commands"):
        assert words, f"{name} needs a command"
        assert words[0] in command.commands, f"there is no {name} {words[0]}"
        name, command, words = f"{name} {words[0]}", command.commands[words[0]], words[1:]
    command.make_context(name, words)


@pytest.mark.parametrize("page", WRITTEN, ids=lambda one: one.relative_to(ROOT).as_posix())
def test_commands_on_a_page_are_read_by_the_command_line(page):
    for words in commands_in(page.read_text("utf-8")):
        words = [word for word in words if word not in ("COMMAND", "...")]
        if "--help" not in words:
            check_command(words)
    for script in re.findall(r"python (benchmarks/\w+\.py)", page.read_text("utf-8")):
        assert (ROOT / script).exists()


def anchors(page):
    """Names that headings go by, as GitHub and the site make them."""
    heads = re.findall(r"^#+ (.*)", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", one.lower()).replace(" ", "-") for one in heads}


@pytest.mark.parametrize("page", WRITTEN, ids=lambda one: one.relative_to(ROOT).as_posix())
def test_links_on_a_page_lead_somewhere(page):
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if link.startswith(("http://", "https://")):
            continue
        file, _, anchor = link.partition("#")
        made = MADE.get(file.split("/")[0]) if page.parent == DOCS else None
        if made:
            assert (made / f"{Path(file).name}.py").exists() or file.endswith("/index"), link
            continue
        target = (page.parent / file) if file else page
        assert target.exists(), f"{page.name} leads to {link}, which is not there"
        if page != ROOT / "README.md" and target.suffix == ".md":
            here = DOCS.resolve() in target.resolve().parents
            assert here, f"{page.name}: {link} is no page of the site"
        assert not anchor or anchor in anchors(target), f"{page.name}: no heading {link}"


def test_every_page_can_be_found():
    trees = "".join(page.read_text("utf-8") for page in DOCS.glob("*.md"))
    listed = set(re.findall(r"^([\w/*-]+)$", trees, re.MULTILINE))
    for page in DOCS.glob("*.md"):
        assert page.stem in listed | {"index"}, f"{page.name} is in no table of contents"


def listed_in_reference():
    """The names in the reference of functions and classes, by module."""
    text = (DOCS / "api" / "index.rst").read_text("utf-8")
    parts = re.split(r"^\.\. currentmodule:: (.*)$", text, flags=re.MULTILINE)
    listed = defaultdict(list)
    for module, part in zip(parts[1::2], parts[2::2], strict=True):
        listed[module] += re.findall(r"^(?:   |\.\. data:: )(\w+)$", part, re.MULTILINE)
    return listed


def test_every_public_name_is_in_the_reference():
    listed = listed_in_reference()
    folders = {
        f"unbend.{name}": set(_public(name)).difference(unbend.__all__)
        for name in ("datasets", "report")
    }
    for module, names in {"unbend": unbend.__all__, **folders}.items():
        assert sorted(listed[module]) == sorted(names)


def test_every_function_in_the_reference_has_an_example():
    shown = [
        (name, getattr(import_module(module), name))
        for module, names in listed_in_reference().items()
        for name in names
    ]
    without = [name for name, one in shown if isfunction(one) and ">>> " not in one.__doc__]
    assert without == []


def test_names_on_pages_are_in_the_reference():
    listed = listed_in_reference()
    for page in WRITTEN:
        text = page.read_text("utf-8")
        for module, names in [
            *re.findall(r"`(unbend\.\w+)\.(\w+)`", text),
            *re.findall(r"from (unbend(?:\.\w+)?) import ([\w, ]+)", text),
        ]:
            unlisted = set(names.split(", ")).difference(listed[module], listed["unbend"])
            assert not unlisted, f"{page.name}: {module}: {unlisted}"


def _public(module):
    return getattr(__import__(f"unbend.{module}"), module).__all__


def test_every_command_and_option_is_in_the_reference(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    import commands

    commands.write_pages(tmp_path)
    pages = {path.name: path.read_text("utf-8") for path in tmp_path.glob("*.md")}
    found = dict(commands.all_commands())
    assert {"unbend match", "unbend collection mean", "unbend cache clear"} <= set(found)
    assert len(pages) == len(found) + 1
    for name, command in found.items():
        page = pages[name.removeprefix("unbend ").replace(" ", "-") + ".md"]
        assert page.startswith(f"# {name}\n")
        for option in command.params:
            if option.param_type_name == "option":
                assert all(word in page for word in (*option.opts, *option.secondary_opts))
        for words in commands_in(page):
            check_command(words)
    top = {name for name in found if name.count(" ") == 1}
    assert all(f"[{name}](" in pages["index.md"] for name in top)
