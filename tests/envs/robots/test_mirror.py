"""Left and right exchanged: the mirror image of a trial is the trial of the mirror image."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.scales import ResidualScales, StepScales, WholeScales
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.environments.walking import ResidualWalkEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.configs.errors import ConfigError
from poise.envs.balance.mdp.terms import TERMS
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.robots.mirror import SIDES, mirror_robot
from poise.envs.robots.robot import load_robot
from tests.support.shared import robot

BODY = {"height": 0.05, "lean": 0.2, "momentum": 0.05}


@pytest.fixture(scope="module")
def even():
    """The humanoid without what Gymnasium's file gives one side only."""
    even = load_robot()
    model, joints = even.model, mirror_robot(even)["joints"]
    for values in (model.jnt_stiffness[1:], model.dof_armature[6:]):
        assert np.sum(values != values[joints.order]) == 2  # the left knee's spring, the left hip
        values[:] = 0.5 * (values + values[joints.order])
    return even


ENVS = {
    "torque": TorqueBalanceEnv,
    "position": PositionBalanceEnv,
    "velocity": VelocityEnv,
    "residual": partial(ResidualBalanceEnv, residual=ResidualScales(**BODY)),
    "step": partial(ResidualStepEnv, residual=StepScales(trigger=0.03, **BODY)),
    "whole": partial(ResidualWholeEnv, residual=WholeScales(com=0.1, cop=0.05, **BODY)),
}


def test_joints_of_the_humanoid():
    """Legs and arms change sides; of the trunk's joints, those about x and z change their sign."""
    names, mirror = robot().joint_names, mirror_robot(robot())["joints"]
    for name, image, sign in zip(names, mirror.order, mirror.sign, strict=True):
        sides = {"left": "right", "right": "left"}
        side, _, joint = name.partition("_")
        assert names[image] == (f"{sides[side]}_{joint}" if side in sides else name)
        if side == "abdomen":
            assert sign == (1.0 if joint == "y" else -1.0)
    values = np.random.default_rng(0).normal(size=len(names))
    np.testing.assert_array_equal(mirror(mirror(values)), values)


def observed(env, actions, **options):
    """(n, no) observations of an episode with these actions."""
    env.reset(options=options)
    rows = []
    for action in actions:
        env.step_without_info(action)
        rows.append(env.episode.observation.copy())
    return np.array(rows)


@pytest.mark.parametrize("kind", ENVS)
def test_a_mirrored_trial(kind, even):
    """Pushed from the other side, with the actions mirrored, it observes the mirror image."""
    env = ENVS[kind](even, duration=1.0, pushes=None)
    seen, done = env.mirrors()
    rng = np.random.default_rng(3)
    actions = rng.uniform(-0.3, 0.3, (12, *env.action_space.shape))
    push = {"impulse": 24.0, "direction": 50.0, "start": 0.0, "body": "torso"}
    start = {"qpos": even.standing_qpos, "qvel": np.zeros(27)}
    one = observed(env, actions, push=push, **start)
    other = observed(env, done(actions), push={**push, "direction": 310.0}, **start)
    np.testing.assert_allclose(seen(one), other, atol=1e-4)
    assert np.mean(abs(one - other).max(axis=0) > 0.02) > 0.6  # not the same trial again
    assert env.info().get("steps", 1) == 1


def test_a_mirrored_walk(even):
    """Told to go to the other side, with the actions mirrored, it starts with the other foot."""
    env = ResidualWalkEnv(
        even, duration=3.0, pushes=None, residual=StepScales(trigger=0.03, **BODY)
    )
    seen, done = env.mirrors()
    rng = np.random.default_rng(3)
    actions = np.repeat(rng.uniform(-0.1, 0.1, (10, *env.action_space.shape)), 10, axis=0)
    start = {"qpos": even.standing_qpos, "qvel": np.zeros(27)}
    one = observed(env, actions, command={"ahead": 0.2, "left": 0.1, "turn": 0.1}, **start)
    assert env.info()["steps"] >= 2
    mirrored = {"ahead": 0.2, "left": -0.1, "turn": -0.1}
    other = observed(env, done(actions), command=mirrored, **start)
    np.testing.assert_allclose(seen(one), other, atol=1e-3)
    assert np.mean(abs(one - other).max(axis=0) > 0.02) > 0.6


