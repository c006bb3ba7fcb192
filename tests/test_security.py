"""What files and names from elsewhere must not be able to do."""

import ast
import functools
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

import unbend
from unbend import Mesh, canonical_form
from unbend.datasets import make_sphere
from unbend.datasets.fetch import TOSCA_REMESHED_URL
from unbend.matching import Match
from unbend.report import form_page, match_page, view

SOURCE = Path(unbend.__file__).parent
HOSTILE = "<script>alert(1)</script>\"'><img src=x onerror=alert(2)>&lt;--></script>.off"
# What runs code that it finds in data, or unpacks archives to where their members say.
DANGEROUS_MODULES = {"pickle", "cPickle", "dill", "joblib", "marshal", "shelve", "tarfile", "yaml"}
DANGEROUS_FUNCTIONS = {"eval", "exec", "compile", "__import__", "os.system", "os.popen"}
DANGEROUS_METHODS = {"extract", "extractall", "unpack_archive"}


@functools.cache
def _trees() -> list[tuple[Path, list[ast.AST]]]:
    paths = sorted(SOURCE.rglob("*.py"))
    return [(path, list(ast.walk(ast.parse(path.read_text("utf-8"))))) for path in paths]


def test_no_module_is_imported_that_runs_what_it_reads() -> None:
    for path, nodes in _trees():
        for node in nodes:
            names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found = DANGEROUS_MODULES & {name.split(".")[0] for name in names}
            # What Numba has compiled is code itself, in a folder of code.
            assert found <= ({"pickle"} if path == SOURCE / "_compiled.py" else set()), path


def test_nothing_is_evaluated_or_unpacked_where_it_says() -> None:
    for path, nodes in _trees():
        called = [node.func for node in nodes if isinstance(node, ast.Call)]
        assert DANGEROUS_FUNCTIONS.isdisjoint(map(ast.unparse, called)), path
        assert DANGEROUS_METHODS.isdisjoint(getattr(one, "attr", "") for one in called), path


def test_every_load_of_numpy_refuses_pickles() -> None:
    n_loads = 0
    for path, nodes in _trees():
        for node in nodes:
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("np.load", "numpy.load"):
                allowed = {one.arg: ast.unparse(one.value) for one in node.keywords}
                assert allowed.get("allow_pickle") == "False", path
                n_loads += 1
    assert n_loads > 0


def test_downloads_are_encrypted_pinned_and_hashed() -> None:
    pinned = r"https://raw\.githubusercontent\.com/[^/]+/[^/]+/[0-9a-f]{40}/"
    assert re.match(pinned, TOSCA_REMESHED_URL)
    addresses = {
        word
        for path in SOURCE.rglob("*.py")
        for word in re.findall(r'"(https?:[^"]*/)"', path.read_text("utf-8"))
    }
    ours = ("https://", "http://127.0.0.1:")  # the latter is the app's own
    assert not [one for one in addresses if not one.startswith(ours)]
    lines = (files("unbend.datasets") / "tosca_remeshed.sha256").read_text("utf-8").splitlines()
    for digest, name in map(str.split, lines):
        assert re.fullmatch("[0-9a-f]{64}", digest)
        # Relative, without a step up: nothing is written beside the folder.
        assert re.fullmatch(r"(\w[\w.]*/)*\w[\w.]*", name)


def test_nobody_is_told_to_fetch_a_package_of_our_name() -> None:
    """Until a package index knows it as ours, it may be a stranger's."""
    root = Path(__file__).parents[1]
    places = (SOURCE, root / "docs", root / "examples", root / "blender")
    pages = [
        path for folder in places for path in folder.rglob("*.*") if "_build" not in path.parts
    ]
    for path in (root / "README.md", *pages):
        if path.suffix in (".py", ".md", ".rst"):
            text = re.sub(r"\s+", " ", path.read_text("utf-8"))
            assert not re.search(r"install (-\S+ )*[\"'`]*unbend\b(?!/)", text), path


class _Skeleton(HTMLParser):
    """The tags of a page with the names of their attributes: what a browser would act on."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, tuple[str, ...]]] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, tuple(name for name, _ in attrs)))


def _pages(name: str) -> Iterator[str]:
    ball = make_sphere(1)
    mesh = Mesh(ball.vertices * (1, 1.2, 1.5), ball.faces, name=name)
    every = np.arange(mesh.n_vertices)
    found = Match(every, every, np.eye(3), 1.0, 1.0)
    command = f"unbend match {name} {name}"
    yield view(mesh, mesh).html
    yield form_page(mesh, canonical_form(mesh), command=command).html
    yield match_page(mesh, mesh, found, command=command).html


@pytest.mark.parametrize("name", [HOSTILE, "</title><svg onload=alert(3)>", "a\u2028{x}\0b"])
def test_a_name_adds_no_tag_to_a_page(name: str) -> None:
    for plain, page in zip(_pages("plain.off"), _pages(name), strict=True):
        assert _Skeleton(page).tags == _Skeleton(plain).tags
