"""A bound against hangs: in processor time, so that a busy machine changes nothing."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

HANG = 30.0  # [s] of this process; what is bounded takes milliseconds


@contextmanager
def no_hang(seconds: float = HANG) -> Iterator[None]:
    """Raise TimeoutError inside once this process has computed for so long.

    It tells a refusal from a hang, not a fast one from a slow one.
    """

    def late(_: int, __: FrameType | None) -> None:
        raise TimeoutError(f"has not ended within {seconds} s of processor time")

    before = signal.signal(signal.SIGPROF, late)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
