"""training/benchmarking/statistics/eurobench.py, against hand-worked numbers and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from poise.training.benchmarking.statistics.eurobench import (
    HUMAN_COM_HEIGHT,
    HUMAN_DEPTH,
    HUMAN_MASS,
    HUMAN_WIDTH,
    Size,
    body_sway,
    energy_factor,
    force_factor,
    human_reach,
    recovery_time,
    stability_margin,
    sway_angle,
    sway_velocity,
)
from poise.training.benchmarking.statistics.rates import mean_or_none


def test_sway_is_the_angle_of_the_line_from_the_ankles() -> None:
    """0.1 m ahead at 1 m is atan 0.1; what is across the push does not count."""
    com, ankles = np.array([[0.3, 0.5, 1.1], [0.2, -0.4, 1.1]]), np.tile([0.2, 0.0, 0.1], (2, 1))
    assert sway_angle(com, ankles, [2.0, 0.0]) == pytest.approx([np.arctan(0.1), 0.0])
    assert sway_angle(com, ankles, [0.0, -1.0]) == pytest.approx([-np.arctan(0.5), np.arctan(0.4)])


def test_body_sway_counts_from_where_the_push_begins() -> None:
    """The largest way from the angle at rest, to either side; what was before does not count."""
    assert body_sway([9.0, 0.01, 0.05, -0.06, 0.0], 1) == pytest.approx(0.07)


def test_the_filter_lets_slow_sway_pass_and_halves_10_hz_twice() -> None:
    """1 Hz keeps its speed; at the cutoff both passes take 1/√2 each, as |H|² = 1/2."""
    rate, t = 200.0, np.arange(0, 10, 1 / 200.0)
    middle = slice(400, -400)
    for frequency, gain in ((1.0, 1.0), (10.0, 0.5)):
        speed = sway_velocity(np.sin(2 * np.pi * frequency * t), rate)[middle]
        # central differences know sin(2πf/rate)/(2πf/rate) of the slope
        known = np.sinc(2 * frequency / rate)
        expected = 2 * np.pi * frequency * gain * known
        assert np.max(np.abs(speed)) == pytest.approx(expected, rel=0.01)


def test_the_filter_is_scipys_second_order_butterworth() -> None:
    """The angle is filtered forwards and backwards by butter(2, 10 Hz)."""
    angle = np.cumsum(np.random.default_rng(0).normal(size=200)) * 1e-3
    sections = signal.butter(2, 10.0, fs=50.0, output="sos")
    filtered = signal.sosfiltfilt(sections, angle, padlen=9)
    assert sway_velocity(angle, 50.0) == pytest.approx(np.gradient(filtered, 0.02), abs=1e-12)


def test_recovery_ends_when_the_sway_is_slow_for_good() -> None:
    """θ = 0.1 e^(−t) has |θ̇| = 0.015 at t = ln(0.1/0.015) = 1.897 s, in steps of 20 ms."""
    rate, t = 50.0, np.arange(0, 6, 0.02)
    angle = np.concatenate([np.zeros(25), 0.1 * (1 - np.exp(-t))])
    assert recovery_time(angle, 25, rate) == pytest.approx(np.log(0.1 / 0.015), abs=0.04)


def test_turning_points_are_no_recovery_and_unrest_has_none() -> None:
    """A swing stands still at its turns; without a quiet second at the end there is no time."""
    t = np.arange(0, 6, 0.02)
    assert recovery_time(0.05 * np.sin(2 * np.pi * 0.5 * t), 0, 50.0) is None
    assert recovery_time(np.zeros(300), 25, 50.0) == 0.0
    swing = np.where(t < 3.0, 0.05 * np.sin(2 * np.pi * 0.5 * t), 0.0)
    assert recovery_time(swing, 0, 50.0) == pytest.approx(3.0, abs=0.15)
    assert recovery_time(np.where(t < 5.5, swing + 0.05 * np.sin(3 * t), 0.0), 0, 50.0) is None


def runs(*cells: tuple[float, int, int]) -> tuple[list[float], list[bool]]:
    """Levels and falls of (level, runs, falls)."""
    levels = [level for level, count, _ in cells for _ in range(count)]
    return levels, [k < falls for _, count, falls in cells for k in range(count)]


def test_the_margin_is_the_last_level_with_less_than_30_percent_falls() -> None:
    """2 of 10 is withstood, 3 of 10 is lost; what comes after a lost level does not count."""
    assert stability_margin(*runs((5, 10, 0), (10, 10, 2), (15, 10, 3))) == 10
    assert stability_margin(*runs((5, 10, 3), (10, 10, 0))) == 0
    assert stability_margin(*runs((5, 10, 0), (10, 10, 4), (15, 10, 0))) == 5
    assert stability_margin(*runs((15, 10, 9), (5, 10, 0))) == 5


def test_a_level_needs_ten_runs() -> None:
    """Nine runs say nothing, in whatever order they come."""
    assert stability_margin(*runs((5, 9, 0))) is None
    assert stability_margin(*runs((5, 10, 0), (10, 9, 9), (15, 12, 0))) == 15


def test_the_protocols_human_normalises_to_itself() -> None:
    """81.4 kg; the factors of the human's own size are 1, in both directions."""
    segments = 4.2 + 1.1 + 24.9 + 2.4 + 11.8 + 2 * (2.0 + 1.4 + 0.5 + 9.8 + 3.8 + 1.0)
    assert pytest.approx(segments) == HUMAN_MASS
    assert pytest.approx(1.0028, abs=1e-4) == HUMAN_COM_HEIGHT
    for reach in (HUMAN_DEPTH, HUMAN_WIDTH):
        human = Size(HUMAN_MASS, HUMAN_COM_HEIGHT, reach)
        assert force_factor(human, reach) == pytest.approx(1.0)
        assert energy_factor(human, reach) == pytest.approx(1.0)


def test_factors_by_hand() -> None:
    """Half the mass, twice the base, half the height: force ½·2·2; energy by the tipping rise."""
    size = Size(HUMAN_MASS / 2, HUMAN_COM_HEIGHT / 2, 2 * HUMAN_DEPTH)
    assert force_factor(size, HUMAN_DEPTH) == pytest.approx(2.0)
    rise = np.sqrt(0.222**2 + 0.5014**2) - 0.5014
    human = np.sqrt(0.111**2 + 1.0028**2) - 1.0028
    assert energy_factor(size, HUMAN_DEPTH) == pytest.approx(0.5 * rise / human, rel=1e-3)


def test_pushes_within_45_degrees_of_forward_are_frontal() -> None:
    """The depth of the human's base to the front and back, half its width to the sides."""
    assert [human_reach(a) for a in (0, 40, 180, 330)] == [HUMAN_DEPTH] * 4
    assert [human_reach(a) for a in (90, 50, 270)] == [HUMAN_WIDTH] * 3


def test_means_leave_out_what_is_missing() -> None:
    """None where nothing is left."""
    assert mean_or_none([1.0, None, 3.0]) == 2.0 and mean_or_none([None]) is None
