"""Repairs: slower where that helps, the CoM elsewhere where it does not, else refused."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.motion.feasibility.check import FeasibilityLimits, check_motion
from poise.baselines.motion.feasibility.fit import NotFitted, fit_motion, zmp_offset
from poise.baselines.motion.feasibility.trajectory import PlantedRobot, joints_of, sample_trajectory
from tests.support.physics import robot_named
from tests.support.robot_clips import ahead_clip, com_clip


def bump(t: float, begin: float, length: float) -> float:
    """Up to 1 and back, smoothly."""
    s = np.clip((t - begin) / length, 0.0, 1.0)
    return float(np.sin(np.pi * s) ** 4)


def test_the_offset_solves_its_equation() -> None:
    """δc − h/(g + c̈_z) δc̈ = δp in between, 0 at both ends; a still CoM has cosh for it."""
    robot = robot_named("humanoid")
    times, still = np.arange(0.0, 2.0 + 1e-9, 0.01), load_motion("standing", robot)
    path = sample_trajectory(PlantedRobot(robot), joints_of(still), times)
    gravity = robot.units.gravity
    offset = zmp_offset(path, np.full((len(times), 2), 0.05), gravity)
    rate = np.sqrt(gravity / (path.com[0, 2] - path.height))
    exact = 0.05 * (1.0 - np.cosh(rate * (times - 1.0)) / np.cosh(rate))
    np.testing.assert_allclose(offset[:, 0], exact, atol=2e-5)
    np.testing.assert_allclose(offset[[0, -1]], 0.0, atol=1e-12)


def test_what_is_possible_stays_as_it_is() -> None:
    robot = robot_named("humanoid")
    clip = com_clip(robot, lambda t: np.array([0.0, 0.02 * bump(t, 0.2, 2.0), 0.0]), 2.4)
    fitted = fit_motion(clip, robot)
    assert fitted.clip is clip and fitted.tempo == 1.0 and fitted.moved == 0.0


def test_a_hasty_motion_is_slowed_down() -> None:
    robot = robot_named("humanoid")
    clip = com_clip(robot, lambda t: np.array([0.0, 0.04 * bump(t, 0.1, 1.0), 0.0]), 1.2)
    assert not check_motion(clip, robot).feasible
    fitted = fit_motion(clip, robot)
    assert fitted.tempo < 1.0 and fitted.moved == 0.0
    assert fitted.clip.duration == pytest.approx(clip.duration / fitted.tempo)
    assert check_motion(fitted.clip, robot).feasible and fitted.feasibility.feasible


def test_a_lean_that_is_too_far_gets_its_com_moved_back() -> None:
    """However slow, a CoM held 9 cm ahead is more than the ankles bear."""
    robot = robot_named("humanoid")

    def lean(t: float) -> np.ndarray:
        return np.array([0.11 * bump(t, 0.2, 3.0), 0.0, 0.0])

    clip = com_clip(robot, lean, 3.4, 0.1)
    fitted = fit_motion(clip, robot)
    assert 0.005 < fitted.moved < 0.05
    assert check_motion(fitted.clip, robot).feasible
    assert fitted.feasibility.torque.max() > 0.7  # it goes no further back than it has to


def test_what_nothing_helps_names_the_worst_sample() -> None:
    """Knees that are too weak for the posture are so at any tempo and over any place."""
    robot = robot_named("humanoid")
    clip = com_clip(robot, lambda t: np.array([0.0, 0.0, -0.1 * bump(t, 0.2, 0.6)]), 1.0)
    limits = FeasibilityLimits(torque=0.2)
    with pytest.raises(NotFitted, match=r"moved: no tempo .*torque.* at \d\.\d\d s.* is needed"):
        fit_motion(clip, robot, limits)


def test_hasty_steps_are_slowed_down_and_planned_again() -> None:
    """Twice as fast the weight cannot get from foot to foot in time."""
    robot = robot_named("humanoid")
    clip = ahead_clip(robot)
    hasty = replace(clip, dt=clip.dt / 1.8)
    assert not check_motion(hasty, robot).feasible
    fitted = fit_motion(hasty, robot)
    assert fitted.clip.planted is clip.planted and fitted.moved > 0.0
    assert fitted.clip.duration == pytest.approx(hasty.duration / fitted.tempo)
    assert check_motion(fitted.clip, robot).feasible
    assert fit_motion(clip, robot).clip is clip
    with pytest.raises(NotFitted, match=r"ahead: no tempo .* with the centre of mass planned ag"):
        fit_motion(hasty, robot, FeasibilityLimits(torque=0.2))
