"""The time of a motion waits while the CoM is far from where it is to be."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.tempo import (
    Pace,
    Tempo,
    make_pace,
    motion_time_of,
    slow_down,
)
from poise.envs.physics.kinematics import StateArrays, allocate_state

TICK, H = 0.004, 0.9


def course(tempo: Tempo, distances: list[float], feet: float = 1.0) -> tuple[Pace, np.ndarray]:
    """The motion's time at each tick, the CoM so far from its reference [h]."""
    pace, state = make_pace(tempo, H), standing(feet)
    times = [motion_time_of(pace, state, np.zeros(3), 0.0, 0.0)]
    for k, distance in enumerate(distances, 1):
        state.com[0] = distance * H
        times.append(motion_time_of(pace, state, np.zeros(3), 0.0, k * TICK))
    return pace, np.array(times)


def standing(feet: float) -> StateArrays:
    state = allocate_state(27, 2, 14)
    state.contacts[:] = feet
    return state


def test_time_runs_as_the_clock_unless_it_waits() -> None:
    far = [0.1] * 50
    pace, times = course(Tempo(waits=False), far)
    assert times == pytest.approx(TICK * np.arange(51), abs=0.0)
    samples = np.ones((3, 4))
    slow_down(pace, samples)
    assert np.array_equal(samples, np.ones((3, 4)))
    assert course(Tempo(waits=True), [0.0] * 50)[1] == pytest.approx(TICK * np.arange(51), abs=1e-9)


def test_the_rate_follows_beta_with_its_lag() -> None:
    """At one distance d the rate goes to 1/e, by 1 − 1/e of the way in a lag; never below least."""
    tempo = Tempo(waits=True, distance=0.02, lag=0.1, least=0.05, after="resume")
    pace, _ = course(tempo, [0.02] * 25)
    end, way = np.exp(-1.0), (1.0 - TICK / 0.1) ** 25
    assert pace.rate == pytest.approx(end + (1.0 - end) * way, rel=1e-9)
    assert course(tempo, [0.2] * 500)[0].rate == pytest.approx(0.05, abs=1e-6)
    assert course(tempo, [0.2] * 500, feet=0.0)[0].rate == pytest.approx(0.0, abs=1e-6)
    assert course(replace(tempo, lag=1e-4), [0.02])[0].rate == pytest.approx(end)


def test_rates_of_the_reference_are_those_of_its_clock() -> None:
    """q(s(t)) = sin(3 s): its first and second derivative by differences over the clock."""
    tempo = Tempo(waits=True, lag=0.1)
    pace, state = make_pace(tempo, H), standing(1.0)
    seen = []
    for k in range(400):
        state.com[0] = 0.02 * H * np.sin(0.02 * k)
        s = motion_time_of(pace, state, np.zeros(3), 0.0, k * 1e-4)
        sample = np.array([[np.sin(3.0 * s)], [3.0 * np.cos(3.0 * s)], [-9.0 * np.sin(3.0 * s)]])
        slow_down(pace, sample)
        seen.append(sample[:, 0])
    q, v, a = np.array(seen).T
    assert np.ptp(v) > 0.3  # it did slow down
    assert np.abs(np.diff(q) / 1e-4 - v[1:]).max() < 2e-3
    assert np.abs(np.diff(v) / 1e-4 - a[1:])[1:].max() < 2e-2


@pytest.mark.parametrize("after", ["resume", "catch-up", "restart"])
def test_after_the_wait(after: str) -> None:
    """A second of waiting: on with the delay, or on time again, or from the begin."""
    tempo = Tempo(waits=True, after=after)
    pace, times = course(tempo, [0.0] * 250 + [0.1] * 250 + [0.0] * 2000)
    held, end = times[500] - times[250], 2500 * TICK
    assert 0.1 <= held < 0.3
    assert pace.rate == pytest.approx(1.0, abs=1e-3)
    assert abs(pace.change) < 1e-2
    if after == "catch-up":
        assert pace.time == pytest.approx(end, abs=0.02)
        assert np.diff(times).max() < 1.26 * TICK
    elif after == "resume":
        assert 0.6 < end - pace.time < 0.95
        assert np.diff(times).min() > 0.0
    else:
        begun = 500 + int(np.argmin(times[500:]))
        assert times[begun] == 0.0 and np.diff(times[begun + 100 :]).min() > 0.9 * TICK
        assert times[-1] > 0.8 * (end - begun * TICK)


def test_a_pace_begins_anew() -> None:
    pace, _ = course(Tempo(waits=True), [0.1] * 100)
    pace.clear()
    state = pace.time, pace.rate, pace.change, pace.clock, pace.back
    assert state == (0.0, 1.0, 0.0, 0.0, 0)
