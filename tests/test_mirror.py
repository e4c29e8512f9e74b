"""Left and right exchanged: the mirror image of a trial is the trial of the mirror image."""

from functools import partial

import numpy as np
import pytest

from poise.baselines.residual_balance import ResidualBalanceEnv, ResidualScales
from poise.baselines.residual_step_env import ResidualStepEnv, StepScales
from poise.envs.errors import ConfigError
from poise.envs.mirror import mirror_joints
from poise.envs.robot import load_robot
from poise.envs.torque_balance import TorqueBalanceEnv

from .shared import robot

BODY = {"height": 0.05, "lean": 0.2, "momentum": 0.05}


@pytest.fixture(scope="module")
def even():
    """The humanoid without what Gymnasium's file gives one side only."""
    even = load_robot()
    model, joints = even.model, mirror_joints(even)
    for values in (model.jnt_stiffness[1:], model.dof_armature[6:]):
        assert np.sum(values != values[joints.order]) == 2  # left knee's spring, right hip
        values[:] = 0.5 * (values + values[joints.order])
    return even


ENVS = {
    "torque": TorqueBalanceEnv,
    "residual": partial(ResidualBalanceEnv, residual=ResidualScales(**BODY)),
    "step": partial(ResidualStepEnv, residual=StepScales(trigger=0.03, **BODY)),
}


def test_joints_of_the_humanoid():
    """Legs and arms change sides; of the trunk's joints, those about x and z change their sign."""
    names, mirror = robot().joint_names, mirror_joints(robot())
    for name, image, sign in zip(names, mirror.order, mirror.sign, strict=True):
        sides = {"left": "right", "right": "left"}
        side, _, joint = name.partition("_")
        assert names[image] == (f"{sides[side]}_{joint}" if side in sides else name)
        if side == "abdomen":
            assert sign == (1.0 if joint == "y" else -1.0)
    values = np.random.default_rng(0).normal(size=len(names))
    np.testing.assert_array_equal(mirror(mirror(values)), values)


@pytest.mark.parametrize("kind", ENVS)
def test_a_mirrored_trial(kind, even):
    """Pushed from the other side, with the actions mirrored, it observes the mirror image."""
    env = ENVS[kind](even, duration=1.0, pushes=None)
    seen, done = env.mirrors()
    rng = np.random.default_rng(3)
    actions = rng.uniform(-0.3, 0.3, (12, *env.action_space.shape))
    trials = []
    for direction in (50.0, 310.0):
        push = {"impulse": 24.0, "direction": direction, "start": 0.0, "body": "torso"}
        env.reset(options={"push": push, "qpos": even.standing_qpos, "qvel": np.zeros(27)})
        rows = []
        for action in actions:
            env.step_in_place(action if direction < 180.0 else done(action))
            rows.append(env.episode.observation.copy())
        trials.append(np.array(rows))
    one, other = trials
    np.testing.assert_allclose(seen(one), other, atol=1e-4)
    assert np.mean(abs(one - other).max(axis=0) > 0.02) > 0.6  # not the same trial again
    assert env.info().get("steps", 1) == 1


def test_a_robot_that_limps():
    """One heavier foot has no mirror image: an error names it."""
    one = robot()
    before = one.model.body_mass.copy()
    try:
        one.model.body_mass[one.soles[0].body_id] *= 1.1
        with pytest.raises(ConfigError, match="foot.*no mirror image"):
            mirror_joints(one)
    finally:
        one.model.body_mass[:] = before
