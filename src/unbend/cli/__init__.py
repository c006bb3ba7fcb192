"""The command line: no numerics. A file has a command, or two.

To add a command, write a function, and add it to `app` below. Its parameters are the arguments and
options. Its docstring, or `_options.HELP`, has their help, and examples, as in ``distance.py``.
Call what is numerical by its full name, as `unbend.match` or `unbend.io.read_map`: it is loaded on
first use, for ``unbend --help`` must not wait for it. End with ``tell(...)``, which prints text or
JSON. Raise :class:`unbend.errors.UnbendError` for anything the user can put right; it is turned
into one sentence and exit code 2 here, in one place.
"""

from __future__ import annotations

import errno
import io
import os
import sys
import threading
import warnings
from _thread import interrupt_main
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from unbend import __version__
from unbend._memory import LIMIT_VARIABLE, available_memory
from unbend.cli import (
    cache,
    canonical,
    check,
    collection,
    demo,
    distance,
    evaluate,
    match,
    morph,
    register,
    similarity,
    transfer,
    view,
)
from unbend.cli._command import make_group
from unbend.cli._output import EXIT_REFUSED, say, show_warning
from unbend.errors import UnbendError, UnbendWarning

_EXIT_INTERRUPTED = 130  # what shells report after Ctrl-C
_AGAIN_SECONDS = 0.05  # after which a Ctrl-C that was ignored comes again
_EXIT_BROKEN_PIPE = 141  # ... and when the reader of a pipe went away
# What writing to a file that others opened for us fails with; our own files are named.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


class _Group(TyperGroup):
    """Turns what a command raises into a sentence and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        try:
            with warnings.catch_warnings():
                warnings.showwarning = show_warning
                warnings.simplefilter("always", UnbendWarning)
                result = super().invoke(ctx)
                if sys.stdout is not None:  # as it is where the shell closed it
                    sys.stdout.flush()  # a closed pipe shows here rather than at exit
                return result
        except UnbendError as error:
            sentence = str(error)
        except MemoryError as error:
            what = f": {error}" if str(error) else ""
            sentence = f"there is too little memory{what}; reduce the mesh to fewer vertices first"
        except KeyboardInterrupt:
            say("interrupted", "no file was left half-written")
            raise typer.Exit(_EXIT_INTERRUPTED) from None
        except OSError as error:
            # Windows has no such error and calls the write itself invalid; files name theirs.
            invalid = error.errno == errno.EINVAL and error.filename is None
            broken = isinstance(error, BrokenPipeError) or (sys.platform == "win32" and invalid)
            if not broken and (error.filename is not None or error.errno not in _NO_ROOM):
                raise
            # Python would flush stdout again at exit, and complain: give it somewhere to write.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            if broken:
                raise typer.Exit(_EXIT_BROKEN_PIPE) from None
            sentence = f"cannot write to standard output: {error.strerror}"
        say("error", sentence)
        raise typer.Exit(EXIT_REFUSED)


app = make_group(
    "Match and compare deformable 3-D shapes in any pose.",
    check.check,
    canonical.canonical,
    distance.distance,
    match.match,
    match.symmetry,
    evaluate.evaluate,
    transfer.transfer,
    register.register,
    morph.morph,
    similarity.similarity,
    view.view,
    view.app,
    demo.demo,
    name="unbend",
    cls=_Group,
    epilog="unbend COMMAND --help explains a command and shows examples. Exit codes: 0, done; 1, "
    "some of several shapes failed; 2, refused, with a sentence; 3, a match is below "
    "--min-confidence.",
    pretty_exceptions_enable=False,
)
app.add_typer(collection.app, name="collection")
app.add_typer(cache.app, name="cache")


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"unbend {__version__}")
        raise typer.Exit


@app.callback()
def _global_options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
    memory_limit: Annotated[
        float | None,
        typer.Option(
            metavar="GIB",
            help="Refuse work that needs more memory than this; by default, than is free.",
        ),
    ] = None,
) -> None:
    """Take the options that come before a command."""
    if memory_limit is not None:
        os.environ[LIMIT_VARIABLE] = str(memory_limit)
        available_memory()  # raises InputError if that is no limit


def _interrupt_again(ignored: Any) -> None:
    """Repeat a Ctrl-C that came where Python ignores errors: the command would go on after it."""
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        threading.Timer(_AGAIN_SECONDS, interrupt_main).start()
    else:
        sys.__unraisablehook__(ignored)


def main() -> None:
    """Run the command line; `unbend.__main__` calls this."""
    # A pipe on Windows, or a name that is no text, has characters that cannot be written as they
    # are: better escaped than an end halfway through.
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    before, sys.unraisablehook = sys.unraisablehook, _interrupt_again
    try:
        app()
    finally:
        sys.unraisablehook = before
