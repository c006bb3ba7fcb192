"""The engine: results come as they are done, and a worker that dies stops nothing."""

import _thread
import io
import itertools
import logging
import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from unbend._memory import LIMIT_VARIABLE
from unbend.collection import _engine
from unbend.collection._engine import engine
from unbend.errors import InputError, UnbendError

# The function that is run is `eval`, and the items are what it evaluates: any worker knows it.
DEATH = "__import__('os')._exit(1)"


def results(run, items):
    return {
        outcome.item: (outcome.value, outcome.reason)
        for outcomes in run(eval, items)
        for outcome in outcomes
    }


def test_this_process_will_do() -> None:
    with engine(workers=0) as run:
        assert results(run, ["1 + 1", None, "2 * 3"]) == {"1 + 1": (2, None), "2 * 3": (6, None)}


def test_workers_have_their_share_and_this_process_stays_as_it_was(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "6")
    monkeypatch.setattr(_engine, "n_cores", lambda: 1)
    monkeypatch.setattr(_engine, "available_memory", lambda: 2**32)
    before, main = dict(os.environ), dict(vars(sys.modules["__main__"]))
    names = [f"{one}_NUM_THREADS" for one in ("OMP", "OPENBLAS", "MKL", "NUMBA")]
    told = {f"__import__('os').environ['{name}']": ("1", None) for name in names}
    memory = "__import__('distributed').get_worker().memory_manager.memory_"
    # What a mesh takes can neither be put aside nor waited for.
    limits = {"limit": 2**32, "target_fraction": False, "spill_fraction": False}
    limits["pause_fraction"] = False
    told |= {memory + name: (value, None) for name, value in limits.items()}
    deaf = "2 in __import__('signal').pthread_sigmask(0, [])"  # to Ctrl-C, from their start
    if sys.platform != "win32":
        told[deaf] = (True, None)
        assert not eval(deaf)
    with engine() as run:
        assert results(run, told) == told
    assert sys.platform == "win32" or not eval(deaf)
    assert dict(os.environ) == before
    assert dict(vars(sys.modules["__main__"])) == main


def test_what_kills_its_worker_is_named_and_all_else_goes_on(
    forked: None, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    import dask
    from distributed import default_client

    monkeypatch.setattr(_engine, "_THREADS_PER_ITEM", 1)  # several in a task, as on a large cluster
    items = [f"{i} * {i}" for i in range(12)]
    items[3:3] = [DEATH, f"{DEATH} or 1", "1 / 0", None]
    shown = io.StringIO()
    logger, handler = logging.getLogger("distributed"), logging.StreamHandler(shown)
    logger.addHandler(handler)
    request.addfinalizer(lambda: logger.removeHandler(handler))
    # The cluster gives no worker up that takes its time to start again.
    hasty = dask.config.set({"distributed.deploy.lost-worker-timeout": "0s"})
    with hasty, engine(workers=2) as run:
        assert list(run.args[0]().nthreads().values()) == [1, 1]
        with pytest.raises(ValueError, match="No client"):
            default_client()  # what else the user does with Dask is left alone
        found = results(run, items)
    reasons = {found.pop(item)[1] for item in (DEATH, f"{DEATH} or 1")}
    assert reasons == {_engine._DEADLY}
    assert found.pop("1 / 0") == (None, "ZeroDivisionError: division by zero")
    assert found == {f"{i} * {i}": (i * i, None) for i in range(12)}
    assert shown.getvalue() == ""  # Dask would tell of every death


def test_a_session_without_a_script_stays_one(monkeypatch: pytest.MonkeyPatch) -> None:
    main = sys.modules["__main__"]
    monkeypatch.delattr(main, "__file__", raising=False)
    monkeypatch.setattr(main, "__spec__", "its own", raising=False)
    with _engine._setting(1, 2**30):
        assert main.__spec__ is None
    assert main.__spec__ == "its own"
    assert not hasattr(main, "__file__")


def test_what_was_done_is_done_again_where_its_worker_dies_before_it_is_fetched(
    forked: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    made = f"open({str(tmp_path / 'made')!r}"
    only_once = f"{made}, 'a').tell() and {DEATH} or {made}, 'a').write('x')"
    alive = {"1 + 1", only_once}

    def fetched(*arguments: Any, of: Any = _engine._outcomes) -> list[_engine.Outcome]:
        if item in alive:
            alive.remove(item)
            run.args[0]().run(os._exit, 1, on_error="ignore")  # in every worker of its client
        return of(*arguments)

    monkeypatch.setattr(_engine, "_outcomes", fetched)
    taken = []

    def endless() -> Iterator[str]:
        while True:
            taken.append(None)
            yield "1"

    with engine(workers=1) as run:
        source, item = run(eval, endless()), "1"
        while not next(source):
            pass
        source.close()
        assert len(taken) <= 2 * _engine._TASKS_PER_THREAD  # no more than are worked on
        item = "1 + 1"
        assert results(run, [item]) == {item: (2, None)}
        item = only_once
        assert results(run, [item]) == {item: (None, _engine._DEADLY)}
    assert not alive


def test_mistakes() -> None:
    for options, sentence in (
        ({"workers": -1}, "workers must be a whole number of at least 0, not -1"),
        ({"workers": "2"}, "workers must be a whole number of at least 0, not '2'"),
        ({"workers": 0.0}, "workers must be a whole number"),
        ({"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "leave out workers"),
    ):
        with pytest.raises(InputError, match=sentence), engine(**options):
            pass


def test_daemonic_processes_have_no_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(multiprocessing, "current_process", lambda: SimpleNamespace(daemon=True))
    with engine(workers=1) as run, pytest.raises(InputError, match="use workers=0"):
        list(run(abs, [1]))


def test_nobody_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_engine, "_PATIENCE_SECONDS", 2)
    with (
        pytest.raises(InputError, match="no Dask scheduler answers"),
        engine(scheduler="tcp://127.0.0.1:1") as run,
    ):
        results(run, ["1"])


def test_results_that_cannot_be_fetched_are_failures() -> None:
    future: Future[Any] = Future()
    future.set_exception(TypeError("cannot pickle a file"))
    found = _engine._outcomes(future, ["1", "2"], [])
    reason = "TypeError: cannot pickle a file"
    assert found == [_engine.Outcome("1", None, reason), _engine.Outcome("2", None, reason)]


def test_without_work_nobody_is_asked() -> None:
    with engine(scheduler="tcp://127.0.0.1:1") as run:
        assert results(run, [None]) == {}


def test_a_scheduler_that_goes_away_is_told(forked: None) -> None:
    from distributed import LocalCluster, default_client

    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address="127.0.0.1:0") as own:

        def items():
            yield "__import__('time').sleep(60)"
            with pytest.raises(ValueError, match="No client"):
                default_client()  # what else the user does with Dask is left alone
            own.close()
            yield None

        with (
            pytest.raises(UnbendError, match="the Dask scheduler went away"),
            engine(scheduler=own.scheduler_address) as run,
        ):
            results(run, items())


def test_workers_of_several_threads_are_refused(forked: None) -> None:
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address="127.0.0.1:0") as own,
        pytest.raises(InputError, match=r"one thread each: dask worker tcp://.* --nthreads 1"),
        engine(scheduler=own.scheduler_address) as run,
    ):
        results(run, ["1"])


