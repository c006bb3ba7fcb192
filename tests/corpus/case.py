"""A case of the corpus: bad input, the commands that get it, and what must come of it."""

import contextlib
import functools
import io
import os
import re
import shlex
import tracemalloc
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import typer.main

import unbend
from unbend.cli import app

from .good import Command, store

# What a command that refuses its input may take beside the input itself. Any size that a file of
# ours claims and does not have is far beyond it.
MOST_BYTES = 48 * 2**20

Maker = Callable[[Path], object]


class Seen(NamedTuple):
    """What a command left: where, with which exit code, and what it said."""

    folder: Path
    code: int
    out: str
    err: str


Run = Callable[[Path, Command], Seen]


@dataclass(frozen=True)
class Refused:
    """Exit code 2 and one sentence, which names the file and matches a pattern; no file written."""

    sentence: str
    names: str = "bad."
    code: int = 2

    def __str__(self) -> str:
        return f"exit code {self.code}, one sentence"


@dataclass(frozen=True)
class Answer:
    """Exit code 0, if no other is given, and the answer that the mended files give.

    The comparison gets what came of the bad files and of the mended ones, asserts that they are
    alike, and returns how far apart they are, in words.
    """

    mended: Maker
    compare: Callable[[Seen, Seen], str]
    words: str = "the answer of the mended mesh"
    code: int = 0

    def __str__(self) -> str:
        return self.words


@dataclass(frozen=True)
class Case:
    """One row of the table.

    Attributes
    ----------
    name : str
        What is bad, in words; no two cases have the same.
    make : callable
        Writes the files into an empty folder.
    commands : tuple of commands
        Each is run in the folder, and each must come out alike.
    expected : Refused or Answer
    run : callable
        Runs a command in a folder; in this process unless it needs one of its own.
    """

    name: str
    make: Maker
    commands: tuple[Command, ...]
    expected: Refused | Answer
    run: Run | None = None


def here(folder: Path, command: Command) -> Seen:
    """Run a command in a folder, in this process."""
    with contextlib.chdir(folder):
        return Seen(folder, *run(command))


def run(command: Command) -> tuple[int, str, str]:
    """Run a command where we are, and give what is `Seen`; what it does not catch is raised."""
    words = [store() if word == "STORE" else word for word in shlex.split(command)]
    out, err = io.StringIO(), io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("error")
        try:
            _unbend().main(words, "unbend")
        except SystemExit as end:
            code = end.code
        except Exception as error:
            raise AssertionError(f"{command}: a traceback") from error
    assert isinstance(code, int), code
    return code, out.getvalue(), err.getvalue()


@functools.cache
def _unbend() -> Any:
    """Make the command line once: that takes longer than most commands here."""
    return typer.main.get_command(app)


def try_case(case: Case, folder: Path) -> str:
    """Run a case in an empty folder; raise AssertionError, or tell what was seen."""
    bad = folder / "given"
    bad.mkdir()
    case.make(bad)
    how = case.run or here
    if isinstance(case.expected, Answer):
        mended = folder / "mended"
        mended.mkdir()
        case.expected.mended(mended)
    seen = ""
    for command in case.commands:
        if isinstance(case.expected, Refused):
            seen = _refused(case.expected, how, bad, command)
        else:
            seen = _answered(case.expected, how, bad, mended, command)
    return seen


def _refused(expected: Refused, how: Run, folder: Path, command: Command) -> str:
    before = _files(folder)
    _load()  # what is loaded for it is not the input's doing
    if how is here:
        tracemalloc.start()
    try:
        seen = how(folder, command)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert seen.code == expected.code, f"{command}: {seen}"
    lines = seen.err.removesuffix("\n").split("\n")
    assert len(lines) == 1, f"{command}: more than one sentence: {seen.err}"
    assert lines[0].startswith("error: "), f"{command}: {seen.err!r}"
    assert expected.names in lines[0], f"{command}: {lines[0]!r} does not name {expected.names}"
    assert re.search(expected.sentence, lines[0]), f"{command}: {lines[0]!r}"
    assert seen.out == "", f"{command}: {seen.out!r}"
    assert _files(folder) == before, f"{command}: files were left"
    assert peak < MOST_BYTES, f"{command}: {peak} bytes were taken"
    return lines[0].removeprefix("error: ")


def _answered(expected: Answer, how: Run, bad: Path, mended: Path, command: Command) -> str:
    seen = how(bad, command)
    assert seen.code == expected.code, f"{command}: {seen}"
    assert "Traceback" not in seen.err, f"{command}: {seen.err}"
    _check_whole(bad)
    truth = here(mended, command)
    assert truth.code == 0, f"{command} on the mended files: {truth}"
    return expected.compare(seen, truth)


@functools.cache
def _load() -> None:
    """Load what commands do, once: traced, that takes seconds."""
    store()
    unbend.report.new_figure(1, 1)


def _files(folder: Path) -> dict[str, int]:
    """All that is below a folder, and the sizes of files."""
    return {
        os.path.join(where, name): os.lstat(os.path.join(where, name)).st_size
        for where, folders, files in os.walk(folder)
        for name in (*folders, *files)
    }


def _check_whole(folder: Path) -> None:
    left = list(folder.rglob("*.part"))
    assert not left, f"half-written: {left}"
