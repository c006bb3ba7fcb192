"""Interrupts, crowds and long runs: ``PYTHONPATH=tests python tests/endurance.py WHAT``.

``interrupts`` ends commands at random moments, by Ctrl-C and by ``kill -9``; ``crowd`` lets many
processes use one cache and one collection at once; ``kernels`` lets as many begin with one empty
folder for compiled code, three times over; ``soak`` computes thousands of forms and
hundreds of matches in one process and prints its memory and threads; ``memory`` gives commands too
little of it; ``quota`` runs some under half a processor, where control groups can be made; ``bits``
matches one pair in many processes, several at a time, and compares the results byte by byte.
"""

import argparse
import functools
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import unbend
from corpus.good import beside, stone, store
from unbend.datasets import make_biped
from unbend.spectral import use_cache

BEGIN = (sys.executable, "-m", "unbend")
FIELD = "distance good.off --from 0 --distance biharmonic --n-eigenpairs 20 -o field.npy"
# Every command that writes. STORE is a collection of two shapes; OWN a copy of it, to change.
COMMANDS = {
    "canonical": "canonical good.off -o form.ply --figure form.png --report form.html",
    "distance": FIELD,
    "match": "match good.off good.off -o map.npz --figure match.svg --report match.html "
    "--colored left.glb right.ply",
    "register": "register good.off good.off --map map.txt -o fitted.obj",
    "transfer": "transfer good.off good.off --map map.txt --values values.csv -o carried.csv",
    "similarity": "similarity good.off good.off --known-correspondence --matrix --csv table.csv "
    "--figure table.png --report table.html",
    "evaluate": "evaluate map.txt good.off truth.txt truth.txt --figure curves.svg",
    "demo": "demo -o demo.png",
    "cache clear": "cache clear",
    "collection add": "collection add OWN good.off --workers 1",
    "collection remove": "collection remove OWN SHAPE",
    "collection match": "collection match STORE --all -o pairs --workers 1",
    "collection register": "collection register STORE --template good.off -o out --workers 1",
    "collection mean": "collection mean REGISTERED -o mean --min-confidence 0",
    "collection export": "collection export STORE -o shapes.parquet",
    "collection groups": "collection groups STORE -n 2 --csv groups.csv",
    "collection matrix": "collection matrix STORE --csv far.csv --figure far.png --report far.html",
    "collection search": "collection search STORE good.off --report found.html",
    "collection info": "collection info STORE SHAPE --thumbnail shape.png",
}


def start(folder: Path, command: str, first: str = ":", **more: str) -> subprocess.Popen[bytes]:
    """Begin a command in a process of its own, with a cache in the folder.

    The shell does `first` before, in the same process.
    """
    meant = {"STORE": store(), "OWN": "own", "SHAPE": _shape()}
    if "REGISTERED" in command:
        meant["REGISTERED"] = _registered()
    environment = os.environ | {
        "PYTHONPATH": str(Path(unbend.__file__).parents[1]),
        "UNBEND_CACHE_DIR": str(folder / "cache"),
    }
    return subprocess.Popen(
        ["sh", "-c", f'{first} && exec "$@"', "sh", *BEGIN]
        + [meant.get(word, word) for word in shlex.split(command)],
        cwd=folder,
        env=environment | more,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )


def ended(process: subprocess.Popen[bytes]) -> tuple[int, str]:
    """Wait for a process; its exit code and what it said."""
    said = process.communicate()[1].decode(errors="replace")
    return process.returncode, said


@functools.cache
def _registered() -> str:
    """Register the collection of two shapes, in a folder beside it."""
    out = Path(store()).with_name("registered")
    unbend.collection.Collection(store()).register(_shape(), out, workers=0)
    return str(out)


def _shape() -> str:
    return min(one.path for one in unbend.collection.Collection(store()))


def fresh(folder: Path, command: str) -> None:
    """Put the folder into the state that a command is to find."""
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir()
    beside(folder)
    if "OWN" in command:
        shutil.copytree(store(), folder / "own")
    if command.startswith("cache"):
        assert ended(start(folder, FIELD))[0] == 0


def written(folder: Path) -> dict[str, int]:
    """Files in a folder and their sizes; of a collection, its shapes and their vertices."""
    found = {
        str(path.relative_to(folder)): path.stat().st_size
        for path in folder.rglob("*")
        if path.is_file() and path.suffix != ".part" and path.relative_to(folder).parts[0] != "own"
    }
    if (folder / "own").exists():
        found |= {one.path: one.n_vertices for one in unbend.collection.Collection(folder / "own")}
    return found


