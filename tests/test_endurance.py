"""What happens at random moments or in many processes at once harms nothing that comes after."""

import signal
import sys

import pytest

from endurance import COMMANDS, interrupt


@pytest.mark.skipif(sys.platform == "win32", reason="signals are others there")
def test_an_ended_command_leaves_no_half() -> None:
    killed, stopped = interrupt(COMMANDS["distance"], [(signal.SIGKILL, 0.9), (signal.SIGINT, 0.9)])
    assert killed in (0, -signal.SIGKILL)
    assert stopped in (0, 1, 130, -signal.SIGINT)
