"""``unbend app`` as a command: what it refuses, how it is stopped, and what it leaves."""

import os
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from terminal import invoke


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["none.ply"], "cannot read none.ply: there is no such file"),
        (["--collection", "none"], "there is no collection at none"),
        (["--port", "65536"], "65535"),
    ],
)
def test_what_is_not_there_is_told_before_anything_opens(words, told) -> None:
    done = invoke(["app", *words])
    assert done.exit_code == 2
    assert told in done.stderr


def test_a_port_that_is_taken_is_told() -> None:
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = invoke(["app", "--port", str(port)])
    assert done.exit_code == 2
    assert f"port {port} is in use, or not allowed" in done.stderr


def test_without_the_extra_it_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    done = invoke(["app"])
    assert done.exit_code == 2
    assert "uvicorn is needed for this: pip install uvicorn starlette" in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="its signals are others")
def test_it_ends_by_ctrl_c_and_cleans_up_after_a_killed_run(tmp_path: Path) -> None:
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    run = [sys.executable, "-m", "unbend", "app", "--no-browser"]
    for how, code in ((signal.SIGKILL, -9), (signal.SIGINT, 0)):
        with subprocess.Popen(run, stdout=subprocess.PIPE, env=environment, text=True) as process:
            address = process.stdout.readline().strip()
            with urllib.request.urlopen(address) as answer:
                assert b"unbend" in answer.read()
            assert len(list(tmp_path.glob("unbend-app-*"))) == 1
            process.send_signal(how)
            assert process.wait(60) == code
    assert list(tmp_path.glob("unbend-app-*")) == []