def check_whole(now: dict[str, int], before: dict[str, int], whole: dict[str, int]) -> None:
    """Assert that each file is as it was, or as it is when the command is done, or not there."""
    for name, size in now.items():
        wanted = [states[name] for states in (before, whole) if name in states]
        # Cached spectra are not the output; times and the like may differ, by no more than this.
        near = any(abs(size - other) < 0.1 * other + 64 for other in wanted)
        assert near or name.startswith("cache"), f"{name} has {size}, not {wanted}"
    lost = [name for name in before.keys() & whole.keys() if name not in now]
    assert not lost, f"{lost} are gone"


def interrupt(command: str, ends: Sequence[tuple[signal.Signals, float]]) -> list[int]:
    """End a command by signals at moments, shares of its time; what it leaves must be whole.

    Returns
    -------
    list of int
        Exit codes.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, "work")
        fresh(folder, command)
        before, begin = written(folder), time.monotonic()
        code, said = ended(start(folder, command))
        assert code == 0, said
        seconds, whole = time.monotonic() - begin, written(folder)
        codes = []
        for by, moment in ends:
            fresh(folder, command)
            process = start(folder, command)
            try:
                process.wait(moment * seconds)
            except subprocess.TimeoutExpired:
                process.send_signal(by)
            code, said = ended(process)
            codes.append(code)
            assert "Traceback" not in said, said
            check_whole(written(folder), before, whole)
            if by == signal.SIGINT:
                assert not list(folder.rglob("*.part")), command
        if command.startswith("collection remove") and written(folder) == whole:
            fresh(folder, command)  # what is gone cannot be removed again
        assert ended(start(folder, command))[0] == 0, f"{command}, after it was ended"
        check_whole(whole, before, written(folder))
        check_whole(written(folder), before, whole)
        return codes


def interrupts(rounds: int, only: Sequence[str]) -> None:
    """End every command at random moments, in both ways."""
    draw = np.random.default_rng(0)
    # What a shell runs in the background is deaf to it, and so is what that begins.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for name in only or COMMANDS:
        for by in (signal.SIGINT, signal.SIGKILL):
            ends = [(by, moment) for moment in draw.uniform(0.1, 1.0, rounds).tolist()]
            codes = interrupt(COMMANDS[name], ends)
            print(f"{name:18} {by.name:8} exit codes {codes}", flush=True)


def memory(only: Sequence[str]) -> None:
    """Give every command less and less address space; it ends well or with a sentence."""
    for name in only or COMMANDS:
        outcomes = []
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place, "work")
            fresh(folder, COMMANDS[name])
            before = written(folder)
            assert ended(start(folder, COMMANDS[name]))[0] == 0
            whole = written(folder)
            for mebibytes in (1600, 800, 600, 500, 400, 300):  # with less, libraries do not load
                fresh(folder, COMMANDS[name])
                limit = f"ulimit -v {mebibytes * 1024}"
                code, said = ended(start(folder, COMMANDS[name], limit))
                check_whole(written(folder), before, whole)
                last = said.strip().splitlines()[-1][:90] if "Traceback" in said else ""
                outcomes.append(f"{mebibytes}: {code} {last}".strip())
        print(f"{name:18} {', '.join(outcomes)}", flush=True)


@contextmanager
def half_a_processor() -> Iterator[Path]:
    """Make a control group of half a processor, or raise OSError where that is not allowed."""
    top = Path("/sys/fs/cgroup")
    second = (top / "cgroup.controllers").exists()
    group = (top if second else top / "cpu") / f"unbend-{os.getpid()}"
    group.mkdir()
    try:
        if second:
            (group / "cpu.max").write_text("50000 100000")
        else:
            (group / "cpu.cfs_period_us").write_text("100000")
            (group / "cpu.cfs_quota_us").write_text("50000")
        yield group
    finally:
        group.rmdir()


def quota() -> None:
    """Run commands under half a processor, with the threads that unbend chooses and with two."""
    print("command     threads      s  of a processor  periods stopped in", flush=True)
    with half_a_processor() as group, tempfile.TemporaryDirectory() as place:
        for pose in ("running", "sitting"):
            mesh = make_biped(pose, n_vertices=5000).mesh
            unbend.write_mesh(Path(place, f"{pose}.off"), mesh)
        for command in (
            "canonical running.off -o form.ply --no-cache",
            "match running.off sitting.off -o map.npz --no-cache",
        ):
            assert ended(start(Path(place), command))[0] == 0  # what is compiled is kept
            for threads in ("", "2", "", "2"):
                enter = f"echo $$ > {group}/cgroup.procs"
                more = {"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
                stopped, begin, used = _stopped(group), time.monotonic(), os.times()
                code, said = ended(start(Path(place), command, enter, **more))
                assert code == 0, said
                seconds, now = time.monotonic() - begin, os.times()
                spent = now.children_user + now.children_system
                spent -= used.children_user + used.children_system
                print(
                    f"{command.split()[0]:10} {threads or 'chosen':>8} {seconds:6.1f} "
                    f"{spent:15.1f} {_stopped(group) - stopped:19}",
                    flush=True,
                )


def _stopped(group: Path) -> int:
    lines = (group / "cpu.stat").read_text().splitlines()
    return {name: int(value) for name, value in map(str.split, lines)}["nr_throttled"]


def crowd(number: int) -> None:
    """Let many processes compute the same spectra and add to one collection, at once."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        beside(folder)
        field = FIELD
        several = [
            start(folder, field.replace("field.npy", f"field{i}.npy")) for i in range(number)
        ]
        assert [ended(one)[0] for one in several] == [0] * number
        found = {(folder / f"field{i}.npy").read_bytes() for i in range(number)}
        assert len(found) == 1
        assert len(list((folder / "cache").glob("*.npz"))) == 1
        assert not list((folder / "cache").glob(".*"))
        print(f"{number} processes, one cache: the same field from all, one file", flush=True)
        code = (
            "import sys\nfrom unbend.collection import Collection\n"
            "done = Collection('store').add(sys.argv[1:], workers=0)\n"
            "assert not done.failures, done.failures\n"
        )
        meshes = []
        for i in range(number):
            meshes.append(f"shape{i}.off")
            unbend.write_mesh(
                folder / meshes[-1], (stone().vertices * (1, 1, 2 + i), stone().faces)
            )
        several = [
            subprocess.Popen([sys.executable, "-c", code, one, "good.off"], cwd=folder)
            for one in meshes
        ]
        assert [one.wait() for one in several] == [0] * number
        shapes = unbend.collection.Collection(folder / "store")
        assert len(shapes) == number + 1, len(shapes)
        assert len({entry.path for entry in shapes}) == number + 1
        print(f"{number} processes, one collection: {len(shapes)} shapes, none twice", flush=True)


