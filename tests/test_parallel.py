"""Work spread over threads."""

import functools
import multiprocessing
import threading

import pytest

from unbend._parallel import run_all


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


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="cannot fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own(threads):
    assert total(2) == 25
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(total, (2,)).get(timeout=60) == 25
