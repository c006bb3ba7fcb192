"""Times of work done in turn, and of the command in a process of its own."""

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from unbend import Mesh, write_mesh

# The command, and then its peak memory in GiB. (Linux counts the parent's memory into the peak
# that getrusage gives for a child.)
_COMMAND = """
import re, resource, sys
from pathlib import Path
from unbend.cli import main
try:
    main()
except SystemExit as end:
    if end.code:
        raise
status = Path("/proc/self/status")
if status.exists():
    peak = int(re.search(r"VmHWM:\\s*(\\d+)", status.read_text())[1]) / 2**20
else:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**30
print(f"{peak:.3f}", file=sys.stderr)
"""


def seconds(work: Callable[[], Any]) -> tuple[float, Any]:
    start = time.perf_counter()
    result = work()
    return time.perf_counter() - start, result


def alternate(
    ours: Callable[[], Any], peer: Callable[[], Any], repeats: int
) -> tuple[float, Any, float, Any]:
    """Median seconds and last result of both, run in turn; ours is compiled before."""
    ours()
    times: tuple[list[float], list[float]] = [], []
    for _ in range(repeats):
        took, mine = seconds(ours)
        times[0].append(took)
        took, theirs = seconds(peer)
        times[1].append(took)
    return statistics.median(times[0]), mine, statistics.median(times[1]), theirs


def file_to_file(
    name: str, meshes: Sequence[Mesh], folder: Path, output: str, **environment: str
) -> tuple[float, float]:
    """Wall seconds and peak GiB of a command on meshes, in a process of its own."""
    sources = [folder / f"{i}.ply" for i in range(len(meshes))]
    for source, mesh in zip(sources, meshes, strict=True):
        write_mesh(source, mesh)
    command = [sys.executable, "-c", _COMMAND, name, *sources, "-o", folder / output]
    took, done = seconds(
        lambda: subprocess.run(
            command, capture_output=True, text=True, env=os.environ | environment
        )
    )
    if done.returncode:
        raise SystemExit(f"unbend {name} failed on {meshes[0].name}: {done.stderr}")
    return took, float(done.stderr.split()[-1])
