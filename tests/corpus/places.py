"""Where files are, and where they go: folders, links, pipes, names, full disks."""

import contextlib
import functools
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import unittest
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import unbend
from unbend import write_mesh

from .case import Answer, Case, Refused, Seen, here, run
from .good import Command, beside, in_turn, reading, stone

PATIENCE = 300  # seconds after which a command hangs
_BEGIN = (sys.executable, "-c", "from unbend.cli import main; main()")
_NOBODY = 65534
_DISTANCE = "distance bad.off --from 0 --distance biharmonic -o field.npy --no-cache"


def cases() -> Iterator[Case]:
    """Give a case for each kind of place."""
    yield from _inputs()
    yield from _names()
    yield from _drawn()
    yield from _outputs()
    yield from _full_disks()
    yield from _streams()


def alone(folder: Path, command: Command, *, shell: str = "{}") -> Seen:
    """Run a command in a process of its own, perhaps as part of a line of the shell."""
    line = shell.format(shlex.join([*_BEGIN, *shlex.split(command)]))
    return _started(folder, "bash", "-c", line)


def _started(folder: Path, *words: str) -> Seen:
    # As a terminal that is strict about text, which most are.
    source = Path(unbend.__file__).parents[1]
    environment = os.environ | {"PYTHONIOENCODING": "utf-8:strict", "PYTHONPATH": str(source)}
    done = subprocess.run(words, cwd=folder, capture_output=True, timeout=PATIENCE, env=environment)
    out, err = (text.decode(errors="replace") for text in (done.stdout, done.stderr))
    return Seen(folder, done.returncode, out, err)


def _made(*names: str, make: Callable[[Path], object]) -> Callable[[Path], None]:
    def make_all(folder: Path) -> None:
        beside(folder)
        for name in names:
            make(folder / name)

    return make_all


def _sparse(path: Path) -> None:
    """Make a file of 8 TB that takes no room."""
    with path.open("wb") as file:
        file.truncate(2**43)


def _inputs() -> Iterator[Case]:
    kinds: tuple[tuple[str, Callable[[Path], object], str], ...] = (
        ("a folder", Path.mkdir, "it is a folder"),
        ("a pipe that nobody writes to", os.mkfifo, "not a regular file"),
        ("a link to an endless device", lambda path: path.symlink_to("/dev/zero"), "not a regular"),
        ("a link to nothing", lambda path: path.symlink_to("nowhere.off"), "no such file"),
        ("a link to itself", lambda path: path.symlink_to(path.name), "cannot read bad.off"),
        ("not there", lambda path: None, "no such file"),
        ("8 TB", _sparse, "it has 8,192.0 GiB"),
    )
    for i, (name, make, sentence) in enumerate(kinds):
        commands = in_turn(reading("bad.off"), i)
        yield Case(f"input, {name}", _made("bad.off", make=make), commands, Refused(sentence))
    for name, suffix, line in (
        ("map", ".txt", "register good.off good.off --map bad.txt -o out.ply"),
        ("match", ".npz", "register good.off good.off --map bad.npz -o out.ply"),
        (
            "values",
            ".csv",
            "transfer good.off good.off --map map.txt --values bad.csv -o out.npy",
        ),
        ("landmarks", ".csv", "match good.off good.off --landmarks bad.csv"),
        ("labels", ".csv", "collection evaluate STORE bad.csv"),
    ):
        yield Case(
            f"input, a pipe as {name}",
            _made(f"bad{suffix}", make=os.mkfifo),
            (line,),
            Refused("not a regular file"),
        )
    yield Case(
        "input, not for us to read",
        _made("bad.off", make=_closed),
        ("check bad.off",),
        Refused("cannot read bad.off: Permission denied"),
        _as_nobody,
    )
    yield Case(
        "input, in a folder not for us to look into",
        _made("bad.closed", make=_closed_folder),
        ("check bad.closed/in.off",),
        Refused("cannot read bad.closed/in.off: Permission denied"),
        _as_nobody,
    )
    yield Case(
        "input, a link to a good mesh",
        _made("bad.off", make=lambda path: path.symlink_to("good.off")),
        (_DISTANCE,),
        Answer(_made("bad.off", make=_write_stone), _same_bytes("field.npy"), "its answer"),
    )


