import os
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sheets import make_egg
from unbend import (
    Mesh,
    canonical_form,
    distance,
    farthest_point_sampling,
    match,
    sampled_canonical_form,
    spectrum,
)
from unbend.datasets import make_sphere
from unbend.errors import InputError
from unbend.spectral import _spectrum as spectra
from unbend.spectral import cache_info, clear_cache, eigenpairs, make_surface, use_cache
from unbend.spectral._cache import cache_key, load_eigenpairs, store_eigenpairs

VALUES, FUNCTIONS = np.arange(4.0), np.arange(40.0).reshape(10, 4)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("UNBEND_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_what_was_stored_comes_back(folder):
    store_eigenpairs("key", VALUES, FUNCTIONS)
    values, functions = load_eigenpairs("key")
    np.testing.assert_array_equal(values, VALUES)
    np.testing.assert_array_equal(functions, FUNCTIONS)


def test_spectra_are_computed_once(blob, monkeypatch):
    first = spectrum(blob, 18)
    # may not be called again
    monkeypatch.setattr("unbend.spectral._spectrum.smallest_eigenpairs", None)
    np.testing.assert_array_equal(spectrum(blob, 18).eigenfunctions, first.eigenfunctions)
    np.testing.assert_array_equal(spectrum(blob, 12).eigenfunctions, first.eigenfunctions[:, :12])
    with use_cache(gib=0), pytest.raises(TypeError):
        spectrum(blob, 12)


def test_what_the_cache_holds_changes_nothing():
    """On a sphere most numbers of eigenpairs cut through the space of a multiple eigenvalue."""
    ball = make_sphere(3)
    with use_cache(gib=0):
        plain = {k: spectrum(ball, k) for k in (2, 3, 4, 6, 10, 25)}
    for order in ((2, 3, 4, 6, 10, 25), (25, 10, 6, 4, 3, 2), (25, 3, 3, 25)):
        clear_cache()
        for k in order:
            found = spectrum(ball, k)
            np.testing.assert_array_equal(found.eigenvalues, plain[k].eigenvalues)
            np.testing.assert_array_equal(found.eigenfunctions, plain[k].eigenfunctions)


@pytest.mark.parametrize(
    "compute",
    [
        lambda mesh: distance(mesh, 0, distance="diffusion", time=0.5),
        lambda mesh: distance(mesh, 0, distance="biharmonic", n_eigenpairs=9),
        lambda mesh: farthest_point_sampling(mesh, 3),
        lambda mesh: canonical_form(mesh, distance="diffusion", time=0.5),
        lambda mesh: sampled_canonical_form(mesh, n_eigenpairs=9),
        lambda mesh: canonical_form(mesh, weighting="area"),
        lambda _: match(make_egg(2), make_egg(2), n_eigenpairs=20, refine=False),
    ],
)
def test_whether_spectra_are_kept_is_one_setting(blob, compute):
    with use_cache(gib=0):
        compute(blob)
        assert cache_info().n_files == 0
    compute(blob)
    assert cache_info().n_files > 0


def test_the_cache_may_be_elsewhere_for_a_while(folder, tmp_path, blob):
    with use_cache(tmp_path / "elsewhere"):
        spectrum(blob, 3)
        assert cache_info().folder == tmp_path / "elsewhere"
        assert cache_info().n_files == 1
    assert cache_info().folder == folder
    assert cache_info().n_files == 0
    with os.scandir(tmp_path) as entries:
        entry = next(entries)  # a path that is no Path
    with use_cache(entry):
        assert cache_info().folder == Path(entry)
    with pytest.raises(InputError, match="folder must be a path, not ''"), use_cache(""):
        pass


def test_everything_that_matters_is_in_the_key(blob):
    moved = blob.vertices.copy()
    moved[3, 1] = np.nextafter(moved[3, 1], 9)
    keys = [
        cache_key(blob, 1, "cotangent", 1e-8),
        cache_key(blob, 2, "cotangent", 1e-8),
        cache_key(blob, 1, "robust", 1e-8),
        cache_key(blob, 1, "cotangent", 1e-6),
        cache_key(Mesh(moved, blob.faces), 1, "cotangent", 1e-8),
        cache_key(Mesh(blob.vertices, blob.faces[1:]), 1, "cotangent", 1e-8),
    ]
    assert len(set(keys)) == len(keys)
    assert cache_key(Mesh(blob.vertices, blob.faces), 1, "cotangent", 1e-8) == keys[0]


@pytest.mark.parametrize(
    "change",
    [
        lambda patch: patch.setattr("unbend.spectral._spectrum._VERSION", -1),
        lambda patch: patch.setattr("unbend.spectral._spectrum._RESIDUAL", 1e-7),
    ],
)
def test_what_another_solver_computed_is_not_used(blob, monkeypatch, change):
    surface = make_surface(blob)
    eigenpairs(surface, 5, tolerance=spectra._RESIDUAL)
    change(monkeypatch)
    monkeypatch.setattr("unbend.spectral._spectrum.smallest_eigenpairs", None)
    with pytest.raises(TypeError):
        eigenpairs(surface, 5, tolerance=spectra._RESIDUAL)


def test_wrong_numbers_in_a_sound_file_are_not_trusted(folder, blob):
    """As an earlier version may have left them, under a name that still stands."""
    right = spectrum(blob, 9)
    (path,) = folder.glob("*.npz")
    values, functions = load_eigenpairs(path.stem)
    store_eigenpairs(path.stem, values * 1.01, functions)
    np.testing.assert_array_equal(spectrum(blob, 9).eigenvalues, right.eigenvalues)


@pytest.mark.parametrize("keep", [0, 1, 100, 700, -1])
def test_a_truncated_file_is_not_trusted(folder, keep):
    store_eigenpairs("key", VALUES, FUNCTIONS)
    path = folder / "key.npz"
    path.write_bytes(path.read_bytes()[:keep])
    assert load_eigenpairs("key") is None


def test_no_changed_byte_leads_to_a_wrong_number(folder):
    store_eigenpairs("key", VALUES, FUNCTIONS)
    path, chance = folder / "key.npz", random.Random(0)
    whole = path.read_bytes()
    for _ in range(300):
        damaged = bytearray(whole)
        damaged[chance.randrange(len(whole))] ^= 1 << chance.randrange(8)
        path.write_bytes(damaged)
        found = load_eigenpairs("key")
        if found is not None:  # the byte was padding or a date
            np.testing.assert_array_equal(found[1], FUNCTIONS)


def test_a_header_that_names_a_smaller_array_is_not_trusted(folder):
    store_eigenpairs("key", VALUES, FUNCTIONS)
    path, (n, k) = folder / "key.npz", FUNCTIONS.shape
    header, smaller = (f"'shape': ({n}, {columns})".encode() for columns in (k, k - 1))
    whole = path.read_bytes()
    assert whole.count(header) == 1
    path.write_bytes(whole.replace(header, smaller))
    assert load_eigenpairs("key") is None


def test_a_foreign_file_is_not_trusted(folder):
    store_eigenpairs("other", VALUES + 1, FUNCTIONS)
    (folder / "other.npz").rename(folder / "key.npz")
    assert load_eigenpairs("key") is None


def test_pickles_are_not_opened(folder):
    folder.mkdir()
    np.savez(folder / "key.npz", eigenvalues=np.array([print], dtype=object))
    assert load_eigenpairs("key") is None


def test_grows_to_its_bound_and_drops_the_least_recently_used(folder, monkeypatch):
    size = 5000
    monkeypatch.setenv("UNBEND_CACHE_GIB", f"{5 * size / 2**30!r}")
    a, b, c, d, e, f = (40 * letter for letter in "abcdef")  # as hashes are
    for number, name in enumerate((a, b, c, d)):
        store_eigenpairs(name, np.arange(4.0), np.zeros((110, 4)))
        os.utime(folder / f"{name}.npz", (number, number))
    (folder / "of-the-user.npz").write_bytes(bytes(9 * size))
    load_eigenpairs(a)  # now the most recent
    store_eigenpairs(e, np.arange(4.0), np.zeros((110, 4)))
    store_eigenpairs(f, np.arange(4.0), np.zeros((110, 4)))
    assert cache_info().n_bytes <= 5 * size
    assert load_eigenpairs(a) is not None
    assert load_eigenpairs(b) is None
    assert (folder / "of-the-user.npz").exists()


def test_its_bound_can_be_set(monkeypatch):
    for text, bound in (("0.5", 2**29), ("0", 0), ("1e2", 100 * 2**30), ("", 2**31)):
        monkeypatch.setenv("UNBEND_CACHE_GIB", text)
        assert cache_info().most_bytes == bound
    for text in ("-1", "0,5", "inf", "nan"):
        monkeypatch.setenv("UNBEND_CACHE_GIB", text)
        with pytest.raises(InputError, match=f"number of GiB, 0 or more, not '{text}'"):
            cache_info()
    monkeypatch.delenv("UNBEND_CACHE_GIB")
    with pytest.raises(InputError, match="folder must be a path, not 0; gib=0"), use_cache(0):
        pass
    for gib in (-1, np.inf):
        with pytest.raises(InputError, match="gib must be a number"), use_cache(gib=gib):
            pass


def test_a_spectrum_too_large_for_the_cache_is_left_out(monkeypatch):
    monkeypatch.setenv("UNBEND_CACHE_GIB", "1e-7")
    store_eigenpairs("key", VALUES, FUNCTIONS)
    assert cache_info().n_files == 0


def test_what_a_killed_process_left_behind_is_removed(folder):
    folder.mkdir()
    old, new = (folder / f".{40 * 'a'}.npz.{i}.part" for i in (1, 2))
    other = folder / ".other.npz.1.part"
    for path in (old, new, other):
        path.write_bytes(b"half")
        os.utime(path, (0, 0))
    os.utime(new)
    store_eigenpairs("key", VALUES, FUNCTIONS)
    assert [path.exists() for path in (old, new, other)] == [False, True, True]


def test_info_and_clear_know_of_spectra_alone(folder):
    assert cache_info().n_files == 0
    store_eigenpairs(40 * "a", VALUES, FUNCTIONS)
    store_eigenpairs(40 * "b", VALUES, FUNCTIONS)
    np.savez(folder / "match.npz", VALUES)
    assert cache_info().n_files == 2
    assert clear_cache() == 2
    assert cache_info().n_bytes == 0
    assert (folder / "match.npz").exists()


def test_a_folder_that_cannot_be_used_breaks_nothing(tmp_path, monkeypatch, blob):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("UNBEND_CACHE_DIR", str(tmp_path / "file"))
    assert spectrum(blob, 3).eigenvalues[0] == 0
    assert cache_info().n_files == 0


HAMMER = """
import os, random, signal, sys, time
import numpy as np
from unbend.spectral._cache import cache_info, load_eigenpairs, store_eigenpairs

def hammer(turn):
    while True:
        key, k = 40 * str(turn % 3), 2 + turn % 5
        found = load_eigenpairs(key)
        if found is not None:
            k = len(found[0])
        functions = np.full((3000, k), float(key[0])) + np.arange(k)
        if found is None or turn % 7 == 0:
            store_eigenpairs(key, np.arange(float(k)), functions)
        elif not (np.array_equal(found[0], np.arange(k)) and np.array_equal(found[1], functions)):
            os._exit(1)
        turn += 1

running = []
for start in range(16):
    running.append(os.fork())
    if not running[-1]:
        hammer(start)
while not cache_info().n_files:  # however slow the machine: nobody dies before there is a file
    time.sleep(0.01)
chance = random.Random(1)
chance.shuffle(running)
for process in running:
    time.sleep(chance.random() * 0.05)
    os.kill(process, signal.SIGKILL)
ends = [os.waitpid(process, 0)[1] for process in running]
sys.exit(any(end != signal.SIGKILL for end in ends))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
def test_processes_killed_at_random_never_see_a_wrong_number():
    subprocess.run([sys.executable, "-c", HAMMER], check=True)
    assert cache_info().n_files > 0
    for key in "012":
        found = load_eigenpairs(40 * key)
        if found is not None:
            functions = np.full((3000, len(found[0])), float(key)) + np.arange(len(found[0]))
            np.testing.assert_array_equal(found[1], functions)


def test_a_file_that_another_process_has_open_costs_no_storing(folder, monkeypatch):
    store_eigenpairs(40 * "d", VALUES, FUNCTIONS)
    monkeypatch.setenv("UNBEND_CACHE_GIB", "1e-6")

    def refuse(path, **_):
        raise PermissionError(13, "open in another process", str(path))  # as Windows does

    monkeypatch.setattr("pathlib.Path.unlink", refuse)
    store_eigenpairs("new", VALUES, FUNCTIONS)
    assert load_eigenpairs("new") is not None
