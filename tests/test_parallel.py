"""Work spread over threads."""

import contextlib
import functools
import multiprocessing
import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from unbend import _parallel
from unbend._parallel import _quota, n_threads, one_blas_thread, run_all
from unbend.errors import heard, warn


def total(depth):
    if depth == 0:
        return 1
    return sum(run_all(functools.partial(total, depth - 1) for _ in range(5)))


@pytest.fixture(params=["1", "2", "7"])
def threads(request, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", request.param)
    return int(request.param)


def test_tasks_may_have_tasks_of_their_own(threads):
    assert total(4) == 5**4


def test_as_many_threads_as_asked_for_work_at_once(threads):
    meeting = threading.Barrier(threads)
    assert len(set(run_all([meeting.wait] * threads))) == threads


def test_tasks_have_the_settings_of_their_caller(threads):
    """Such as NumPy's of what to do about rounding to zero, and who hears warnings."""
    meeting = threading.Barrier(threads)

    def task():
        meeting.wait()
        warn(np.geterr()["under"])

    with np.errstate(under="raise"), heard() as said:
        run_all([task] * threads)
    assert set(said) == {"raise"}


def test_an_error_is_passed_on(threads):
    def fail():
        raise IndexError("this one")

    with pytest.raises(IndexError, match="this one"):
        run_all([lambda: 1, fail, *[lambda: 2] * 50])
    assert run_all([lambda: 1, lambda: 2]) == [1, 2]


def test_an_error_drops_what_has_not_begun(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    begun = []
    with pytest.raises(ZeroDivisionError):
        run_all([lambda: begun.append(1), lambda: 1 / 0, lambda: begun.append(2)])
    assert begun == [1]


def test_a_thread_goes_on_when_the_main_one_has_ended():
    """Python waits for it, but has ended the helpers and starts no more."""
    code = """
import threading
from unbend._parallel import run_all

def work():
    threading.main_thread().join()
    print(run_all([lambda: 1] * 9))

run_all([lambda: 1] * 9)
threading.Thread(target=work).start()
"""
    ended = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"OMP_NUM_THREADS": "3"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert (ended.stdout, ended.stderr) == (f"{[1] * 9}\n", "")


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="cannot fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(threads):
    assert total(2) == 25
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(total, (2,)).get() == 25


@pytest.mark.parametrize("version", [1, 2])
def test_quotas_of_processor_time_count(tmp_path, version):
    """Of nested control groups the tightest, 1.5 processors; and none where there is no quota."""
    proc, root = tmp_path / "proc", tmp_path / "cgroup"
    (proc / "self").mkdir(parents=True)
    line = "0::/a/b" if version == 2 else "2:memory:/x\n3:cpu,cpuacct:/a/b"
    (proc / "self" / "cgroup").write_text(line)
    top = root if version == 2 else root / "cpu,cpuacct"
    for folder, quota in (("", -1), ("a", 150_000), ("a/b", 400_000)):
        group = top / folder
        group.mkdir(parents=True, exist_ok=True)
        if version == 2:
            (group / "cpu.max").write_text(f"{'max' if quota < 0 else quota} 100000\n")
        else:
            (group / "cpu.cfs_quota_us").write_text(f"{quota}\n")
            (group / "cpu.cfs_period_us").write_text("100000\n")
    assert _quota(proc=proc, root=root) == 2
    assert _quota(proc=tmp_path, root=root) == os.cpu_count()


def test_a_quota_limits_the_threads(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setattr(_parallel, "_quota", lambda: 1)
    assert n_threads() == 1


def test_one_pool_serves_all_numbers_of_tasks(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    for count in range(1, 9):
        run_all([threading.Barrier(count).wait] * count)

    def helpers():
        return sum(thread.name.startswith("unbend") for thread in threading.enumerate())

    while helpers() > 7:  # those of another test are about to go
        time.sleep(0.01)
    assert helpers() == 7


def blas_threads(inside=False):
    with one_blas_thread() if inside else contextlib.nullcontext():
        return {lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"}


def forked():
    return blas_threads(), blas_threads(inside=True), blas_threads()


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="cannot fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_process_forked_while_blas_is_pinned_has_it_back():
    with threadpool_limits(2, "blas"):
        outside = blas_threads()
        with one_blas_thread(), multiprocessing.get_context("fork").Pool(1) as pool:
            assert blas_threads() == {1}
            assert pool.apply_async(forked).get() == (outside, {1}, outside)
        assert blas_threads() == outside


def test_blas_is_pinned_whichever_thread_asks():
    """Also beside a thread that set a number of its own, and by a thread that lives on."""
    with threadpool_limits(2, "blas"), ThreadPoolExecutor(1) as helper:
        outside = blas_threads()
        for _ in range(2):
            assert helper.submit(blas_threads, inside=True).result() == {1}
            assert blas_threads() == outside
            assert blas_threads(inside=True) == {1}
            assert blas_threads() == outside


def test_the_last_thread_out_restores_blas():
    inside, done = threading.Event(), threading.Event()

    def stay():
        with one_blas_thread():
            inside.set()
            done.wait()

    with threadpool_limits(2, "blas"), ThreadPoolExecutor(1) as helper:
        outside = blas_threads()
        with one_blas_thread():
            staying = helper.submit(stay)
            inside.wait()
        assert blas_threads() == {1}
        done.set()
        staying.result()
        assert blas_threads() == outside


def test_blas_libraries_loaded_later_are_pinned_too():
    """SciPy has a BLAS of its own, which may not be loaded when BLAS is first pinned."""
    code = """
from unbend._parallel import one_blas_thread
with one_blas_thread():
    pass
import scipy.linalg, threadpoolctl
threadpoolctl.threadpool_limits(2, "blas")
with one_blas_thread():
    assert {one["num_threads"] for one in threadpoolctl.threadpool_info()} <= {1}
"""
    subprocess.run([sys.executable, "-c", code], check=True)
