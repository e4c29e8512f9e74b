"""Servos that take over from a controller: when, with which torques, and how it takes back."""

import copy
import inspect
import re

import numpy as np
import pytest

from poise.baselines.environments.hand_over import HandOverConfig
from poise.baselines.environments.policy_step import set_targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.configs.errors import ConfigError
from poise.envs.balance.vector.batch import EnvBatch, replicate
from poise.envs.sensing.realism import load_realism
from tests.support.refused import invalid
from tests.support.shared import robot
from tests.support.weekly import daily

PUSH = {"impulse": 25.0, "direction": 30.0, "duration": 0.1, "start": 0.1, "body": "torso"}
SHORT = {"duration": 1.0, "pushes": None}
TICK = {"policy_period": 0.002, **SHORT}  # one physics step each
FAST = MomentumQPConfig(period=0.002)


@pytest.fixture(scope="module")
def env():
    return ResidualWholeEnv(robot(), **SHORT)


def with_authority(env, share, joints=0.0):
    """An action of which the servos get the share `share` of the torques."""
    action = np.full(env.action_space.shape, joints)
    action[-1] = 0.5 * share
    return action


def track(env, action, steps=50, push=PUSH):
    """(steps, ...) positions, velocities and motor torques after each step."""
    env.reset(seed=3, options={"push": push})
    rows = []
    for _ in range(steps):
        env.step_without_info(action)
        rows.append(np.concatenate([env.data.qpos, env.data.qvel, env.data.ctrl]))
        if not env.episode.running:
            break
    return np.array(rows)


@pytest.mark.parametrize("controller", ["momentum-qp", "capture-step"])
def test_action_zero_is_the_controller_bit_for_bit(controller):
    """Pushed until it falls or steps; whatever the joints' entries are, without authority."""
    env = ResidualWholeEnv(robot(), controller=controller, **SHORT)
    plain = ResidualBalanceEnv(robot(), controller=controller, **SHORT)
    alone = track(plain, np.zeros(plain.action_space.shape))
    for joints, share in ((0.0, 0.0), (0.7, 0.0), (-0.4, -1.0)):
        np.testing.assert_array_equal(track(env, with_authority(env, share, joints)), alone)
        assert env.authority == 0.0


def test_near_rest_the_controller_is_alone(env):
    """Unpushed, no action moves anything; with the push it does."""
    quiet = track(env, with_authority(env, 0.0), push=[])
    np.testing.assert_array_equal(track(env, with_authority(env, 1.0, 0.3), push=[]), quiet)
    pushed = track(env, with_authority(env, 0.0))
    assert abs(track(env, with_authority(env, 1.0, 0.3))[:20] - pushed[:20]).max() > 0.1


def test_servos_take_over_sooner_where_the_robot_is_uncertain():
    """A push too weak for `opens`: at levels of small errors the controller stays, from episode to
    episode; where joints and tilt may be far off, or arms are moved, servos take over at 1 mm."""
    env = ResidualWholeEnv(robot(), hand_over={"opens": 0.3, "closes": 0.3, "uncertain": 0.001},
                           **SHORT)  # fmt: skip
    weak = {**PUSH, "impulse": 4.0}
    for level, sooner in (("ideal", False), ("field", True), ("lab", False), ("arms", True),
                          ("late", False), ("field+arms", True)):  # fmt: skip
        env.realism = load_realism(level)
        track(env, with_authority(env, 1.0), steps=20, push=weak)
        assert (env.authority > 0.0) == sooner, level
    never = ResidualWholeEnv(robot(), hand_over={"opens": 0.3, "closes": 0.3}, **SHORT)
    never.realism = load_realism("field")
    track(never, with_authority(never, 1.0), steps=20, push=weak)
    assert never.authority == 0.0
    with invalid("uncertain", "0", source="hand_over"):
        ResidualWholeEnv(robot(), hand_over={"uncertain": 0.0}, **SHORT)


@pytest.mark.parametrize("share", daily([0.3, 1.0]))
def test_torques_are_shared(share):
    """τ = (1 − w) τ_c + w clip(K (q* − q) − D q̇, ± τ_max), in every physics step."""
    env = ResidualWholeEnv(robot(), controller=FAST, hand_over={"opens": 0.02, "closes": 0.01},
                           **TICK)  # fmt: skip
    action = with_authority(env, share, 0.2)
    env.reset(seed=3, options={"push": PUSH})
    dofs, servos, limit = robot().motor_dofs, env.servos, robot().torque_limit
    shared = clipped = 0
    for _ in range(150):
        q, v, other = env.data.qpos[dofs + 1].copy(), env.data.qvel[dofs].copy(), copy.copy(env)
        env.step_without_info(action)
        if env.authority == 0.0:
            continue
        set_targets(other._target_inputs())
        alone = other.controller.torques(other.state_source.state, other.targets)
        servo = servos.stiffness * (servos.hold + servos.reach * 0.2 - q) - servos.damping * v
        clipped += np.any(abs(servo) > limit)
        expected = share * np.clip(servo, -limit, limit) + (1.0 - share) * alone
        np.testing.assert_allclose(env.data.ctrl, expected, atol=1e-9 * limit.max())
        assert env.authority == pytest.approx(share)
        shared += 1
    assert shared > 50 and clipped > 5


