"""Fuzz one family: ``python -m fuzz meshes --seconds 600``."""

import argparse
import importlib
import sys
import tempfile
from pathlib import Path
from types import FunctionType

FAMILIES = ("meshes", "maps", "values", "archives", "shapes")
# What is followed to see which inputs lead somewhere new. Compiled kernels cannot be.
FOLLOWED = (
    "unbend.io._files",
    "unbend.io._maps",
    "unbend.io._meshes",
    "unbend.io._values",
    *(f"unbend.io.formats.{one}" for one in ("contents", "npy", "obj", "off", "ply", "points")),
    "unbend.io.formats.stl",
    "unbend.io.formats.vtk",
    "unbend.correspondence._archive",
    "unbend.mesh._mesh",
    "unbend.mesh._topology",
    "unbend.preparation._diagnosis",
    "unbend.preparation._prepare",
    "unbend.spectral._laplacian",
    "unbend.spectral._surface",
    "csv",
    "numpy.lib.format",
    "zipfile",
)


def main() -> None:
    """Fuzz until the time is over; what is found is printed and kept beside, with exit code 77."""
    parser = argparse.ArgumentParser(prog="python -m fuzz")
    parser.add_argument("family", choices=FAMILIES)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--finds", default="fuzz-finds/", help="folder of what is found")
    parser.add_argument("--inputs", help="folder of inputs that led somewhere new, to go on from")
    asked = parser.parse_args()
    import atheris

    from . import mutations, readers

    for name in FOLLOWED:
        module = importlib.import_module(name)
        for one in vars(module).values():
            for function in (one, *(vars(one).values() if isinstance(one, type) else ())):
                if isinstance(function, FunctionType) and function.__module__ == module.__name__:
                    atheris.instrument_func(function)
    Path(asked.finds).mkdir(parents=True, exist_ok=True)
    target = getattr(mutations if asked.family == "shapes" else readers, asked.family)
    with tempfile.TemporaryDirectory() as temporary:
        folder = asked.inputs or temporary
        Path(folder).mkdir(parents=True, exist_ok=True)
        seeds = (mutations if asked.family == "shapes" else readers).seeds(asked.family)
        for i, seed in enumerate(seeds):
            Path(folder, f"{i:04}").write_bytes(seed)
        options = [
            f"-max_total_time={asked.seconds}",
            f"-artifact_prefix={asked.finds}{asked.family}-",
            "-rss_limit_mb=8192",  # following a run of shapes keeps 35 KB for good: 5 GB an hour
            "-timeout=30",
            "-print_final_stats=1",
            "-max_len=8192",
            "-len_control=0",
        ]
        atheris.Setup([sys.argv[0], *options, folder], target)
        atheris.Fuzz()


main()
