"""How far a long run is."""

from __future__ import annotations

import pytest

from unbend.collection import _progress
from unbend.collection._progress import counted


def test_progress_tells_the_rate_and_the_time_left(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(_progress.time, "monotonic", lambda: now[0])
    told = []
    tell = counted(lambda stage, share: told.append((stage, share)), "shapes", 2000)
    now[0] = 10.0
    tell(100, 900, 3)
    assert told == [("1,000 of 2,000 shapes, 3 failed, 10 a second, 1:40 left", 0.5)]
    assert _progress._clock(3 * 3600 + 62) == "3:01:02"
