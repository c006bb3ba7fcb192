"""What happens at random moments or in many processes at once harms nothing that comes after."""

import signal
import sys

import pytest

from endurance import COMMANDS, interrupt


@pytest.mark.skipif(sys.platform == "win32", reason="signals are others there")
@pytest.mark.parametrize("by", ["SIGKILL", "SIGINT"])
def test_an_ended_command_leaves_no_half(by: str) -> None:
    codes = interrupt(COMMANDS["distance"], signal.Signals[by], [0.9])
    assert set(codes) <= {0, 130, -signal.Signals[by], 1}
