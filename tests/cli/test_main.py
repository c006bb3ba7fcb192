"""The command line as a whole: help is quick, mistakes are one sentence, tracebacks are bugs."""

import errno
import json
import os
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

import unbend.__main__
from every_command import every_command
from terminal import invoke
from unbend import Mesh, write_mesh
from unbend._memory import LIMIT_VARIABLE
from unbend._text import quoted
from unbend.cli import _output, app, main
from unbend.datasets import make_sphere
from unbend.errors import MeshError, UnbendWarning


@pytest.fixture
def run_command(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], None]], object]:
    """Run a function as if it were a command."""

    def run(function: Callable[[], None]) -> object:
        monkeypatch.setattr(app, "registered_commands", list(app.registered_commands))
        app.command("try")(function)
        return CliRunner().invoke(app, ["try"])

    return run


def test_help_imports_no_numerics() -> None:
    code = (
        "import sys\nfrom unbend.cli import main\n"
        "try: main()\nexcept SystemExit as e: assert not e.code\n"
        "heavy = {'numpy', 'scipy', 'trimesh', 'numba', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code, "--help"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "check" in done.stdout


def test_without_arguments_help_is_shown() -> None:
    for words in ([], ["collection"], ["cache"]):
        assert "Commands" in invoke(words).output


@pytest.mark.parametrize("words", [words for words, _ in every_command()], ids=" ".join)
def test_every_command_shows_examples(words: tuple[str, ...]) -> None:
    result = invoke([*words, "--help"])
    assert result.exit_code == 0
    assert invoke([*words, "-h"]).output == result.output
    lines = [line.strip() for line in result.output.splitlines()]
    example = lines[lines.index("Examples:") + 1]
    assert example.split()[: len(words) + 1] == ["unbend", *words]


def test_a_memory_limit_refuses_with_both_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, blob: Mesh
) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "1")  # what the option sets goes with the test
    write_mesh(tmp_path / "blob.off", blob)
    arguments = ["canonical", str(tmp_path / "blob.off"), "--no-cache"]
    done = invoke(["--memory-limit", "64", *arguments])
    assert done.exit_code == 0
    done = invoke(["--memory-limit", "0.01", *arguments])
    assert done.exit_code == 2
    assert "MiB of memory and 0 MiB are free" in done.stderr
    assert done.stderr.count("\n") == 1
    for wrong in ("-1.0", "nan", "inf"):  # said also where little memory is needed
        done = invoke(["--memory-limit", wrong, "check", str(tmp_path / "blob.off")])
        assert (done.exit_code, done.stdout) == (2, "")
        assert f"must be a number of GiB above 0, not '{wrong}'" in done.stderr


def test_version() -> None:
    assert invoke(["--version"]).output == f"unbend {unbend.__version__}\n"


def test_an_unknown_command() -> None:
    assert invoke(["chek"]).exit_code == 2


def test_mistakes_are_one_sentence(run_command: Callable[..., object]) -> None:
    def fail() -> None:
        raise MeshError("cat.off: vertex 3 is not finite")

    result = run_command(fail)
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr == "error: cat.off: vertex 3 is not finite\n"


@pytest.mark.parametrize("what", [": Unable to allocate 9 TiB for an array", ""])
def test_too_little_memory_is_one_sentence(run_command: Callable[..., object], what: str) -> None:
    def starve() -> None:
        raise MemoryError(*([what[2:]] if what else []))

    result = run_command(starve)
    assert result.exit_code == 2
    expected = f"error: there is too little memory{what}; reduce the mesh to fewer vertices first\n"
    assert result.stderr == expected


def test_an_interruption_is_one_line(run_command: Callable[..., object]) -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    result = run_command(interrupt)
    assert result.exit_code == 130
    assert result.stderr == "interrupted: no file was left half-written\n"


def test_warnings_are_one_line(run_command: Callable[..., object]) -> None:
    def warn() -> None:
        warnings.simplefilter("always")
        warnings.warn("3 vertices were dropped", UnbendWarning, stacklevel=1)
        warnings.warn("of other origin", RuntimeWarning, stacklevel=1)

    result = run_command(warn)
    assert result.stderr == (
        "warning: 3 vertices were dropped\nwarning (RuntimeWarning): of other origin\n"
    )


def test_bugs_stay_tracebacks(run_command: Callable[..., object]) -> None:
    def bug() -> None:
        raise ZeroDivisionError

    assert isinstance(run_command(bug).exception, ZeroDivisionError)


