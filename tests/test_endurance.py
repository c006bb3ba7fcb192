"""A command that is ended leaves its whole output or none, and nothing that harms the next."""

from __future__ import annotations

import signal
import sys

import pytest

from endurance import COMMANDS, interrupt

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals are others there")


@pytest.mark.parametrize(
    ("name", "by"), [("distance", signal.SIGKILL), ("collection export", signal.SIGINT)]
)
def test_an_ended_command_leaves_no_half(name: str, by: signal.Signals) -> None:
    codes = interrupt(COMMANDS[name], by, [0.9])
    assert set(codes) <= {0, 130, -by, 1}
