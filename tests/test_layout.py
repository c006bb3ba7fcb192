"""The table of CONTRIBUTING.md is the layout: imports run down it, and nothing is left out."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "unbend"
MODULES = {
    path.relative_to(SOURCE).with_suffix("").as_posix().replace("/", "."): path
    for path in SOURCE.rglob("*.py")
}


IMPORTERS = ("import_module", "__import__")


def rows():
    """Folders and top-level modules by row of the table, the top row first."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    table = re.findall(r"^\| (`[^|]*`) \| .* \|$", text, re.MULTILINE)
    return [re.findall(r"`([^`]+?)(?:/|\.py)`", row) for row in table]


ROW = {name: i for i, names in enumerate(rows()) for name in names}


def imports(name):
    """Modules of ours that a module imports, wherever in it, and whether by a private path."""
    for node in ast.walk(ast.parse(MODULES[name].read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "unbend":
            found = ".".join(node.module.split(".")[1:])
            for alias in node.names:
                below = f"{found}.{alias.name}".removeprefix(".")
                yield next(
                    one
                    for one in (below, f"{below}.__init__", found, f"{found}.__init__", "__init__")
                    if one in MODULES
                )
        if isinstance(node, ast.Import):
            assert not any(alias.name.startswith("unbend.") for alias in node.names), name
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(IMPORTERS):
            if name == "__init__":  # which stands above all, and loads the folders on first use
                continue
            assert isinstance(node.args[0], ast.Constant), f"{name} imports what is computed"
            if node.args[0].value.split(".")[0] == "unbend":
                found = ".".join(node.args[0].value.split(".")[1:])
                yield found if found in MODULES else f"{found}.__init__".removeprefix(".")


@pytest.fixture(scope="module")
def arrows():
    """The modules that each module imports."""
    return {name: set(imports(name)) for name in MODULES}


def test_the_table_names_every_folder_and_module():
    found = {name.split(".")[0] for name in MODULES if name.split(".")[-1] != "__init__"}
    assert found | {"__init__"} == set(ROW)


@pytest.mark.parametrize("name", MODULES)
def test_imports_run_down(name, arrows):
    room = name.split(".")[0]
    for other in arrows[name]:
        theirs = other.split(".")[0]
        if theirs != room:
            assert ROW[theirs] >= ROW[room], f"{name} imports {other}, which stands above it"
            private = other.split(".")[-1].startswith("_") and not other.endswith("__init__")
            assert not (private and "." in other), f"{name} reaches into {other}"


def test_there_is_no_circle(arrows):
    # A package's __init__ only gathers: who imports a sibling of it does not wait for it.
    left = {name: others - {name} for name, others in arrows.items()}
    while free := [name for name, others in left.items() if not others]:
        for name in free:
            del left[name]
        for others in left.values():
            others.difference_update(free)
    assert not left, f"circular imports among {sorted(left)}"


def test_there_is_no_circle_between_folders(arrows):
    left = {room: set() for room in ROW}
    for name, others in arrows.items():
        left[name.split(".")[0]] |= {one.split(".")[0] for one in others}
    left = {room: others - {room} for room, others in left.items()}
    while free := {room for room, others in left.items() if not others}:
        left = {room: others - free for room, others in left.items() if room not in free}
    assert not left, f"circular imports among {sorted(left)}"


def test_imports_within_functions_and_by_name_are_seen(tmp_path, monkeypatch):
    (tmp_path / "low.py").write_text(
        "def draw():\n"
        "    from unbend.report import plot\n"
        "    importlib.import_module('unbend.cli.match')\n"
        "    return import_module('unbend.report.pages')\n"
    )
    monkeypatch.setitem(MODULES, "low", tmp_path / "low.py")
    assert set(imports("low")) == {"report.__init__", "cli.match", "report.pages.__init__"}


def test_the_tests_mirror_the_modules():
    beside = (Path(), Path("blender"), Path("paper"), Path("testshapes"))
    for path in (ROOT / "tests").rglob("test_*.py"):
        folder = path.relative_to(ROOT / "tests").parent
        assert folder in beside or (SOURCE / folder).is_dir(), path


def test_kernels_use_no_names_of_files_without_kernels():
    """Compiled code is kept until one of the files with kernels changes (`_compiled.py`)."""
    texts = {name: path.read_text() for name, path in MODULES.items()}
    with_kernels = {name for name, text in texts.items() if "_compiled import" in text}
    assert "linalg._sweeps" in with_kernels
    for name in with_kernels:
        ours, foreign, uses = set(), set(), {}
        for node in ast.parse(texts[name]).body:
            if isinstance(node, ast.ImportFrom) and node.module.startswith("unbend"):
                names = {alias.asname or alias.name for alias in node.names}
                module = node.module.removeprefix("unbend.")
                if module == "_compiled":
                    ours = names & {"compiled", "generated"}
                elif module not in {*with_kernels, "_types"}:  # annotations are not compiled
                    foreign |= names
            elif isinstance(node, ast.FunctionDef | ast.Assign):
                names = {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}
                defined = [node] if isinstance(node, ast.FunctionDef) else node.targets
                uses |= {getattr(one, "name", getattr(one, "id", "")): names for one in defined}
        used = {one for one, names in uses.items() if names & ours}
        while more := {inner for one in used for inner in uses.get(one, ())} - used:
            used |= more
        assert not used & foreign, name