def test_workers_that_do_not_come_are_told() -> None:
    def never(count: int, timeout: float) -> None:
        assert (count, timeout) == (1, _engine._PATIENCE_SECONDS)
        raise TimeoutError

    with pytest.raises(UnbendError, match=r"no Dask worker came in .* seconds: start one"):
        _engine._wait_for_workers(SimpleNamespace(wait_for_workers=never), "start one")


@pytest.mark.parametrize(("alone", "most"), [(False, 10 * _engine._TASKS_PER_THREAD), (True, 1)])
def test_workers_that_come_later_have_work_too_unless_one_item_is_tried_alone(
    monkeypatch: pytest.MonkeyPatch, alone: bool, most: int
) -> None:
    monkeypatch.setattr(_engine, "_HEARTBEAT_SECONDS", 1e-3)
    threads, given = {"first": 1}, []

    def submit(*task: object, **options: object) -> Future[None]:
        given.append(Future())  # never done
        return given[-1]

    client = SimpleNamespace(nthreads=lambda: threads, submit=submit)
    stream = _engine._stream(client, eval, itertools.repeat("1"), [], alone=alone)
    next(stream)
    assert len(given) == (1 if alone else _engine._TASKS_PER_THREAD)
    threads["second"] = 9
    for _ in range(50):
        next(stream)
    assert len(given) == most


def test_every_worker_has_its_share(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_engine, "n_cores", lambda: 8)
    monkeypatch.setattr(_engine, "available_memory", lambda: 2**32)
    assert _engine._local_shape(None) == (8, 1, 2**29)
    assert _engine._local_shape(2) == (2, 4, 2**31)
    monkeypatch.setattr(_engine, "available_memory", lambda: 2**30 + 2)
    assert _engine._local_shape(None) == (2, 4, 2**29 + 1)


def test_workers_share_what_the_user_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(LIMIT_VARIABLE, raising=False)
    with _engine._setting(1, 2**29):
        assert LIMIT_VARIABLE not in os.environ
    monkeypatch.setenv(LIMIT_VARIABLE, "4")
    with _engine._setting(1, 2**29):
        assert os.environ[LIMIT_VARIABLE] == "0.5"
    assert os.environ[LIMIT_VARIABLE] == "4"


def test_an_interruption_waits_until_the_cluster_can_be_closed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import distributed

    start = distributed.LocalCluster
    made = []

    def interrupted(**options: object) -> object:
        _thread.interrupt_main()  # as if another thread had received it
        made.append(start(**options))
        return made[0]

    monkeypatch.setattr(distributed, "LocalCluster", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # it may be ignored here
    try:
        with pytest.raises(KeyboardInterrupt), engine(workers=1) as run:
            results(run, ["1"])
    finally:
        signal.signal(signal.SIGINT, before)
    assert made[0].status == distributed.Status.closed


@pytest.mark.parametrize(
    ("counts", "total", "words", "share"),
    [
        ((100, 900, 3), 2000, "1,000 of 2,000 shapes, 3 failed, 10 a second, 1:40 left", 0.5),
        ((1, 0, 0), 4, "1 of 4 shapes, 0.1 a second, 0:30 left", 0.25),
        ((1, 0, 0), 200, "1 of 200 shapes, 0.1 a second, 33:10 left", 0.005),
        ((1, 0, 0), 1000, "1 of 1,000 shapes, 0.1 a second, 2:46:30 left", 0.001),
    ],
)
def test_progress_tells_the_rate_and_the_time_left(
    monkeypatch: pytest.MonkeyPatch, counts: tuple, total: int, words: str, share: float
) -> None:
    now = [0.0]
    monkeypatch.setattr(_engine.time, "monotonic", lambda: now[0])
    told = []
    tell = _engine.counted(lambda stage, share: told.append((stage, share)), "shapes", total)
    now[0] = 10.0
    tell(*counts)
    assert told == [(words, share)]