def test_a_mirrored_command(even):
    """Commanded to the other side, servos with mirrored targets observe the mirror image."""
    errors = {"terms": ["com_vel", "command_velocity", "command_turn", "velocity_error",
                        "turn_error"]}  # fmt: skip
    env = VelocityEnv(even, duration=1.0, pushes=None, observation=errors)
    seen, done = env.mirrors()
    actions = np.random.default_rng(3).uniform(-0.3, 0.3, (12, *env.action_space.shape))
    start = {"qpos": even.standing_qpos, "qvel": np.zeros(27)}
    one = observed(env, actions, command={"ahead": 0.2, "left": 0.1, "turn": 0.1}, **start)
    mirrored = {"ahead": 0.2, "left": -0.1, "turn": -0.1}
    other = observed(env, done(actions), command=mirrored, **start)
    np.testing.assert_allclose(seen(one), other, atol=1e-4)
    assert np.sum(abs(one - other).max(axis=0) > 0.02) >= 5


def test_every_term_has_its_image(even):
    """Those that are off by default, too."""
    env = TorqueBalanceEnv(even, pushes=None, observation={"terms": list(TERMS)})
    push = {"force": 30.0, "direction": 50.0, "duration": 1.0, "profile": "half-sine"}
    actions = np.random.default_rng(3).uniform(-0.3, 0.3, (5, *env.action_space.shape))
    seen, done = env.mirrors()
    start = {"qpos": even.standing_qpos, "qvel": np.zeros(27)}
    one = observed(env, actions, push=push, **start)
    other = observed(env, done(actions), push={**push, "direction": 310.0}, **start)
    np.testing.assert_allclose(seen(one), other, atol=1e-4)


@pytest.mark.parametrize("name", ["compact", "tall", "toddler"])
def test_other_robots_in_the_air(name):
    """Falling with a twist under random torques: mirror images of each other to rounding.

    `tall` has a root whose axes do not point to the front.
    """
    env = TorqueBalanceEnv(robot(name), duration=1.0, pushes=None)
    seen, done = env.mirrors()
    actions = np.random.default_rng(1).uniform(-0.3, 0.3, (5, *env.action_space.shape))
    qpos, qvel = robot(name).standing_qpos.copy(), np.zeros(robot(name).model.nv)
    qpos[2] += 0.3
    qvel[:6] = 0.3, 0.4, 0.1, 0.5, 0.4, 0.6
    image = qvel.copy()
    image[:3], image[3:6] = SIDES * qvel[:3], mirror_robot(robot(name))["root turn"](qvel[3:6])
    one = observed(env, actions, qpos=qpos, qvel=qvel)
    other = observed(env, done(actions), qpos=qpos, qvel=image)
    np.testing.assert_allclose(seen(one), other, atol=1e-9)
    assert abs(one - other).max() > 0.1


def test_a_robot_that_limps():
    """One heavier foot has no mirror image, nor has one weaker motor: errors name them."""
    one = load_robot()
    limit = one.torque_limit.copy()
    limit[list(one.motor_dofs - 6).index(one.joint_names.index("left_knee"))] *= 0.5
    with pytest.raises(ConfigError, match="the motor of '.*knee' has no mirror image"):
        mirror_robot(replace(one, torque_limit=limit))
    one.model.body_mass[one.soles[0].body_id] *= 1.1
    with pytest.raises(ConfigError, match="the body '.*foot' has no mirror image"):
        mirror_robot(one)
