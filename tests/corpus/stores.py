"""Collections and the cache of spectra, damaged or replaced by something else."""

import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from .case import Answer, Case, Refused, Seen, here
from .good import Command, beside, in_turn, store

_USES = (
    "collection list bad.store",
    "collection info bad.store",
    "collection search bad.store good.off",
    "collection matrix bad.store",
    "collection groups bad.store -n 2",
    "collection export bad.store -o out.csv",
)


def cases() -> Iterator[Case]:
    """Give a case for each damage."""
    for i, (name, make, sentence) in enumerate(_stores()):
        yield Case(f"collection, {name}", make, in_turn(_USES, i), Refused(sentence))
    yield Case(
        "collection, a shape that is not in it",
        _copy(),
        ("collection remove bad.store nowhere.off", "collection info bad.store 0123456789abcdef"),
        Refused("is not in the collection"),
    )
    yield Case(
        "collection, a full disk while it is changed",
        _copy(),
        ("collection list bad.store",),
        Answer(_copy(), _unharmed, "one sentence, the collection unharmed"),
        _after_a_full_disk,
    )
    for name, damage in _caches():
        yield Case(
            f"cache, {name}",
            beside,
            ("distance good.off --from 0 --distance biharmonic --n-eigenpairs 20 -o form.npy",),
            Answer(beside, _same_form, "the answer without a cache"),
            _with_cache(damage),
        )


def _stores() -> Iterator[tuple[str, Callable[[Path], None], str]]:
    def file(folder: Path) -> None:
        beside(folder)
        (folder / "bad.store").write_text("no collection")

    def other(folder: Path) -> None:
        beside(folder)
        (folder / "bad.store").mkdir()
        (folder / "bad.store" / "notes.txt").write_text("something else")

    yield "not there", beside, "there is no collection"
    yield "a file", file, "is a file; a collection is a folder"
    yield "a folder of other things", other, "holds other things"
    yield "rows cut off", _copy("data/*.lance", _cut_off), "cannot be read"
    yield "rows of noise", _copy("data/*.lance", _noise), "cannot be read"
    yield "rows gone", _copy("data/*.lance", Path.unlink), "cannot be read"
    yield "its list of files cut off", _copy("_versions/*", _cut_off), "cannot be read"
    yield "its list of files noise", _copy("_versions/*", _noise), "cannot be read"
    yield "its list of files gone", _copy("_versions/*", Path.unlink), "cannot be read"


def _copy(
    pattern: str = "", damage: Callable[[Path], object] = lambda path: None
) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        beside(folder)
        shutil.copytree(store(), folder / "bad.store")
        for path in sorted((folder / "bad.store" / "shapes.lance").glob(pattern or "none")):
            damage(path)

    return make


def _cut_off(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _noise(path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, path.stat().st_size, dtype=np.uint8)
    path.write_bytes(noise.tobytes())


def _after_a_full_disk(folder: Path, command: Command) -> Seen:
    """Try to remove a shape where no file can grow, then run the command."""
    import resource

    where = Path(store()).parent
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (8, before[1]))
    try:
        refused = here(folder, f"collection remove bad.store {where}/stone0.off")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert refused.code == 2, refused
    assert refused.err.count("\n") == 1, refused
    assert "bad.store cannot be read or written" in refused.err, refused
    return here(folder, command)


def _unharmed(seen: Seen, truth: Seen) -> str:
    assert seen.out == truth.out
    return "the same list"


def _caches() -> Iterator[tuple[str, Callable[[Path], object]]]:
    def damaged(cache: Path) -> None:
        for path in cache.glob("*.npz"):
            _cut_off(path)

    def forged(cache: Path) -> None:
        for path in cache.glob("*.npz"):
            np.savez(path, eigenvalues=np.zeros(9), eigenfunctions=np.zeros((42, 9)), digest=0)

    def file(cache: Path) -> None:
        shutil.rmtree(cache)
        cache.write_text("")

    yield "files cut off", damaged
    yield "files forged", forged
    yield "a file in place of the folder", file


def _with_cache(damage: Callable[[Path], object]) -> Callable[[Path, Command], Seen]:
    """Run twice with a cache of its own, which is damaged in between."""

    def run(folder: Path, command: Command) -> Seen:
        before = os.environ.get("UNBEND_CACHE_DIR")
        os.environ["UNBEND_CACHE_DIR"] = str(folder / "cache")
        try:
            first = here(folder, command)
            assert first.code == 0, first
            damage(folder / "cache")
            return here(folder, command)
        finally:
            del os.environ["UNBEND_CACHE_DIR"]
            if before is not None:
                os.environ["UNBEND_CACHE_DIR"] = before

    return run


def _same_form(seen: Seen, truth: Seen) -> str:
    found, right = (np.load(one.folder / "form.npy") for one in (seen, truth))
    np.testing.assert_array_equal(found, right)
    return "the same to the last bit"