def test_a_closed_pipe_is_quiet() -> None:
    code = (
        "import typer, unbend.cli as c\n"
        "@c.app.command()\ndef many():\n"
        "    for i in range(100_000): typer.echo(i)\n"
        "c.main()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, "many"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait() == 141


def test_an_interruption_before_a_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(typer.Typer, "__call__", interrupt)
    with pytest.raises(SystemExit) as caught:
        unbend.__main__.main()
    assert caught.value.code == 130


def test_json_has_no_nan(capsys: pytest.CaptureFixture[str]) -> None:
    result = {"a": np.array([1.5, np.nan]), "b": (np.int64(3), float("inf")), "c": "x"}
    _output.begin(as_json=True, quiet=False)
    _output.tell(result, [])
    told = json.loads(capsys.readouterr().out)
    assert {name: told[name] for name in "abc"} == {"a": [1.5, None], "b": [3, None], "c": "x"}


@pytest.mark.parametrize("quiet", [False, True])
def test_quiet_leaves_results_and_warnings(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, quiet: bool
) -> None:
    monkeypatch.setattr(_output, "_SECONDS_BETWEEN_LINES", -1.0)
    shape = Mesh(np.zeros((1, 3)), notes=("one", "two"))
    _output.begin(as_json=False, quiet=quiet)
    _output.progress("3 of 4 shapes", 0.75)
    _output.say("warning", "three")
    _output.tell({}, ["found"], shapes=[shape], written=["a.npz", None], next_step="look")
    captured = capsys.readouterr()
    hints = "" if quiet else "next: look\n"
    assert captured.out == f"found\nwritten: a.npz\n{hints}"
    notes = ["note: mesh: one", "note: mesh: two"]
    lines = ["progress: 3 of 4 shapes, 75%", "warning: three", *notes]
    assert captured.err.splitlines() == (lines[1:2] if quiet else lines)


def test_a_person_gets_a_bar(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(_output.sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "200")
    for quiet in (False, True):
        _output.begin(as_json=False, quiet=quiet)
        _output.progress("3 of 4 [shapes]", 0.75)
        _output.end_progress()
        said = capsys.readouterr().err
        assert ("75%  3 of 4 [shapes]" in said) != quiet
        assert quiet or said.replace("━", "").replace("╸", "").replace("╺", "").isascii()


def test_tables_are_aligned_column_by_column() -> None:
    lines = _output.table("<>", ("name", "n"), ("a", "10"), ("abcde", "7"))
    assert lines == ["name    n", "a      10", "abcde   7"]


def test_it_runs_as_a_script_and_as_a_module() -> None:
    script = shutil.which("unbend", path=Path(sys.executable).parent)
    done = subprocess.run([script, "--version"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, f"unbend {unbend.__version__}\n")
    module = [sys.executable, "-m", "unbend", "collection", "none"]
    refused = subprocess.run(module, capture_output=True, text=True)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert "No such command 'none'" in refused.stderr


def test_shells_can_complete_commands_and_options(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["unbend"])
    # python -m pytest makes it a module's program, which no shell completes.
    monkeypatch.setattr(sys.modules["__main__"], "__package__", "")
    monkeypatch.setenv("_UNBEND_COMPLETE", "complete_bash")
    for typed, expected in (("unbend can", {"canonical"}), ("unbend match --par", {"--partial"})):
        monkeypatch.setenv("COMP_WORDS", typed)
        monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
        with pytest.raises(SystemExit) as end:
            main()
        assert not end.value.code
        assert set(capsys.readouterr().out.split()) == expected


@pytest.mark.parametrize(
    ("platform", "filename", "code"),
    [("win32", None, 141), ("win32", "a|b.off", 1), ("linux", None, 1)],
)
def test_a_closed_pipe_is_quiet_on_windows_too(
    platform: str, filename: str | None, code: int
) -> None:
    program = (
        "import sys, unbend.cli as c\n"
        "@c.app.command()\ndef write():\n"
        f"    sys.platform = {platform!r}\n"
        f"    raise OSError({errno.EINVAL}, 'Invalid argument', {filename!r})\n"
        "c.main()"
    )
    done = subprocess.run([sys.executable, "-c", program, "write"], capture_output=True)
    assert (done.returncode, done.stderr == b"") == (code, code == 141)


def test_what_a_pipe_cannot_encode_is_escaped(tmp_path: Path) -> None:
    # What Windows gives a pipe in western Europe, which has no Greek.
    environment = os.environ | {"PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"}
    write_mesh(tmp_path / "Ω.off", make_sphere(1))
    command = [sys.executable, "-m", "unbend", "check", "Ω.off"]
    done = subprocess.run(command, capture_output=True, cwd=tmp_path, env=environment)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"\\u03a9.off" in done.stdout


def test_commands_are_quoted_as_the_shell_takes_them(monkeypatch: pytest.MonkeyPatch) -> None:
    assert quoted("unbend", "my cat.off") == "unbend 'my cat.off'"
    monkeypatch.setattr(sys, "platform", "win32")
    assert quoted("unbend", "my cat.off") == 'unbend "my cat.off"'


def test_an_interruption_that_python_has_to_ignore_comes_again() -> None:
    """In the callback of a weak reference, say, of which matplotlib has many."""
    code = """
import signal, time, weakref
signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background ignores it
from unbend import cli

class Held:
    pass

@cli.app.command("try")
def interrupted():
    held = Held()
    kept = weakref.ref(held, lambda _: signal.raise_signal(signal.SIGINT))
    del held
    for _ in range(200):
        time.sleep(0.1)  # only between two of them is it seen
    print("went on")

cli.main()
"""
    done = subprocess.run([sys.executable, "-c", code, "try"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr == "interrupted: no file was left half-written\n"


def test_an_interruption_while_it_is_imported() -> None:
    code = """
import runpy, sys

class Interrupted:
    def find_spec(self, name, *_):
        if name == "typer":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupted())
runpy.run_module("unbend", run_name="__main__")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
