"""What is released says one thing in every place, and nothing breaks where Unix is missing."""

import ast
import importlib.util
import re
import sys
import tomllib
from pathlib import Path

import pytest

import unbend

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
# What Python has on Unix only.
UNIX = {"fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"}


def text(name):
    return (ROOT / name).read_text("utf-8")


def test_the_version_is_the_same_everywhere():
    version = re.escape(unbend.__version__)
    assert re.search(rf"^version: {version}$", text("CITATION.cff"), re.MULTILINE)
    assert re.search(rf'^  version: "{version}"$', text("release/recipe.yaml"), re.MULTILINE)
    assert re.search(rf"^## {version}(,|$)", text("CHANGELOG.md"), re.MULTILINE)


def test_the_recipe_wants_what_the_package_wants():
    # numpy is told apart by system there, which a recipe for all systems cannot.
    ours = {
        one.replace(">", " >", 1).replace("qdldl ", "qdldl-python ")
        for one in PROJECT["dependencies"]
        if "sys_platform != " not in one
    }
    ours = {one.split(";")[0].strip() for one in ours}
    run = text("release/recipe.yaml").split("  run:\n")[1].split("\n\n")[0]
    theirs = set(re.findall(r"^    - (.*)$", run, re.MULTILINE))
    assert theirs == ours | {"python >=${{ python_min }}"}


def test_lowest_versions_are_those_of_the_bounds():
    spec = importlib.util.spec_from_file_location("matrix", ROOT / "release" / "matrix.py")
    matrix = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(matrix)
    found = matrix.lowest()
    assert "typer==0.20" in found
    assert "numpy==2; sys_platform == 'win32'" in found
    names = {re.split("[>=<]", one)[0] for one in PROJECT["dependencies"]}
    assert names <= {one.split("==")[0] for one in found}
    # Every Python with the wheel, every extra with lowest and newest versions, and the sdist.
    cases = list(matrix.cases(["3.11", "3.12"]))
    assert len(cases) == len(set(cases)) == 2 + (1 + len(matrix.EXTRAS)) + len(matrix.EXTRAS) + 1
    # All extras that users are told of.
    told = re.findall(r"^\| `(\w+)` \|", text("docs/first-steps.md"), re.MULTILINE)
    assert set(told) == set(matrix.EXTRAS) <= PROJECT["optional-dependencies"].keys()
    told = PROJECT["requires-python"].removeprefix(">=")
    assert told == matrix.PYTHONS[0]


OURS = sorted(
    path for folder in ("src", "paper", "testshapes") for path in (ROOT / folder).rglob("*.py")
)


@pytest.mark.parametrize("path", OURS, ids=lambda path: path.stem)
def test_modules_need_neither_unix_nor_its_encoding(path):
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [one.name for one in node.names]
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else names
            assert not UNIX & {name.split(".")[0] for name in names}
        if isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            given = {one.value for one in node.args if isinstance(one, ast.Constant)}
            binary = any("b" in mode for mode in given if isinstance(mode, str))
            named = "utf-8" in given or any(one.arg == "encoding" for one in node.keywords)
            assert name not in {"read_text", "write_text"} or named
            # Of all that is called "open", only what is told a mode or opens a path is a file.
            assert name != "open" or binary or named or not isinstance(node.func, ast.Name)


@pytest.mark.skipif(sys.platform == "win32", reason="that is what it is about")
def test_cores_are_counted_where_processes_are_not_bound(monkeypatch):
    from unbend import _parallel

    monkeypatch.delattr("os.sched_getaffinity", raising=False)
    assert _parallel.n_cores() >= 1
