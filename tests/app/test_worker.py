"""The process that runs jobs: cancelled, killed, short of memory, it is replaced."""

import os
import signal
import threading

import pytest

from unbend import write_mesh
from unbend.app import _worker
from unbend.app._worker import Worker
from unbend.datasets import make_sphere
from unbend.errors import warn

GIB = 2**30


@pytest.fixture(scope="module")
def worker():
    worker = Worker(64 * GIB)
    yield worker
    worker.close()


def sample(folder) -> dict:
    return {"do": "sample", "folder": str(folder), "shapes": [], "up": "y"}


def run_until(worker, folder, act):
    """Run a job, and do something to it once it works."""
    started, answers = threading.Event(), []
    thread = threading.Thread(
        target=lambda: answers.append(worker.begin()(sample(folder), lambda *_: started.set()))
    )
    thread.start()
    assert started.wait(60)
    act()
    thread.join(60)
    return answers[0]


def test_a_cancelled_job_ends_and_the_next_one_runs(worker, tmp_path) -> None:
    before = worker._process.pid
    assert run_until(worker, tmp_path / "a", worker.cancel) == {}
    assert worker._process.pid != before
    write_mesh(tmp_path / "ball.ply", make_sphere(1))
    job = {"do": "look", "folder": str(tmp_path / "b"), "up": "y"}
    found = worker.begin()(job | {"shapes": [[str(tmp_path / "ball.ply"), "b"]]}, lambda *_: None)
    assert found["usable"]
    assert found["warnings"] == []


def test_a_closed_worker_starts_no_other(tmp_path) -> None:
    worker = Worker(64 * GIB)
    assert run_until(worker, tmp_path / "a", worker.close) == {}
    assert not worker._process.is_alive()


def test_errors_are_sentences(worker, tmp_path) -> None:
    (tmp_path / "bad.off").write_text("OFF\n1 1\n", encoding="utf-8")
    job = {
        "do": "look",
        "folder": str(tmp_path / "a"),
        "shapes": [[str(tmp_path / "bad.off"), "b"]],
    }
    found = worker.begin()(job | {"up": "y"}, lambda *_: None)
    assert "bad.off" in found["error"]
    found = worker.begin()(job | {"folder": "/nowhere/at/all"}, lambda *_: None)
    assert "please report this" in found["error"]


def test_warnings_are_told_once() -> None:
    def run(job, progress):
        warn("two pieces")
        warn("two pieces")
        return {"title": "done"}

    assert _worker._answer(run, {}, print) == {"title": "done", "warnings": ["two pieces"]}


@pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="the system does not tell")
def test_a_job_that_takes_too_much_memory_is_ended(worker, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(worker, "_memory", 2**20)
    found = worker.begin()(sample(tmp_path / "a"), lambda *_: None)
    assert "more memory than there is" in found["error"]


def test_a_killed_worker_is_a_sentence_and_replaced(worker, tmp_path) -> None:
    before = worker._process.pid
    kill = getattr(signal, "SIGKILL", signal.SIGTERM)
    found = run_until(worker, tmp_path / "a", lambda: os.kill(before, kill))
    assert "ended unexpectedly" in found["error"]
    assert worker._process.pid != before
