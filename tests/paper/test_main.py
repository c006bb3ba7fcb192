"""``python -m paper``: pages for what can be run, one sentence for what cannot."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from paper import forms, table2
from paper.__main__ import main, parser
from paper.targets import TARGETS
from tests.paper.folders import write_people

ROOT = Path(__file__).parents[2]
PAGES = [*ROOT.glob("docs/reproduction/*/README.md"), *ROOT.glob("*.md")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scape")
    write_people(path / "SCAPE")
    (path / "empty").mkdir()
    (path / "file").write_text("no folder")
    return path


def test_all_runs_what_it_has_shapes_for(folder, monkeypatch, capsys):
    monkeypatch.delitem(TARGETS, "efficiency")  # needs no shapes, but minutes
    monkeypatch.setattr(forms.make_form, "__defaults__", (60,))  # samples
    monkeypatch.setattr(table2, "N_POINTS", 100)
    out = folder / "out"
    assert main(["--data", str(folder), "-o", str(out), "--quick"]) == 0
    printed, told = capsys.readouterr()
    assert [line.split()[0] for line in printed.splitlines()] == ["table2", "index"]
    for name in set(TARGETS) - {"table2"}:
        assert f"note: {name} was not run: {name} needs the shapes of TOSCA: put" in told
    page = (out / "table2" / "README.md").read_text()
    assert "    python -m paper table2 --data DIR -o OUT --quick\n" in page
    assert str(folder) not in page
    assert "Not run: table1." in (out / "README.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("table1", "--data", "nowhere"), "there is no folder nowhere"),
        (("table1", "--data", "{folder}/file"), "there is no folder {folder}/file"),
        (("table1", "--data", "{folder}/empty"), "{folder}/empty holds no shapes of TOSCA"),
        (("table1", "--data", "{folder}"), "table1 needs the shapes of TOSCA"),
        (("table2", "--jobs", "0"), "--jobs must be at least 1, not 0"),
    ],
)
def test_a_mistake_gets_one_sentence(folder, tmp_path, arguments, words, capsys):
    filled = [word.format(folder=folder) for word in arguments]
    assert main([*filled, "-o", str(tmp_path / "out")]) == 2
    printed, told = capsys.readouterr()
    assert not printed
    assert [line for line in told.splitlines() if line.startswith("error: ")] == [
        line for line in told.splitlines() if words.format(folder=folder) in line
    ]
    assert not list((tmp_path / "out").glob("*.md"))


def test_it_runs_as_a_module_of_a_clone():
    command = [sys.executable, "-m", "paper", "table1", "--data", "nowhere"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("error: there is no folder nowhere")


@pytest.mark.parametrize("page", PAGES, ids=lambda one: one.relative_to(ROOT).as_posix())
def test_commands_on_a_page_are_read(page):
    text = page.read_text("utf-8")
    written = re.findall(r"^    python -m paper (.*)$", text, re.MULTILINE)
    written += re.findall(r'^    make reproduce ARGS="(.*?)"', text, re.MULTILINE)
    assert written or page.parent == ROOT
    for words in written:
        parser().parse_args(shlex.split(words))
