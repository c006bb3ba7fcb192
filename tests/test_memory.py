"""Memory: what is predicted, what is free, and the sentence between them."""

import ctypes
import importlib
import mmap
import os
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from unbend import Mesh, canonical_form, laplacian, match, spectrum, symmetry
from unbend._memory import (
    LIMIT_VARIABLE,
    _group_limits,
    _machine,
    _user_limit,
    available_memory,
    check_memory,
    needed_memory,
    resident_memory,
)
from unbend.datasets import make_sphere
from unbend.errors import InputError, MeshError, UnbendWarning
from unbend.linalg.lanczos import working_columns
from unbend.matching._match import WORKING_COLUMNS

GIB = 2**30


@pytest.mark.parametrize(("n_vertices", "peak"), [(4_991_874, 10.64), (1_039_970, 2.38)])
def test_prediction_is_near_what_large_meshes_took(n_vertices, peak):
    libraries = 0.15
    assert needed_memory(n_vertices, 64) / GIB == pytest.approx(peak - libraries, rel=0.1)


def test_more_vertices_and_columns_need_more():
    assert needed_memory(2_000) > 2 * needed_memory(1_000)
    assert needed_memory(1_000, 10) == needed_memory(1_000) + 80_000


@pytest.mark.parametrize(
    ("n_vertices", "n_eigenpairs", "threads", "peak"),
    [
        (3_000, 430, 1, 78),
        (4_000, 600, 1, 141),
        (50_000, 10, 2, 122),
        (50_000, 100, 1, 261),
        (50_000, 100, 16, 463),
        (50_000, 300, 2, 625),
        (200_000, 10, 2, 577),
        (200_000, 100, 2, 1241),
        (200_000, 300, 16, 3242),
        (500_000, 10, 2, 1477),
        (500_000, 300, 2, 5727),
    ],
)
def test_prediction_is_near_what_spectra_took(n_vertices, n_eigenpairs, threads, peak, monkeypatch):
    """In MiB, beyond what the process had before; measured on bodies with compiled code loaded."""
    monkeypatch.setenv("OMP_NUM_THREADS", str(threads))
    predicted = needed_memory(n_vertices, working_columns(n_vertices, n_eigenpairs)) / 2**20
    assert 1 / 1.3 < predicted / peak < 1.3


