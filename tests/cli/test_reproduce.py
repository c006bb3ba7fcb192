"""``unbend reproduce``: pages for what can be run, a sentence for what cannot."""

import json
import typing
from pathlib import Path

import pytest
from tests.reproduce.folders import write_people
from typer.testing import CliRunner

from unbend.choices import Experiment
from unbend.cli import app
from unbend.reproduce.targets import TARGETS


def run(*arguments):
    return CliRunner().invoke(app, ["reproduce", *map(str, arguments)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("scape")
    write_people(path / "SCAPE")
    return path


def test_every_experiment_can_be_asked_for():
    assert typing.get_args(Experiment) == (*TARGETS, "all")
    assert "Figure 2" in run("--help").stdout


def test_all_runs_what_it_has_shapes_for(folder, monkeypatch):
    monkeypatch.delitem(TARGETS, "efficiency")  # needs no shapes, but minutes
    out = folder / "out"
    done = run("all", "--data", folder, "-o", out, "--quick", "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert set(told["pages"]) == {"table2"}
    assert set(told["not_run"]) == set(TARGETS) - {"table2"}
    assert "folder TOSCA" in told["not_run"]["table1"]
    page = (out / "table2" / "README.md").read_text()
    assert "    unbend reproduce table2 --data DIR -o OUT --quick\n" in page
    assert str(folder) not in page
    assert "Not run: table1." in (out / "README.md").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("table1", "--data", "nowhere"), "there is no folder nowhere"),
        (("table1", "--data", "{scape}"), "table1 needs the shapes of TOSCA"),
        (("table2", "--data", "synthetic", "--jobs", "0"), "--jobs must be at least 1"),
    ],
)
def test_a_mistake_gets_one_sentence(folder, tmp_path, arguments, words):
    filled = [word.format(scape=folder) for word in arguments]
    done = run(*filled, "-o", tmp_path / "out")
    assert done.exit_code == 2
    assert [line for line in done.stderr.splitlines() if line.startswith("error: ")] == [
        line for line in done.stderr.splitlines() if words in line
    ]
    assert not list((tmp_path / "out").glob("*.md"))