def test_the_controller_takes_back_once_calm():
    """After the servos it begins anew, once, and its failures stay counted."""
    soon = {"opens": 0.02, "closes": 0.0195, "tilt": 0.5, "speed": 0.5, "joint_speed": 5.0}
    env = ResidualWholeEnv(robot(), duration=4.0, pushes=None, hand_over=soon)
    begun, controller = [], env.controller
    reset = controller.reset

    def counted(state):
        begun.append(env.steps)
        reset(state)

    controller.reset = counted
    env.reset(seed=3, options={"noise": 0.0, "push": {**PUSH, "impulse": 8.0, "direction": 90.0}})
    controller.outputs().failures = 5
    shares = []
    while env.episode.running:
        env.step_without_info(with_authority(env, 1.0))
        shares.append(env.authority)
    changes = np.flatnonzero(np.diff(shares))
    assert env.recovered and len(changes) == 2 and shares[-1] == 0.0
    assert begun == [0, changes[1] + 1]
    calm = env.hand_over.calm_time / env.config.policy_period
    assert changes[1] - changes[0] >= calm
    assert env.episode.metrics.failures == 5


def test_an_error_in_beginning_anew_is_raised(env):
    """Compiled code cannot raise it: the step that follows does."""
    other = ResidualWholeEnv(robot(), **SHORT)
    other.reset(seed=3, options={"push": PUSH})
    for _ in range(12):
        other.step_without_info(with_authority(other, 1.0))
    assert other.authority == 1.0

    def broken(state):
        raise ValueError("no new beginning")

    other.controller.reset = broken
    with pytest.raises(ValueError, match="no new beginning"):
        other.step_without_info(with_authority(other, 0.0))


def test_threads_do_not_share_anything():
    """Many environments, also with controllers that begin anew, give the bits of one thread."""
    env = ResidualWholeEnv(robot(), duration=1.0, pushes={"magnitude": [0.3, 0.6],
                           "unit": "specific_impulse", "start": [0.0, 0.1]})  # fmt: skip
    records = []
    for threads in (1, 3):
        batch = EnvBatch(replicate(env, 9), threads)
        batch.reset(list(range(9)))
        rng, record = np.random.default_rng(0), []
        for _ in range(40):
            actions = rng.uniform(-0.2, 0.2, (9, *env.action_space.shape))
            batch.step(actions)
            record.append([batch.observations.copy(), batch.rewards.copy()])
        records.append(record)
        batch.close()
    for one, other in zip(*records, strict=True):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_targets_may_be_moved_too():
    """Scales put entries before those of the motors, which move what they move elsewhere."""
    env = ResidualWholeEnv(robot(), residual={"com": 0.1}, **SHORT)
    plain = ResidualBalanceEnv(robot(), residual={"com": 0.1, "cop": 0.0}, **SHORT)
    motors = robot().motor_names
    assert env.action_names == ("com_x", "com_y", *motors, "authority")
    action = np.zeros(env.action_space.shape)
    action[:2] = 0.3, -0.2
    np.testing.assert_array_equal(track(env, action), track(plain, action[:2]))


def test_a_replica_acts_alike():
    """Copies have the servos and the limits of the hand-over; the same bits."""
    env = ResidualWholeEnv(robot(), servos={"reach": {"*": 0.7}}, hand_over={"opens": 0.05},
                           **SHORT)  # fmt: skip
    one, other = replicate(env, 2)
    assert other.hand_over == HandOverConfig(opens=0.05) and (other.servos.reach == 0.7).all()
    action = with_authority(env, 1.0, 0.1)
    np.testing.assert_array_equal(track(one, action), track(other, action))


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"hand_over": {"opens": 0.02, "closes": 0.03}}, "hand_over.*closes: 0.03 m is above"),
        ({"hand_over": {"open": 0.02}}, "hand_over: open: unknown.*choices: opens"),
        ({"hand_over": {"speed": 0.0}}, "hand_over: speed: must be above 0"),
        ({"servos": {"reach": {"nose": 1.0}}}, "servos.reach"),
        ({"controller": "root-assist"}, "controller.*soft root"),
        ({"controller": "momentum-qp-osqp"}, "controller.*no compiled tick"),
    ],
)
def test_bad_arguments_are_refused(arguments, named):
    """One line names the argument and why."""
    with pytest.raises(ConfigError, match=named):
        ResidualWholeEnv(robot(), **arguments)


def test_the_class_docstring_is_the_specification():
    """Its tables tell of every term, and nothing is left to be filled in."""
    text, env = inspect.getdoc(ResidualWholeEnv), ResidualWholeEnv(robot())
    for term in env.terms:
        assert f"| {term.name} |" in text and f"| {term.unit} | {term.meaning} |" in text
    assert not re.search(r"<\w+>", text)
    for argument in ("servos", "hand_over", "residual"):
        assert f"`{argument}`" in text