@pytest.mark.parametrize(
    ("n_vertices", "share", "peak"),
    [
        (39_988, 1, 254),
        (29_991, 1, 232),  # of parts
        (159_940, 1, 969),
        (119_955, 1, 1094),  # of parts
        (639_748, 1, 3414),
        (19_994, 1, 178),  # of a symmetry
        (79_970, 1, 601),  # of a symmetry
        (159_940, 2, 679),  # without refinement
        (119_955, 2, 569),  # without refinement, of parts
    ],
)
def test_prediction_is_near_what_matches_took(n_vertices, share, peak):
    """In MiB, beyond what the process had before; measured on cats with compiled code loaded."""
    predicted = needed_memory(n_vertices, WORKING_COLUMNS // share) / 2**20
    assert 1 / 1.5 < predicted / peak < 1.5


def test_the_compiler_counts_until_it_is_loaded(monkeypatch):
    monkeypatch.setattr("unbend._memory.available_memory", lambda: 2**26)
    monkeypatch.setitem(sys.modules, "numba", None)
    check_memory("medium", 2_500, 64)
    monkeypatch.delitem(sys.modules, "numba")
    check_memory("small", 1_500, 64)
    with pytest.raises(MeshError, match=r"medium: 2,500 vertices need about 0\.1 GiB"):
        check_memory("medium", 2_500, 64)


def test_memory_of_processes_is_told_where_the_system_tells_it():
    taken = resident_memory(os.getpid())
    assert taken == 0 or 2**20 < taken < 2**40
    assert resident_memory(None) == 0


def test_free_memory_is_known_here():
    free = available_memory()
    assert free is None or 2**20 < free < 2**50


def test_what_does_not_fit_is_refused_in_one_sentence(blob, monkeypatch, no_cache):
    monkeypatch.setattr("unbend._memory.available_memory", lambda: 2**19)
    with pytest.raises(MeshError, match=r"blob: 642 vertices need about \d MiB .* fewer vertices"):
        canonical_form(blob)
    with pytest.raises(MeshError, match="fewer vertices"):
        spectrum(blob, 10)
    # Enough for either spectrum.
    monkeypatch.setattr("unbend._memory.available_memory", lambda: 6 * 2**20)
    spectrum(blob, 30)
    with pytest.raises(MeshError, match="blob and blob: 2,516 vertices need about 17 MiB"):
        match(blob, blob)
    monkeypatch.setattr("unbend._memory.available_memory", lambda: 2**25)
    many = Mesh(np.vstack([blob.vertices, np.zeros((1_000_000, 3))]), blob.faces, name="blob")
    with pytest.warns(UnbendWarning, match="unreferenced"):  # which take little
        match(many, blob, refine=False)
    ball = make_sphere(5)
    importlib.import_module("numba")  # whose own memory counts until it is loaded
    monkeypatch.setattr("unbend._memory.available_memory", lambda: 2**26)
    spectrum(ball, 30)
    with pytest.raises(MeshError, match="10,242 vertices need about"):
        symmetry(ball)
    monkeypatch.setattr("unbend._memory.available_memory", lambda: None)
    check_memory("huge", 10**9)


def test_what_the_user_allows_is_all_that_counts(blob, monkeypatch, tmp_path):
    """Containers may report less than there is, or more."""
    (tmp_path / "self").mkdir()
    (tmp_path / "self" / "statm").write_text("9000 1000 500")
    monkeypatch.setenv(LIMIT_VARIABLE, "0.5")
    assert available_memory() < 0.5 * GIB
    assert _user_limit(tmp_path) == 0.5 * GIB - 1000 * mmap.PAGESIZE
    assert _user_limit(tmp_path / "nowhere") == 0.5 * GIB
    monkeypatch.setattr("unbend._memory._machine", lambda: 2**19)
    monkeypatch.setattr("unbend._memory._group_limits", lambda: [None, 2**20])
    monkeypatch.setenv(LIMIT_VARIABLE, "64")
    assert available_memory() > 32 * GIB
    assert canonical_form(blob).stress >= 0
    monkeypatch.setenv(LIMIT_VARIABLE, "0.001")
    with pytest.raises(MeshError, match=r"blob: 642 vertices need about \d MiB .* 0 MiB are free"):
        canonical_form(blob)
    monkeypatch.delenv(LIMIT_VARIABLE)
    assert available_memory() == 2**19
    with pytest.raises(MeshError, match=r"say so with --memory-limit \(UNBEND_MEMORY_GIB\)"):
        canonical_form(blob)


def test_a_robust_laplacian_that_does_not_fit_is_refused(blob, monkeypatch):
    monkeypatch.setattr("unbend._memory.available_memory", lambda: 2**20)
    laplacian(blob)
    with pytest.raises(MeshError, match="blob: the robust Laplacian of 1,280 faces needs about"):
        laplacian(blob, laplacian="robust")


def test_more_dimensions_of_a_form_need_more(blob, monkeypatch):
    monkeypatch.setattr("unbend._memory.available_memory", lambda: 2**21)
    canonical_form(blob)
    with pytest.raises(MeshError, match="blob: 642 vertices need about"):
        canonical_form(blob, n_components=40)


@pytest.mark.parametrize("text", ["", "much", "0", "-1", "nan", "inf"])
def test_a_limit_is_a_number(monkeypatch, text):
    monkeypatch.setenv(LIMIT_VARIABLE, text)
    with pytest.raises(
        InputError, match=r"UNBEND_MEMORY_GIB\) must be a number of GiB above 0, not"
    ):
        available_memory()


@pytest.mark.parametrize("version", [1, 2])
def test_the_tightest_control_group_counts(tmp_path, version):
    proc, root = tmp_path / "proc", tmp_path / "cgroup"
    (proc / "self").mkdir(parents=True)
    line = "0::/a/b" if version == 2 else "3:cpu:/x\n7:memory:/a/b"
    (proc / "self" / "cgroup").write_text(line)
    top = root if version == 2 else root / "memory"
    (top / "a" / "b").mkdir(parents=True)
    limit, usage = ("max", "current") if version == 2 else ("limit_in_bytes", "usage_in_bytes")
    for group, most, used in ((top / "a", "5000", "3000"), (top / "a" / "b", "max", "10")):
        (group / f"memory.{limit}").write_text(most)
        (group / f"memory.{usage}").write_text(used)
        (group / "memory.stat").write_text("anon 1\ninactive_file 500\n")
    assert [left for left in _group_limits(proc=proc, root=root) if left is not None] == [2500]
    assert _group_limits(proc=tmp_path, root=root) == []


def test_free_memory_of_the_machine(tmp_path):
    (tmp_path / "meminfo").write_text("MemTotal: 9 kB\nMemAvailable: 7 kB\n")
    assert _machine(tmp_path) == 7 * 1024
    if sys.platform != "win32":
        assert _machine(tmp_path / "nothing") > mmap.PAGESIZE


def test_windows_is_asked_what_is_free(tmp_path, monkeypatch):
    def tell(pointer):
        status = pointer._obj
        assert status.size == 64  # as documented of MEMORYSTATUSEX; else Windows refuses
        status.total, status.available = 16 * GIB, 5 * GIB
        return 1

    kernel = SimpleNamespace(GlobalMemoryStatusEx=tell)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(ctypes, "windll", SimpleNamespace(kernel32=kernel), raising=False)
    assert _machine(tmp_path / "nothing") == 5 * GIB
    kernel.GlobalMemoryStatusEx = lambda pointer: 0
    assert _machine(tmp_path / "nothing") is None