def _write_stone(path: Path) -> None:
    write_mesh(path, stone())


def _closed(path: Path) -> None:
    _write_stone(path)
    path.chmod(0)


def _closed_folder(path: Path) -> None:
    path.mkdir()
    path.chmod(0)


def _as_nobody(folder: Path, command: Command) -> Seen:
    """Run without what root may do; others have not got it in the first place."""
    if _bound():
        return here(folder, command)
    if not hasattr(os, "setresuid"):
        raise unittest.SkipTest("no permission binds this user, who cannot be another for a while")
    with tempfile.TemporaryDirectory() as other:  # loads modules, which may be closed to others
        shutil.copytree(folder, other, dirs_exist_ok=True)
        here(Path(other), command)
    for path in (folder, *folder.rglob("*")):
        os.chown(path, _NOBODY, _NOBODY, follow_symlinks=False)
    groups, user, group = os.getgroups(), os.getresuid(), os.getresgid()
    with contextlib.chdir(folder):  # which the other user may not be able to come to
        try:
            os.setgroups([])
            os.setresgid(_NOBODY, _NOBODY, -1)
            os.setresuid(_NOBODY, _NOBODY, -1)
            code, out, err = run(command)
        except PermissionError as error:
            raise unittest.SkipTest("root may not become another user here") from error
        finally:
            os.setresuid(*user)
            os.setresgid(*group)
            os.setgroups(groups)
    return Seen(folder, code, out, err)


def _bound() -> bool:
    """Whether permissions bind us, as they do not bind root."""
    with tempfile.NamedTemporaryFile() as file:
        os.chmod(file.name, 0)
        return not os.access(file.name, os.R_OK)


def _same_bytes(name: str) -> Callable[[Seen, Seen], str]:
    def compare(seen: Seen, truth: Seen) -> str:
        assert (seen.folder / name).read_bytes() == (truth.folder / name).read_bytes()
        return "the same to the last bit"

    return compare


def _names() -> Iterator[Case]:
    for words, name in (
        ("a line break and an escape", "bad.\n\x1b[31m.off"),
        ("markup", "bad.[bold]<script>.off"),
        ("300 letters", "bad." + "x" * 300 + ".off"),
        ("bytes that are no text", os.fsdecode(b"bad.\xe9\xff.off")),
    ):
        yield Case(
            f"name of {words}, not there",
            beside,
            (f"check {shlex.quote(name)}",),
            Refused("cannot read bad."),
        )
        if len(name) < 255:
            check, canonical = f"check {shlex.quote(name)}", f"canonical {shlex.quote(name)}"
            strict = "bytes" in words
            yield Case(
                f"name of {words}",
                _made(name, make=_write_stone),
                (check,) if strict else (f"{canonical} --no-cache", check),
                Answer(_made(name, make=_write_stone), _printable, "printed harmlessly"),
                alone if strict else None,
            )


def _drawn() -> Iterator[Case]:
    """Draw files whose names matplotlib could take for formulas."""

    def make(folder: Path) -> None:
        beside(folder)
        _write_stone(folder / "bad.$\\frac{$.off")
        (folder / "bad.$\\frac{$.txt").write_bytes((folder / "map.txt").read_bytes())

    name = "'bad.$\\frac{$.off'"
    for command in (
        f"similarity {name} good.off --known-correspondence --matrix --figure out.svg --no-cache",
        "evaluate 'bad.$\\frac{$.txt' good.off truth.txt truth.txt --figure out.svg",
    ):
        yield Case(
            f"name like a formula, drawn by {command.split()[0]}",
            make,
            (command,),
            Answer(make, lambda seen, truth: "a picture", "a picture"),
        )

    yield Case(
        "a backend for drawing that matplotlib has not",
        beside,
        ("canonical good.off --figure bad.png --no-cache",),
        Refused("matplotlib does not start", names="MPLBACKEND"),
        functools.partial(alone, shell="MPLBACKEND=none {}"),
    )


def _printable(seen: Seen, truth: Seen) -> str:
    assert not re.search(r"[\x00-\x09\x0b-\x1f]", seen.out + seen.err), seen
    return "no control characters"