FIRST_RUN = """
import sys
import numpy as np
import scipy.sparse as sp
import unbend
from corpus.good import stone
from unbend.datasets import make_sphere
from unbend.linalg import factorization

operator = unbend.laplacian(make_sphere(3))
matrix = sp.csc_matrix(operator.stiffness + sp.diags_array(operator.areas))
draw = np.random.default_rng(0)
engines = {"qdldl": lambda matrix: factorization._qdldl(matrix, compiled=True)}
engines["multifrontal"] = factorization._multifrontal
for name in sys.argv[1:]:
    if name in engines:
        _, _, solve = engines[name](matrix)
        for count in (1, 3, 8, 16, 40):
            rhs = draw.standard_normal((matrix.shape[0], count))
            expected = np.linalg.solve(matrix.toarray(), rhs)
            np.testing.assert_allclose(solve(rhs), expected, rtol=0, atol=1e-9)
if "match" in sys.argv:
    order = draw.permutation(42)
    turn = np.linalg.qr(draw.standard_normal((3, 3)))[0]
    shape, turned = stone().vertices, np.empty((42, 3))
    shape = shape + shape[:, :1] ** 2 * [0, 0.3, 0]  # a stone turned over is the same stone
    turned[order] = shape @ turn * np.linalg.det(turn)
    meshes = (shape, stone().faces), (turned, order[stone().faces])
    found = unbend.match(*meshes)
    np.testing.assert_array_equal(found.source_to_target, order)
"""


