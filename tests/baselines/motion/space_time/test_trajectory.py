"""Coordinates of postures, their derivative on the manifold, and third differences."""

import mujoco
import numpy as np
import pytest

from poise.baselines.motion.space_time.trajectory import (
    coordinate_derivative,
    coordinates,
    jerk,
    rotation_derivative,
    third_difference,
)
from tests.support.physics import random_state, robot_named


def test_the_derivative_of_coordinates_is_that_along_the_manifold() -> None:
    """Central differences along mj_integratePos, far from standing: 1e-7 of rounding and h²."""
    robot, rng, h = robot_named("humanoid"), np.random.default_rng(3), 1e-5
    qpos = np.array([random_state(robot, rng)[0] for _ in range(4)])
    delta = rng.normal(size=(4, robot.model.nv))

    def at(sign: float) -> np.ndarray:
        moved = qpos.copy()
        for posture, step in zip(moved, delta, strict=True):
            mujoco.mj_integratePos(robot.model, posture, step, sign * h)
        return coordinates(moved, robot.standing_qpos)

    turns = np.linalg.norm(coordinates(qpos, robot.standing_qpos)[:, 3:6], axis=1)
    assert turns.max() > 1.5  # [rad]: no small angles
    numeric = (at(1.0) - at(-1.0)) / (2.0 * h)
    exact = coordinate_derivative(qpos, robot.standing_qpos) @ delta.ravel()
    assert exact.reshape(numeric.shape) == pytest.approx(numeric, abs=1e-7)


def test_the_series_near_no_turn_meets_the_formula() -> None:
    axis = np.array([0.6, -0.64, 0.48])
    small, formula = rotation_derivative(np.array([0.9e-6 * axis, 1.1e-6 * axis]))
    assert small == pytest.approx(formula, abs=1e-6)
    assert rotation_derivative(np.zeros((1, 3)))[0] == pytest.approx(np.eye(3))


def test_third_differences() -> None:
    """Of a cubic inside exactly; of rest nothing; of a jump from rest what it takes."""
    dt, times = 0.1, 0.1 * np.arange(12)
    third = third_difference(12, dt)
    inside = (third @ (2.0 * times**3 - times**2 + 4.0))[3:-3]
    assert inside == pytest.approx(np.full(len(inside), 12.0))
    assert third @ np.full(12, 7.0) == pytest.approx(np.zeros(15), abs=1e-9)
    moving = third @ (times + 1.0)
    assert moving[3:-3] == pytest.approx(np.zeros(9), abs=1e-8)
    assert np.abs(moving).max() == pytest.approx(1.0 / dt**2)  # the velocity of 1 from rest


def test_jerk_is_that_of_the_joints() -> None:
    qpos = np.zeros((30, 9))
    times = np.arange(30) / 30.0
    qpos[:, 0] = np.sin(40.0 * times)  # the root's place does not count
    qpos[:, 7], qpos[:, 8] = times**3, 0.0
    assert jerk(qpos, 1.0 / 30.0) == pytest.approx(6.0 / np.sqrt(2.0))
