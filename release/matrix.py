"""Install what would be released into empty environments, and try it: ``make test-matrix``.

The wheel and the sdist are built as a release builds them. Each case is one new environment with
nothing but pip, one Python, one of the two, and the newest or the lowest versions that
pyproject.toml allows; then ``smoke.py`` runs there. The lowest versions are tried on the oldest
Python alone: there are no wheels of them for Pythons that came later.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).parent
ROOT = HERE.parent
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
LIMIT_BYTES = 1_000_000  # of the wheel
# Those that users ask for; the others are tools of whoever works on unbend.
EXTRAS = ("plot", "sklearn", "exact", "data", "formats", "collection", "app")
COMPILED = ("exact",)  # there is no wheel of pygeodesic for Python 3.14


class Case(NamedTuple):
    """One environment; the extra "none" is the package alone."""

    python: str
    kind: str
    versions: str
    extra: str


def lowest() -> list[str]:
    """Constraints that hold every dependency at the lowest version that we allow."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    lists = (project["dependencies"], *project["optional-dependencies"].values())
    bounds = (re.match(r"([\w-]+)>=([\w.]+)[^;]*(;.*)?", one) for some in lists for one in some)
    return sorted({f"{bound[1]}=={bound[2]}{bound[3] or ''}" for bound in bounds if bound})


def interpreters() -> dict[str, str]:
    """Pythons of this machine, by version: this one, those on the path, those of pyenv."""
    found = {}
    for version in PYTHONS:
        this = "{}.{}".format(*sys.version_info) == version
        places = [sys.executable if this else None, shutil.which(f"python{version}")]
        places += map(str, sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python")))
        for program in filter(None, places):
            told = subprocess.run([program, "--version"], capture_output=True, text=True)
            if told.stdout.startswith(f"Python {version}."):
                found.setdefault(version, program)
    return found


def cases(pythons: list[str]) -> Iterator[Case]:
    """Each Python with the wheel; the extras on the newest; the sdist and low versions once."""
    for python in pythons:
        yield Case(python, "wheel", "newest", "none")
    if PYTHONS[0] in pythons:
        for extra in ("none", *EXTRAS):
            yield Case(PYTHONS[0], "wheel", "lowest", extra)
    for extra in EXTRAS:
        yield Case(pythons[-1], "wheel", "newest", extra)
    yield Case(pythons[-1], "sdist", "newest", "none")


def build(folder: Path) -> dict[str, Path]:
    """Build both kinds, and mind the size of the wheel."""
    subprocess.run([sys.executable, "-m", "build", "--outdir", folder, ROOT], check=True)
    made = {"wheel": next(folder.glob("*.whl")), "sdist": next(folder.glob("*.tar.gz"))}
    for kind, path in made.items():
        print(f"{kind}: {path.name}, {path.stat().st_size / 1e6:.2f} MB")
    if made["wheel"].stat().st_size > LIMIT_BYTES:
        raise SystemExit("the wheel is larger than 1 MB")
    return made


def attempt(case: Case, program: str, built: Path, folder: Path) -> str:
    """Make one environment and run the smoke test there; tell how that went."""
    subprocess.run([program, "-m", "venv", folder], check=True)
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    (folder / "lowest.txt").write_text("\n".join(lowest()), encoding="utf-8")
    # What is not pure Python must come as a wheel: nobody should need a compiler.
    options = ["--progress-bar=off", "--only-binary=:all:", "--no-binary=unbend"]
    if case.kind == "wheel":
        options.remove("--no-binary=unbend")
    if case.extra in COMPILED:
        options = ["--progress-bar=off"]
    if case.versions == "lowest":
        options += ["--constraint", str(folder / "lowest.txt")]
    extra = "" if case.extra == "none" else f"[{case.extra}]"
    # Nothing is taken from outside, neither modules nor compiled code nor spectra.
    alone = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(("PYTHON", "NUMBA_", "UNBEND_"))
    }
    alone["UNBEND_CACHE_DIR"] = str(folder / "cache")
    for step, words in (
        ("installing", ["-m", "pip", "install", *options, f"{built}{extra}"]),
        ("checking", ["-m", "pip", "check"]),
        ("trying", [str(HERE / "smoke.py"), case.extra]),
    ):
        # -P: the folder of this file is not searched; only what is installed is.
        done = subprocess.run(
            [python, "-P", *words], capture_output=True, text=True, cwd=folder, env=alone
        )
        if done.returncode:
            (ROOT / "dist" / f"{'-'.join(case)}.log").write_text(
                done.stdout + done.stderr, encoding="utf-8"
            )
            return f"failed at {step}: {(done.stderr.strip().splitlines() or ['?'])[-1]}"
    return f"passed; {done.stdout.strip()}" if done.stdout else "passed"


def main() -> None:
    """Run all cases, or those that the options leave."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in Case._fields:
        parser.add_argument(f"--{name}", action="append", help="only these; may be repeated")
    wanted = vars(parser.parse_args())
    programs = interpreters()
    for version in PYTHONS:
        print(f"Python {version}: {programs.get(version, 'none on this machine')}", flush=True)
    dist = ROOT / "dist"
    shutil.rmtree(dist, ignore_errors=True)
    built = build(dist)
    failed = 0
    chosen = wanted["python"] or PYTHONS
    for case in cases(
        [version for version in PYTHONS if version in programs and version in chosen]
    ):
        if any(wanted[name] and getattr(case, name) not in wanted[name] for name in case._fields):
            continue
        start = time.monotonic()
        with tempfile.TemporaryDirectory() as folder:
            said = attempt(case, programs[case.python], built[case.kind], Path(folder))
        failed += not said.startswith("passed")
        print(f"{' '.join(case):40} {said} ({time.monotonic() - start:.0f} s)", flush=True)
    raise SystemExit(f"{failed} failed; see dist/*.log" if failed else 0)


if __name__ == "__main__":
    main()