@use_cache(gib=0)
def kernels(number: int, *parts: str) -> int:
    """Compile the same kernels in many processes at once, then load them in one more.

    Returns
    -------
    int
        Number of files of compiled code.
    """
    kept = []
    with tempfile.TemporaryDirectory() as place:
        paths = os.pathsep.join([str(Path(unbend.__file__).parents[1]), str(Path(__file__).parent)])
        environment = os.environ | {"PYTHONPATH": paths, "NUMBA_CACHE_DIR": place}
        command = [sys.executable, "-c", FIRST_RUN, *parts]
        for count in (number, 1):
            several = [
                subprocess.Popen(command, env=environment, stderr=subprocess.PIPE)
                for _ in range(count)
            ]
            for code, said in [ended(one) for one in several]:
                assert code == 0, said
            files = [path for path in Path(place).rglob("*") if path.is_file()]
            assert all(path.suffix == ".nbc" for path in files), files
            kept.append({path: path.stat().st_mtime_ns for path in files})
    assert kept[0] == kept[1], "the last process compiled what was there"
    return len(files)


def first_runs(number: int) -> None:
    """Compile everything in many processes at once, three times over."""
    for _ in range(3):
        begin = time.monotonic()
        count = kernels(number, "qdldl", "multifrontal", "match")
        seconds = time.monotonic() - begin
        done = f"{number} processes and one more, {count} files, all right"
        print(f"{done}, {seconds:.0f} s", flush=True)


@use_cache(gib=0)
def soak(n_forms: int, n_matches: int) -> None:
    """Compute in one process, and print what it holds now and then."""
    draw = np.random.default_rng(0)

    def another() -> unbend.Mesh:
        return unbend.Mesh(stone().vertices * draw.uniform(0.8, 1.2, 3), stone().faces)

    print("done             resident MiB  threads", flush=True)
    for what, count in (("forms", n_forms), ("matches", n_matches)):
        for i in range(count):
            if what == "forms":
                unbend.canonical_form(another())
            else:
                unbend.match(another(), stone())
            if i % max(count // 10, 1) == 0 or i == count - 1:
                print(f"{i + 1:6} {what:8} {_resident():12.1f} {_threads():8}", flush=True)


@use_cache(gib=0)
def bits(number: int, at_once: int = 4) -> None:
    """Match one pair in many processes, beside other load; all must give the same bytes."""
    code = (
        "import pickle, sys, threadpoolctl\n"
        "from unbend import match, read_mesh\n"
        "def blas(): return [one['num_threads'] for one in threadpoolctl.threadpool_info()]\n"
        "before = blas()\n"
        "found = match(read_mesh('left.ply'), read_mesh('right.ply'))\n"
        "assert blas() == before, 'BLAS was left with another number of threads'\n"
        "parts = [getattr(found, name) for name in found.__dataclass_fields__]\n"
        "sys.stdout.buffer.write(pickle.dumps(parts))\n"
    )
    with tempfile.TemporaryDirectory() as place:
        for name, meshing in (("left", 0), ("right", 1)):
            body = make_biped(
                "running" if meshing else "standing", n_vertices=1500, meshing=meshing
            )
            unbend.write_mesh(Path(place, f"{name}.ply"), body.mesh)

        def results() -> Iterator[bytes]:
            for _ in range(0, number, at_once):
                several = [
                    subprocess.Popen(
                        [sys.executable, "-W", "ignore", "-c", code],
                        cwd=place,
                        env=os.environ | {"PYTHONPATH": str(Path(unbend.__file__).parents[1])},
                        stdout=subprocess.PIPE,
                    )
                    for _ in range(at_once)
                ]
                for one in several:
                    said = one.communicate()[0]
                    assert one.returncode == 0
                    yield said

        found = Counter(results())
    print(f"{sum(found.values())} processes: {len(found)} different results", flush=True)
    assert len(found) == 1, sorted(found.values())


def _status(key: str) -> int:
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line for line in lines if line.startswith(key)).split()[1])


def _resident() -> float:
    return _status("VmRSS:") / 1024


def _threads() -> int:
    return _status("Threads:")


def main() -> None:
    """Run what is asked for."""
    what = {
        "interrupts": lambda: interrupts(asked.rounds, asked.only),
        "crowd": lambda: crowd(asked.processes),
        "kernels": lambda: first_runs(asked.processes),
        "soak": lambda: soak(asked.forms, asked.matches),
        "memory": lambda: memory(asked.only),
        "quota": quota,
        "bits": lambda: bits(asked.processes),
    }
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=what)
    parser.add_argument("only", nargs="*", help="commands, by the names that they have here")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--processes", type=int, default=20)
    parser.add_argument("--forms", type=int, default=2000)
    parser.add_argument("--matches", type=int, default=500)
    asked = parser.parse_args()
    what[asked.what]()


if __name__ == "__main__":
    main()
