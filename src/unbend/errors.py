"""Every error and warning that unbend raises on purpose.

::

    UnbendError                  the root: catch this to catch them all
    ├── InputError               (also ValueError) what was given cannot be used
    │   ├── FileError            a file cannot be read or written
    │   └── MeshError            a mesh breaks a rule; names the vertex or face
    ├── SolverError              (also RuntimeError) a computation did not reach its accuracy
    └── MissingExtraError        (also ImportError) an optional package is not installed
    UnbendWarning                (a UserWarning) the result stands, but something should be known

Messages are one sentence that says what is wrong, where, and what to do. The command line
prints that sentence and exits with code 2.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar


class UnbendError(Exception):
    """Root of all errors raised by unbend."""


class InputError(UnbendError, ValueError):
    """An argument cannot be used as given."""


class FileError(InputError):
    """A file cannot be read or written."""


class MeshError(InputError):
    """A mesh breaks a rule that the computation needs."""


class SolverError(UnbendError, RuntimeError):
    """A numerical computation did not reach the accuracy it promises."""


class MissingExtraError(UnbendError, ImportError):
    """An optional package is needed.

    Parameters
    ----------
    *packages : str
        The missing package, and what else the same extra installs, by their names on the package
        index. (``unbend[extra]`` would be looked up there too, and may be another's package.)
    """

    def __init__(self, *packages: str) -> None:
        super().__init__(f"{packages[0]} is needed for this: pip install {' '.join(packages)}")
        self._given = packages

    def __reduce__(self) -> tuple[type[MissingExtraError], tuple[str, ...]]:
        """Travel between processes by what it was made of, which is not its message."""
        return type(self), self._given


class UnbendWarning(UserWarning):
    """The result stands, but something was done to the input, or a check gave a figure to know."""


_said: ContextVar[list[str] | None] = ContextVar("said", default=None)  # see `heard`


def warn(message: str) -> None:
    """Issue an :class:`UnbendWarning` that points to the line that called unbend."""
    said = _said.get()
    if said is not None:
        if message not in said:
            said.append(message)
        return
    frame, level = sys._getframe(), 1
    while frame.f_back and frame.f_globals.get("__name__", "").split(".")[0] in (
        "unbend",
        "contextlib",
    ):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, UnbendWarning, stacklevel=level)


@contextmanager
def file_errors(task: str) -> Iterator[None]:
    """Say in a FileError what task the system does not let us do, and why."""
    try:
        yield
    except OSError as error:
        raise FileError(f"cannot {task}: {error.strerror or error}") from error


@contextmanager
def heard() -> Iterator[list[str]]:
    """Collect what a block warns of, each once, in a list instead; other threads go on to warn."""
    said: list[str] = []
    token = _said.set(said)
    try:
        yield said
    finally:
        _said.reset(token)