def _outputs() -> Iterator[Case]:
    canonical = "canonical good.off -o {} --no-cache"
    for name, out, make, sentence in (
        ("in a folder that is not there", "bad.d/out.ply", None, "there is no folder"),
        ("a folder", "bad.ply", Path.mkdir, "it is a folder"),
        ("a pipe", "bad.ply", os.mkfifo, "not a regular file"),
        ("of an unknown suffix", "bad.jpg", None, "unknown suffix"),
        ("without a suffix", "bad.", None, "no suffix|unknown suffix"),
        ("in a file, as if it were a folder", "bad.ply/out.ply", _write_stone, "no folder"),
        ("of 300 letters", "bad." + "x" * 300 + ".ply", None, "cannot write"),
    ):
        yield Case(
            f"output, {name}",
            beside if make is None else _made(out.split("/")[0], make=make),
            (
                canonical.format(out),
                f"distance good.off --from 0 -o {out} --no-cache",
                f"register good.off good.off --map map.txt -o {out}",
                f"transfer good.off good.off --map map.txt --values values.csv -o {out}",
            ),
            Refused(sentence),
        )
    yield Case(
        "output, one of the inputs",
        _made("bad.ply", make=_write_stone),
        (
            canonical.format("bad.ply").replace("good.off", "bad.ply"),
            "morph good.off bad.ply --map map.txt -o bad.ply",
        ),
        Refused("is one of the inputs"),
    )
    yield Case(
        "output, in a folder closed to us",
        _made("bad.closed", make=_closed_folder),
        (canonical.format("bad.closed/out.ply"),),
        Refused("cannot write bad.closed/out.ply"),
        _as_nobody,
    )
    yield Case(
        "output, a device",
        beside,
        ("canonical good.off -o /dev/full --no-cache",),
        Refused("cannot write /dev/full", names="/dev/full"),
    )


def _full_disks() -> Iterator[Case]:
    """Let no file grow beyond a few bytes, as on a disk that is full."""
    for command in (
        "canonical good.off -o bad.ply --no-cache",
        "canonical good.off -o bad.npy --no-cache",
        "canonical good.off --report bad.html --no-cache",
        "match good.off good.off --no-refine -o bad.npz --no-cache",
        "evaluate map.txt good.off truth.txt truth.txt --figure bad.png",
        "transfer good.off good.off --map map.txt --values values.csv -o bad.txt",
        "similarity good.off good.off --known-correspondence --csv bad.csv --no-cache",
        "collection export STORE -o bad.parquet",
        "collection export STORE -o bad.csv",
    ):
        what = re.split(" good| STORE| map", command)[0]
        out = re.search(r"bad[.]\w+", command)
        assert out is not None
        yield Case(
            f"full disk, {what} to {Path(out[0]).suffix}",
            beside,
            (command,),
            Refused(f"cannot write {out[0]}: File too large"),
            _on_full_disk,
        )


def _on_full_disk(folder: Path, command: Command) -> Seen:
    import resource

    with tempfile.TemporaryDirectory() as other:  # what is compiled now need not be written later
        beside(Path(other))
        warm = here(Path(other), command)
        assert warm.code == 0, warm
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8, before[1]))
    try:
        return here(folder, command)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def _streams() -> Iterator[Case]:
    yield Case(
        "standard output, full",
        beside,
        ("check good.off --json",),
        Refused("cannot write to standard output: No space left", names="standard output"),
        functools.partial(alone, shell="{} >/dev/full"),
    )
    nothing = Answer(beside, lambda seen, truth: f"exit code {seen.code}, no word", "exit code 141")
    yield Case(
        "standard output, a pipe whose reader is gone",
        beside,
        ("check good.off --json",),
        replace(nothing, code=141),
        functools.partial(alone, shell="{} > >(exec true) 2>err; code=$?; cat err >&2; exit $code"),
    )
    yield Case(
        "standard streams, closed, all three",
        beside,
        ("distance good.off --from 0 -o out.npy --no-cache",),
        Answer(beside, _same_bytes("out.npy"), "the same answer"),
        functools.partial(alone, shell="{} <&- >&- 2>&-"),
    )
    yield Case(
        "two commands that write one file",
        beside,
        ("distance good.off --from 0 -o out.npy --no-cache",),
        Answer(beside, _same_bytes("out.npy"), "the file whole"),
        functools.partial(alone, shell="{0} & {0} && wait $!"),
    )
