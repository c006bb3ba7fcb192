"""Progress of long runs, in words."""

from __future__ import annotations

import time
from collections.abc import Callable

from unbend._types import Progress


def counted(progress: Progress | None, noun: str, total: int) -> Callable[[int, int, int], None]:
    """Wrap a progress callback: report counts, the rate and the time left.

    The wrapper takes the number of items computed, the number skipped, and the number that failed
    among those computed. `noun` is the plural of what is counted.
    """
    start = time.monotonic()

    def tell(computed: int, skipped: int, failed: int) -> None:
        if progress is None:
            return
        done = computed + skipped
        words = [f"{done:,} of {total:,} {noun}"]
        if failed:
            words.append(f"{failed:,} failed")
        if computed:
            rate = computed / max(time.monotonic() - start, 1e-9)
            words.append(f"{rate:.3g} a second")
            if done < total:
                words.append(f"{_clock((total - done) / rate)} left")
        progress(", ".join(words), done / max(total, 1))

    return tell


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
