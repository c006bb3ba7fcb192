"""Every output that a command is asked for is written and named, whatever else it is asked for."""

import json
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import pytest

from every_command import every_command
from stones import write_pair
from terminal import invoke
from unbend.cli._options import written

# Options that take text: what each writes, and those that are read or are no files.
OUTPUTS = {
    "--colored": "colored1.glb colored2.ply",
    "--csv": "table.csv",
    "--figure": "figure.png",
    "--out": "out{}",
    "--report": "page.html",
    "--thumbnail": "thumbnail.png",
}
INPUTS = {
    *("--collection", "--data", "--labels", "--landmarks", "--map", "--pairs", "--template"),
    *("--values", "--truth", "--mirrored-truth", "--component", "--property", "--scheduler"),
}
# An output that needs a match to be made, which takes long: tests of match, register and transfer.
APART = {"--save-match", "--expected-error"}
# A line for each command that has outputs, with the suffix of its OUT.
LINES = {
    "canonical a.ply --no-cache": ".ply",
    "distance a.ply --from 0 --no-cache": ".npy",
    "match a.ply b.ply --no-refine --no-cache": ".npz",
    "symmetry a.ply --no-refine --no-cache": ".csv",
    "morph a.ply b.ply --map map.txt": ".ply",
    "evaluate map.txt a.ply map.txt map.txt": "",
    "transfer a.ply b.ply --map map.txt --values values.csv": ".ply",
    "register a.ply b.ply --map map.txt": ".obj",
    "view a.ply --no-open": ".html",
    "similarity a.ply b.ply --known-correspondence --matrix --no-cache": "",
    "collection search STORE a.ply": "",
    "collection matrix STORE": "",
    "collection groups STORE -n 2": "",
    "collection export STORE": ".csv",
    "collection info STORE a.ply": "",
}
# One output each, in tests of their own.
ELSEWHERE = {"demo", "collection match", "collection register", "collection mean"}


def options(command: Any) -> dict[str, Any]:
    """Options that take text of any kind, by their long names."""
    hints = get_type_hints(command.callback)
    text = {str, str | None, tuple[str, str] | None}
    return {
        max(one.opts, key=len): one
        for one in command.params
        if one.param_type_name == "option" and hints.get(one.name) in text
    }


def line_of(words: tuple[str, ...]) -> str | None:
    found = [line for line in LINES if tuple(line.split()[: len(words)]) == words]
    return found[0] if found else None


def with_outputs(line: str, chosen: list[str], folder: Path) -> tuple[list[str], list[str]]:
    """Give the words of a command line with these outputs, and their files."""
    arguments, files = shlex.split(line.replace("STORE", "store")), []
    for name in chosen:
        paths = [str(folder / one) for one in OUTPUTS[name].format(LINES[line]).split()]
        arguments += [name, *paths]
        files += paths
    return arguments, files


def combinations() -> Iterator[tuple[str, list[str], list[str]]]:
    """Give each command line, the outputs that it needs and those that it can have."""
    for words, command in every_command():
        if line := line_of(words):
            outputs = {name: one for name, one in options(command).items() if name in OUTPUTS}
            must = [name for name, one in outputs.items() if one.required]
            yield line, must, [name for name in outputs if name not in must]


EACH_ALONE = [
    (line, [*must, *one])
    for line, must, may in combinations()
    for one in [[name] for name in may] or [[]]
    if must or one
]
ALL_TOGETHER = [(line, [*must, *may]) for line, must, may in combinations() if must or may]


def words_of(given: str | list[str]) -> str:
    return given if isinstance(given, str) else " ".join(given)


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two shapes, a store of them, and what else is read."""
    folder = tmp_path_factory.mktemp("outputs")
    write_pair(folder)
    return folder


def test_every_option_that_takes_text_is_known_and_every_output_tried() -> None:
    for words, command in every_command():
        for name, one in options(command).items():
            assert name in OUTPUTS.keys() | INPUTS | APART, f"{words}: does {name} read or write?"
            assert (name in INPUTS) != (one.name in written()), f"{words}: {name} in written()"
            tried = line_of(words) is not None or " ".join(words) in ELSEWHERE
            assert name not in OUTPUTS or tried, f"{words} has no line in LINES"


@pytest.mark.parametrize(("line", "chosen"), EACH_ALONE, ids=words_of)
def test_each_output_is_written_and_named(
    given: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, chosen: list[str]
) -> None:
    monkeypatch.chdir(given)
    arguments, files = with_outputs(line, chosen, tmp_path)
    done = invoke(arguments)
    assert done.exit_code == 0, done.output
    for path in files:
        assert path in done.stdout, f"{path} is not named"
        assert Path(path).is_dir() or Path(path).stat().st_size > 0, path


@pytest.mark.parametrize(("line", "chosen"), ALL_TOGETHER, ids=words_of)
def test_all_outputs_together_are_written_and_named_in_the_json(
    given: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str, chosen: list[str]
) -> None:
    monkeypatch.chdir(given)
    arguments, files = with_outputs(line, chosen, tmp_path)
    told = json.loads(invoke([*arguments, "--json"]).stdout)
    assert sorted(told["written"]) == sorted(files)
    for path in files:
        assert Path(path).is_dir() or Path(path).stat().st_size > 0, path
