"""The momentum QP follows every packaged motion, at rest and while it is lightly pushed."""

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from tests.support.physics import robot_named

MOTIONS = ("squat", "bow", "arm_swing", "weight_shift")
IMPULSE = 4.0  # [N·s], a light push


def follow(motion, direction=None):
    """Largest errors while following: joints [rad], CoM over the ground and its height [m], root
    [rad]; how much the reference moved; and the environment."""
    robot = robot_named("humanoid")
    env = ResidualBalanceEnv(robot, motion=motion, pushes=None, duration=4.0)
    body = robot.model.body(robot.root_body_id).name
    push = {"impulse": IMPULSE, "duration": 0.1, "start": 1.3, "body": body}
    pushes = [] if direction is None else [{**push, "direction": direction}]
    env.reset(seed=0, options={"push": pushes, "noise": 0.0})
    errors, references = [], []
    for _ in range(env.max_steps):
        env.step_without_info(np.zeros(4))
        assert not env.fallen
        state, targets = env.simulation.state, env.targets
        turn = 0.5 * (np.trace(state.root_axes.T @ targets.root_axes) - 1.0)
        gap = state.com - targets.com
        joints = np.abs(state.q - targets.q_ref).max()
        errors.append([joints, np.hypot(*gap[:2]), abs(gap[2]), np.arccos(min(turn, 1.0))])
        references.append([*targets.q_ref, *targets.com[:2]])
    return np.array(errors), np.ptp(references, axis=0), env


@pytest.mark.parametrize("motion", MOTIONS)
def test_motions_are_followed(motion):
    """Joints to 3°, CoM to 2 cm (the start) and 5 mm (later), its height to 5 mm, root to 3°."""
    errors, moved, env = follow(motion)
    assert np.degrees(moved[:-2].max()) > 4.0 or moved[-2:].max() > 0.02  # it is a motion
    assert np.degrees(errors[:, 0].max()) < 3.0
    assert errors[:, 1].max() < 0.02 and errors[50:, 1].max() < 5e-3
    assert errors[:, 2].max() < 5e-3
    assert np.degrees(errors[:, 3].max()) < 3.0
    assert env.controller.failures == 0


@pytest.mark.parametrize("direction", [0.0, 90.0, 180.0, 225.0])
@pytest.mark.parametrize("motion", MOTIONS)
def test_motions_are_followed_through_a_push(motion, direction):
    """A push of 4 N·s is no reason to fall: CoM to 3 cm, root to 15°; and it goes on as before.

    Joints stay within 30°: feet that have turned a little hold the legs in another posture.
    """
    errors, _, env = follow(motion, direction)
    assert np.degrees(errors[:, 0].max()) < 30.0
    assert errors[:, 1].max() < 0.03 and errors[-25:, 1].max() < 0.01
    assert errors[:, 2].max() < 0.02
    assert np.degrees(errors[:, 3].max()) < 15.0
    assert env.controller.failures <= 5
