"""The equations of the stance knee, against the moment of the force itself."""

from dataclasses import replace

import numpy as np
import pytest

from poise.envs.robots.robot import load_robot
from tests.performance.knee_bound import (
    G,
    borne,
    flat_soles,
    knee_torque,
    least_torque,
    plane_of,
    swing_torque,
)


def test_a_knee_on_the_line_of_the_force_bears_nothing() -> None:
    """`double` with its CoP well ahead frees the knee; a bent knee bears m g times its offset."""
    body = plane_of(load_robot("human"))
    assert np.abs(knee_torque(body, "double", 0.08, 0.0)).max() < 0.02
    offset = body.shank * np.sin(np.arctan2(body.thigh * np.sin(0.6), body.shank))
    spring = knee_torque(body, "spring", 0.0, 0.0)  # β about 0.6 rad over all of the stance
    assert spring.mean() == pytest.approx(G * offset, rel=0.4)


def test_the_spring_bears_more_than_the_double_pendulum_on_both_bodies() -> None:
    """By 4 and by 12 with the CoP in mid-sole; a slower swing spares the knee."""
    for name, ratio in (("humanoid", 3.5), ("human", 8.0)):
        robot = load_robot(name)
        body = plane_of(robot)
        middle = 0.5 * sum(body.cop)
        mean = {model: np.abs(knee_torque(body, model, middle, 0.0)).mean()
                for model in ("spring", "double")}  # fmt: skip
        assert mean["spring"] > ratio * mean["double"]
        assert least_torque(body, "spring")[0] > 3.0 * least_torque(body, "double")[0]
        assert swing_torque(robot, body, 0.46) < 0.8 * swing_torque(robot, body, 0.36)


def test_flat_soles_bend_the_leg_ahead_more_than_its_knee_is_free_in_long_steps() -> None:
    """By hand: legs of 1 m in two halves. The hip is √(0.9998² − 0.335²) high, the leg ahead
    0.265 m off; with the CoP under the ankle no flexion is free."""
    body = replace(plane_of(load_robot("human")), thigh=0.5, shank=0.5, cop=(0.0, 0.0), lean=0.0)
    flexion, free, least = flat_soles(body, 0.6, 1.0)
    z = np.sqrt(0.5 + 0.5 * np.cos(np.radians(2.0)) - 0.335**2)
    assert flexion == pytest.approx(2.0 * np.arccos(np.hypot(z, 0.265)))
    assert abs(free) < 0.02
    assert least == pytest.approx(abs(borne(body, flexion, -0.265, z, 0.0, -0.265)))
    for name in ("humanoid", "human"):
        flexion, free, least = flat_soles(plane_of(load_robot(name)), 0.6, 1.0)
        assert flexion > free and least > 0.02
    flexion, free, least = flat_soles(plane_of(load_robot("human")), 0.22, 0.5)
    assert flexion < free and least < 0.01
