"""sessions/pace.py: as many steps as the clock asks for, and how many were late."""

from __future__ import annotations

import pytest

from poise.training.pictures.sessions.pace import BACKLOG, RealTimePace

PERIOD = 0.02


class Clock:
    """A wall clock that a test moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def test_steps_come_in_real_time() -> None:
    """However the calls lie: 10 s of the clock are 500 steps."""
    clock = Clock()
    pace, count = RealTimePace(clock), 0
    for k in range(1000):
        clock.now += 0.003 if k % 2 else 0.017
        count += pace.due(PERIOD)
    assert count == pytest.approx(500, abs=1)
    assert pace.total == pytest.approx(1.0, abs=0.003) and pace.factor == pytest.approx(1.0, 0.02)


def test_slow_motion_is_fewer_steps() -> None:
    """A quarter of them at a quarter of the speed; that is not slow in the sense of the factor."""
    clock = Clock()
    pace, count = RealTimePace(clock), 0
    pace.speed = 0.25
    for _ in range(1000):
        clock.now += 0.01
        count += pace.due(PERIOD)
    assert count == pytest.approx(125, abs=1) and pace.total == pytest.approx(1.0, abs=0.01)
    assert pace.until_due(PERIOD) <= PERIOD / 0.25 + 1e-9


def test_what_is_too_late_is_given_up_and_counted() -> None:
    """Steps that take twice as long as they should: half of real time, and no growing debt."""
    clock = Clock()
    pace, most = RealTimePace(clock), 0
    for _ in range(200):
        most = max(most, count := pace.due(PERIOD))
        clock.now += max(2 * PERIOD * count, 0.001)
    assert most <= round(BACKLOG / PERIOD)
    assert pace.total == pytest.approx(0.5, abs=0.05)
    assert pace.factor == pytest.approx(0.5, abs=0.05)


def test_a_pause_does_not_count() -> None:
    """Time at rest is neither owed nor late."""
    clock = Clock()
    pace = RealTimePace(clock)
    clock.now += 60.0
    pace.rest()
    assert pace.due(PERIOD) == 0 and pace.wanted == 0.0 and pace.total == 1.0
