"""envs/sensing/drawn.py: the robot of an episode."""

from dataclasses import fields

import numpy as np
import pytest

from poise.envs.sensing.drawn import NOISES, DrawnRobot
from poise.envs.sensing.realism import SensorErrors
from tests.support.sensing import drawn_of
from tests.support.shared import robot


def same(one: DrawnRobot, other: DrawnRobot, *but: str) -> bool:
    return all(
        np.array_equal(getattr(one, f.name), getattr(other, f.name))
        for f in fields(DrawnRobot)
        if f.name not in but
    )


def test_a_seed_is_a_robot():
    """And where levels differ in one field, the robots differ in that alone."""
    first = drawn_of("field", 3)
    assert same(first, drawn_of("field", 3)) and not same(first, drawn_of("field", 4))
    other = drawn_of({"base": "field", "motors": {"lag": 0.0}, "ground": {"friction": None}}, 3)
    assert same(first, other, "lag", "friction") and other.lag == 0.0 and other.friction is None


def test_numbers_are_within_their_ranges_and_fill_them():
    """Of 200 robots; uniform numbers leave out a tenth at an end once in 10⁹ times."""
    drawn = [drawn_of("field", seed) for seed in range(200)]
    for name, low, high in (
        ("lag", 0.005, 0.015), ("payload", 0.0, 0.1), ("friction", 0.3, 1.0),
        ("softness", 0.02, 0.04),
    ):  # fmt: skip
        values = np.array([getattr(d, name) for d in drawn])
        tenth = 0.1 * (high - low)
        assert low <= values.min() < low + tenth and high - tenth < values.max() <= high, name
    assert {d.sense for d in drawn} == {2, 3, 4, 5} == {d.command for d in drawn}
    for name, bound in (
        ("encoder_bias", 0.015), ("gyro_bias", 0.02), ("accelerometer_bias", 0.1),
        ("tilt_bias", 0.02),
    ):  # fmt: skip
        values = np.array([getattr(d, name) for d in drawn])
        assert 0.9 * bound < abs(values).max() <= bound, name
    shifts = np.array([np.linalg.norm(d.com_shift) for d in drawn])
    slopes = np.array([np.hypot(*d.slope) for d in drawn])
    assert shifts.max() <= 0.03 and slopes.max() <= np.tan(np.radians(2.0)) + 1e-12
    gains, masses = (np.array([getattr(d, n) for d in drawn]) for n in ("gain", "mass_factor"))
    assert abs(gains - 1.0).max() <= 0.1 and abs(masses - 1.0).max() <= 0.05
    assert gains.shape[1] == robot().model.nu and masses.shape[1] == robot().model.nbody


def test_measured_means_that_a_sensor_errs():
    """Delays, motors, bodies and ground are no errors of measurement; each noise and bias is."""
    level = {"latency": {"sense": 0.01}, "motors": {"lag": 0.01}, "body": {"mass": 0.1}}
    assert not drawn_of(level).measured
    for sensor in fields(SensorErrors):
        assert drawn_of({"sensors": {sensor.name: 0.01}}).measured, sensor.name
    assert drawn_of({"motors": {"backlash": 0.01}}).measured
    assert set(NOISES) <= {sensor.name for sensor in fields(SensorErrors)}


def test_later_fields_leave_the_others_as_they_were():
    """A seed's robot in `field` is the one that it was before there were arms and hands."""
    first = drawn_of("field", 3)
    other = drawn_of({"base": "field", "motors": {"arms": 0.5}, "body": {"hand": [0.1, 0.2]}}, 3)
    assert first.seed == 5042854753669335956 and first.payload == 0.09094545797692971
    assert same(first, other, "arms", "hand") and other.arms == 0.5 and 0.1 <= other.hand <= 0.2
    assert other.summary(0.002)["side"] in (0, 1) and "arms" not in first.summary(0.002)


def test_the_summary_is_in_units():
    """Seconds and degrees; what the robot has of its own is not told."""
    level = {"latency": {"sense": 0.006}, "ground": {"slope": 2.0}, "body": {"com": 0.02}}
    told = drawn_of(level).summary(0.002)
    assert told["sense_delay"] == 0.006 and told["slope"] == pytest.approx(2.0)
    assert told["com_shift"] == pytest.approx(0.02) and not {"friction", "softness"} & set(told)
