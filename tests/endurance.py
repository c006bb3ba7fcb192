"""Interrupts, crowds and long runs: ``PYTHONPATH=tests python tests/endurance.py WHAT``.

``interrupts`` ends commands at random moments, by Ctrl-C and by ``kill -9``; ``crowd`` lets many
processes use one cache and one collection at once; ``soak`` computes thousands of forms and
hundreds of matches in one process and prints its memory and threads.
"""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import unbend
from corpus.good import beside, stone, store

BEGIN = (sys.executable, "-c", "from unbend.cli import main; main()")
# Commands by the file that they write.
COMMANDS = {
    "form.ply": "canonical good.off -o form.ply",
    "form.html": "canonical good.off --report form.html",
    "field.npy": "distance good.off --from 0 --n-eigenpairs 20 -o field.npy",
    "map.npz": "match good.off good.off -o map.npz",
    "fitted.obj": "register good.off good.off --map map.txt -o fitted.obj",
    "carried.csv": "transfer good.off good.off --map map.txt --values values.csv -o carried.csv",
    "table.csv": "similarity good.off good.off --known-correspondence --csv table.csv",
    "curves.svg": "evaluate map.txt --target good.off --source-truth truth.txt "
    "--target-truth truth.txt --figure curves.svg",
    "shapes.parquet": "collection export STORE -o shapes.parquet",
    "groups.csv": "collection groups STORE -n 2 --csv groups.csv",
}


def start(folder: Path, command: str) -> subprocess.Popen[bytes]:
    """Begin a command in a process of its own, with a cache in the folder."""
    words = [store() if word == "STORE" else word for word in shlex.split(command)]
    environment = os.environ | {
        "PYTHONPATH": str(Path(unbend.__file__).parents[1]),
        "UNBEND_CACHE_DIR": str(folder / "cache"),
    }
    return subprocess.Popen(
        [*BEGIN, *words],
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def interrupt(name: str, command: str, by: signal.Signals, moments: Sequence[float]) -> list[int]:
    """End a command at moments given as shares of its time; what it leaves must be whole.

    Returns
    -------
    list of int
        Exit codes.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        beside(folder)
        begin = time.monotonic()
        assert start(folder, command).wait() == 0, command
        seconds = time.monotonic() - begin
        whole = (folder / name).read_bytes()
        size = len(whole)
        codes = []
        for moment in moments:
            (folder / name).unlink(missing_ok=True)
            process = start(folder, command)
            try:
                process.wait(moment * seconds)
            except subprocess.TimeoutExpired:
                process.send_signal(by)
            codes.append(process.wait())
            if (folder / name).exists():  # times and the like may differ, by no more than this
                assert abs((folder / name).stat().st_size - size) < 0.1 * size + 64, name
            if by == signal.SIGINT:
                assert not list(folder.rglob("*.part")), command
        (folder / name).unlink(missing_ok=True)
        assert start(folder, command).wait() == 0, f"{command}, after it was ended"
        assert abs((folder / name).stat().st_size - size) < 0.1 * size + 64, name
        return codes


def interrupts(rounds: int) -> None:
    """End every command at random moments, in both ways."""
    draw = np.random.default_rng(0)
    for name, command in COMMANDS.items():
        for by in (signal.SIGINT, signal.SIGKILL):
            codes = interrupt(name, command, by, draw.uniform(0.1, 1.0, rounds).tolist())
            print(f"{by.name:8} {command.split(' -')[0]:40} exit codes {codes}", flush=True)


def crowd(number: int) -> None:
    """Let many processes compute the same spectra and add to one collection, at once."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        beside(folder)
        field = COMMANDS["field.npy"]
        several = [
            start(folder, field.replace("field.npy", f"field{i}.npy")) for i in range(number)
        ]
        assert [one.wait() for one in several] == [0] * number
        found = {(folder / f"field{i}.npy").read_bytes() for i in range(number)}
        assert len(found) == 1
        assert len(list((folder / "cache").glob("*.npz"))) == 1
        assert not list((folder / "cache").glob(".*"))
        print(f"{number} processes, one cache: the same field from all, one file", flush=True)
        code = (
            "import sys\nfrom unbend import Collection\n"
            "done = Collection('store').add(sys.argv[1:], workers=0)\n"
            "assert not done.failures, done.failures\n"
        )
        meshes = []
        for i in range(number):
            meshes.append(f"shape{i}.off")
            unbend.write_mesh(
                folder / meshes[-1], (stone().vertices * (1, 1, 1 + i), stone().faces)
            )
        several = [
            subprocess.Popen([sys.executable, "-c", code, one, "good.off"], cwd=folder)
            for one in meshes
        ]
        assert [one.wait() for one in several] == [0] * number
        shapes = unbend.Collection(folder / "store")
        assert len(shapes) == number + 1, len(shapes)
        assert len({entry.path for entry in shapes}) == number + 1
        print(f"{number} processes, one collection: {len(shapes)} shapes, none twice", flush=True)


def soak(n_forms: int, n_matches: int) -> None:
    """Compute in one process, and print what it holds now and then."""
    draw = np.random.default_rng(0)

    def another() -> unbend.Mesh:
        return unbend.Mesh(stone().vertices * draw.uniform(0.8, 1.2, 3), stone().faces)

    print("done             resident MiB  threads", flush=True)
    for what, count in (("forms", n_forms), ("matches", n_matches)):
        for i in range(count):
            if what == "forms":
                unbend.canonical_form(another(), cache=False)
            else:
                unbend.match(another(), stone(), cache=False)
            if i % max(count // 10, 1) == 0 or i == count - 1:
                print(f"{i + 1:6} {what:8} {_resident():12.1f} {_threads():8}", flush=True)


def _status(key: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith(key)).split()[1])


def _resident() -> float:
    return _status("VmRSS:") / 1024


def _threads() -> int:
    return _status("Threads:")


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("interrupts", "crowd", "soak"))
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--processes", type=int, default=20)
    parser.add_argument("--forms", type=int, default=2000)
    parser.add_argument("--matches", type=int, default=500)
    asked = parser.parse_args()
    if asked.what == "interrupts":
        interrupts(asked.rounds)
    elif asked.what == "crowd":
        crowd(asked.processes)
    else:
        soak(asked.forms, asked.matches)


if __name__ == "__main__":
    main()
