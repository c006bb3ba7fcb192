"""Compiled code on disk is what was compiled from these sources for these types, or is not used."""

import itertools
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

import unbend
from unbend._compiled import compiled

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for compiled code."""
    path = tmp_path / "code"
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(path))
    return path


def filler() -> Callable[[Any, Any], None]:
    @compiled
    def fill(row, lanes):  # type: ignore[no-untyped-def]
        for i in range(len(lanes)):
            row[i] = len(lanes)

    return fill


def filled(width: int) -> list[float]:
    row = np.zeros(20)
    filler()(row, (0.0,) * width)
    return row.tolist()


def halver() -> Callable[[Any], Any]:
    @compiled
    def halve(x):  # type: ignore[no-untyped-def]
        return x / 2

    return halve


@pytest.fixture(scope="module")
def compiled_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of the code of both."""
    path = tmp_path_factory.mktemp("compiled")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numba.config, "CACHE_DIR", str(path))
        halver()(3.0)
        filled(8)
    return path


@pytest.fixture
def kept(compiled_once: Path, folder: Path) -> list[Path]:
    """Its files, copied to where compiled code is."""
    shutil.copytree(compiled_once, folder)
    return files(folder)


def files(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def n_loaded(compiled_kernel: Any) -> int:
    return sum(compiled_kernel.stats.cache_hits.values())


def test_compiled_code_is_kept_and_found_again(folder: Path) -> None:
    assert halver()(3.0) == 1.5
    again = halver()
    assert again(3.0) == 1.5
    assert n_loaded(again) == 1


def test_code_of_another_version_of_numba_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    halver()(3.0)
    monkeypatch.setattr(numba, "__version__", "0.0")
    again = halver()
    assert again(3.0) == 1.5
    assert n_loaded(again) == 0


def mixtures(one: Path, other: Path, mixed: Path) -> Iterator[None]:
    """Make every folder that two processes could leave behind that write files at the same time.

    Of a file that both have written, either version may remain.
    """
    names = sorted({path.relative_to(top) for top in (one, other) for path in files(top)})
    for choice in itertools.product((one, other), repeat=len(names)):
        shutil.rmtree(mixed, ignore_errors=True)
        for name, first in zip(names, choice, strict=True):
            last = other if first == one else one
            source = first / name if (first / name).exists() else last / name
            (mixed / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, mixed / name)
        yield


def test_processes_that_compile_at_once_mix_up_neither_widths_nor_types(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, width, number in (("one", 8, 3), ("other", 16, 3.0)):
        monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / name))
        filled(width)
        halver()(number)
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(folder))
    for _ in mixtures(tmp_path / "one", tmp_path / "other", folder):
        assert filled(8) == [8.0] * 8 + [0.0] * 12
        assert filled(16) == [16.0] * 16 + [0.0] * 4
        assert halver()(3) == halver()(3.0) == 1.5


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda code: b"",
    "cut off": lambda code: code[: len(code) // 2],
    "garbage": lambda code: b"garbage" * 100,
    "zeros": lambda code: bytes(len(code)),
    "a bit changed": lambda code: code[:-99] + bytes([code[-99] ^ 1]) + code[-98:],
    "more behind": lambda code: code + b"more",
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_files_cost_a_compilation(damage: str, kept: list[Path]) -> None:
    assert len(kept) == 2
    for path in kept:
        path.write_bytes(DAMAGES[damage](path.read_bytes()))
    again = halver()
    assert again(3.0) == 1.5
    assert n_loaded(again) == 0
    assert filled(8) == [8.0] * 8 + [0.0] * 12
    mended = halver()
    assert mended(3.0) == 1.5
    assert n_loaded(mended) == 1


def test_every_bit_of_a_file_counts(kept: list[Path]) -> None:
    (path,) = (one for one in kept if "halve" in one.name)
    code = path.read_bytes()
    for place in range(0, len(code), len(code) // 5):
        path.write_bytes(code[:place] + bytes([code[place] ^ 4]) + code[place + 1 :])
        again = halver()
        assert again(3.0) == 1.5
        assert n_loaded(again) == 0


def test_a_folder_that_becomes_unusable_costs_a_compilation(folder: Path) -> None:
    """After a kernel is defined and before it is compiled, by its first call."""
    gone, blocked = halver(), halver()
    shutil.rmtree(folder)
    assert gone(3.0) == 1.5
    shutil.rmtree(folder, ignore_errors=True)
    folder.touch()
    assert blocked(3.0) == 1.5
    assert filled(8) == [8.0] * 8 + [0.0] * 12


def test_a_folder_in_the_place_of_a_file_costs_a_compilation(folder: Path) -> None:
    halver()(3.0)
    for path in files(folder):
        path.unlink()
        path.mkdir()
    assert halver()(3.0) == 1.5
    assert not files(folder)


FULL_DISK = """
import resource
import numpy as np
from unbend._compiled import compiled
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
assert compiled(lambda x: x / 2)(3.0) == 1.5
row = np.ones(3)
compiled(lambda row: row[0])(row)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="files have no limits there")
def test_a_full_disk_costs_a_compilation(folder: Path) -> None:
    code = folder.with_name("full.py")
    code.write_text(FULL_DISK)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder)}
    done = subprocess.run(
        [sys.executable, code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert not files(folder)


def test_what_fails_to_compile_is_an_error() -> None:
    with pytest.raises(numba.errors.TypingError):
        compiled(lambda row: row.unknown)(np.zeros(3))


FILES = {
    "__init__.py": "",
    "numbers.py": "from package._compiled import compiled\nNUMBER = 1\n",
    "first.py": """
from package._compiled import compiled
from package.numbers import NUMBER

@compiled
def twice_the_number(x):
    return 2 * x * NUMBER

print(twice_the_number(1))
""",
}


@pytest.mark.parametrize("zipped", [False, True])
def test_code_of_another_version_is_not_used(zipped: bool, folder: Path, tmp_path: Path) -> None:
    """A constant of another file has changed, and nothing else: neither names, sizes nor times."""
    package = tmp_path / "package"
    package.mkdir()
    compiler = Path(unbend.__file__).with_name("_compiled.py")
    shutil.copy(compiler, package)
    for name, text in FILES.items():
        (package / name).write_text(text)
    if sys.platform != "win32":
        (package / ".#first.py").symlink_to("nowhere")  # an editor's lock
    constants = package / "numbers.py"
    before = constants.stat()
    path = tmp_path / "package.zip" if zipped else tmp_path
    places = {"NUMBA_CACHE_DIR": folder, "XDG_CACHE_HOME": folder, "PYTHONPATH": path}
    for number in "1" if zipped else "13":  # what is in a zip file is never kept
        constants.write_text(f"from package._compiled import compiled\nNUMBER = {number}\n")
        os.utime(constants, ns=(before.st_atime_ns, before.st_mtime_ns))
        if zipped:
            shutil.make_archive(str(package), "zip", tmp_path, "package")
        done = subprocess.run(
            [sys.executable, "-B", "-c", "import package.first"],
            cwd=folder.parent.parent,
            env=os.environ | {name: str(place) for name, place in places.items()},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.stdout == f"{2 * int(number)}\n", done.stderr
    assert bool(files(folder)) != zipped
