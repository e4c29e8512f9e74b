"""Motions with steps are performed, left to catch a fall, and gone on with."""

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.motion.performing.motion_step import MotionStep
from poise.training.motion.following.follow import follow
from tests.support.physics import robot_named
from tests.support.refused import invalid


def play(controller: str, motion: str, seconds: float, push: dict | None = None, python=False):
    """The environment after so long, and whether the planner has had to take over on the way."""
    env = ResidualBalanceEnv(
        robot_named("humanoid"), controller=controller, motion=motion, pushes=None, duration=60.0
    )
    if python:
        env._compiled = False
    env.reset(seed=3, options={} if push is None else {"push": push})
    action, left = np.zeros(len(env.action_names)), False
    while env.simulation.time < seconds - 1e-9 and not env.fallen:
        env.step(action)
        performance = getattr(env.controller, "performance", None)
        left |= performance is not None and not performance.performing
    return env, left


@pytest.mark.parametrize("motion", ["kick", "step_in_place"])
def test_packaged_motions_are_performed_on_one_foot(motion: str) -> None:
    (trial,) = follow(motion, "motion-step", robot=robot_named("humanoid"), starts=1, seed=5)
    assert not trial.fallen and trial.solver_failures == 0 and trial.interruptions == 0
    assert trial.swing_error < 0.03 and trial.support_slide < 0.01
    assert trial.placement_error < 0.03 and trial.body_error < 0.02


def test_with_both_soles_planted_it_is_feedback_step_bit_for_bit() -> None:
    push = {"impulse": 30.0, "direction": 0.0, "start": 0.3, "duration": 0.1, "body": "torso"}
    ends = [play(name, "squat", 1.5, push)[0] for name in ("feedback-step", "motion-step")]
    np.testing.assert_array_equal(*(env.simulation.data.qpos for env in ends))
    assert ends[1].controller.steps > 0


def test_a_push_on_one_foot_is_caught_and_the_motion_gone_on_with() -> None:
    push = {"impulse": 14.0, "direction": 90.0, "start": 1.7, "duration": 0.1, "body": "torso"}
    env, left = play("motion-step", "step_in_place", 11.0, push)
    controller = env.controller
    assert isinstance(controller, MotionStep) and controller.performance is not None
    assert left and not env.fallen and controller.steps > 1
    assert controller.performance.performing == 1
    assert abs(env.simulation.state.com_vel).max() < 0.05


def test_compiled_and_python_ticks_have_the_same_bits() -> None:
    ends = [play("motion-step", "kick", 1.9, python=python)[0] for python in (False, True)]
    np.testing.assert_array_equal(*(env.simulation.data.qpos for env in ends))
    assert ends[0].controller.steps == 1


def test_a_controller_that_keeps_its_feet_planted_says_so() -> None:
    with invalid("motion", "'kick'"):
        play("momentum-qp", "kick", 0.1)
