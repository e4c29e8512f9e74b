"""The residual environment: what the action moves, and what it leaves alone."""

import inspect
import re
from dataclasses import fields, replace

import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.targets import motion_arrays, no_offsets, update_targets
from poise.baselines.controller import Targets
from poise.baselines.environments.policy_step import gate_opening
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.scales import ResidualScales
from poise.baselines.registry import controller_config, load_controller
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.baselines.whole_body.tasks.com import CoM
from poise.configs.errors import ConfigError
from poise.envs.balance.base import EnvConfig
from poise.envs.balance.mdp.reward import RewardWeights
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.balance.vector.batch import replicate
from poise.envs.physics.simulation import Simulation
from poise.envs.sensing.push_force import SMOOTHING
from tests.support.shared import robot

PUSH = {"impulse": 9.0, "direction": 30.0, "start": 0.1, "body": "torso"}


@pytest.fixture(scope="module")
def env():
    return ResidualBalanceEnv(robot())


def zero(env):
    return np.zeros(env.action_space.shape)


@pytest.mark.parametrize("motion", ["standing", "squat"])
def test_action_zero_is_the_controller_alone(motion):
    """An episode equals a plain Python loop over targets, controller and simulation, bitwise."""
    env = ResidualBalanceEnv(robot(), motion=motion)
    env.reset(seed=3, options={"push": PUSH})
    data = env.simulation.data
    simulation = Simulation(robot())
    state = simulation.reset(data.qpos.copy(), data.qvel.copy(), env.simulation.pushes)
    controller = load_controller("momentum-qp", robot())
    controller.reset(state)
    m = load_motion(motion, robot())
    reference = motion_arrays(m)
    targets, none = Targets.standing(robot(), state), no_offsets()
    count = round(controller.period / robot().model.opt.timestep)
    for _ in range(40):
        env.step(zero(env))
        while simulation.time < env.simulation.time - 1e-9:
            update_targets(
                simulation.arrays, state.arrays, reference, simulation.time,
                controller.com_offset, none, targets.arrays(),
            )  # fmt: skip
            state = simulation.step(controller.torques(state, targets), count)
        assert np.array_equal(simulation.data.qpos, data.qpos)
        assert np.array_equal(simulation.data.qvel, data.qvel)
        assert np.array_equal(simulation.data.ctrl, data.ctrl)


@pytest.mark.parametrize("entry", range(4))
def test_the_action_moves_its_target(env, entry):
    """Each entry of ±1 moves CoM or CoP target by its scale, in the heading frame."""
    qpos = robot().standing_qpos.copy()
    q = qpos[3:7].copy()
    qpos[3:7] = np.cos(0.5) * q + np.sin(0.5) * np.array([-q[3], -q[2], q[1], q[0]])  # yaw 1 rad
    start = {"push": [], "qpos": qpos, "qvel": np.zeros(robot().model.nv)}
    targets = []
    for value in (0.0, -1.0):
        env.reset(seed=0, options=start)
        assert env.simulation.state.heading_yaw == pytest.approx(1.0, abs=1e-6)
        env.ticks = 1  # the targets of the first tick, before the robot moves
        try:
            action = zero(env)
            action[entry] = value
            env.step(action)
        finally:
            env.ticks = 5
        targets.append((env.targets.com.copy(), env.targets.cop.copy()))
    moved = [b - a for a, b in zip(*targets, strict=True)]
    axis = [np.array([np.cos(1.0), np.sin(1.0)]), np.array([-np.sin(1.0), np.cos(1.0)])][entry % 2]
    scale, which = (0.2, 0) if entry < 2 else (0.15, 1)
    np.testing.assert_allclose(moved[which][:2], -scale * axis, atol=1e-6)
    assert np.abs(moved[1 - which]).max() < 1e-12


def test_more_targets_can_be_moved():
    """Scales above 0 append the CoM's height, a lean of the root and carried momentum."""
    scales = {"height": 0.05, "lean": 0.3, "momentum": 0.1}
    env = ResidualBalanceEnv(robot(), residual=scales)
    names = ("com_z", "lean_x", "lean_y", "momentum_x", "momentum_y")
    assert env.action_names[4:] == names
    found = {}
    for entry in (None, *names):
        env.reset(seed=0, options={"push": [], "noise": 0.0})
        env.ticks = 1
        env.step(np.array([float(name == entry) for name in env.action_names]))
        t = env.targets
        found[entry] = (t.com[2], t.root_axes.copy(), t.angular_momentum.copy())
    height, axes, momentum = found[None]
    assert found["com_z"][0] - height == pytest.approx(0.05)
    for k, name in enumerate(("lean_x", "lean_y")):
        turn = found[name][1] @ axes.T
        angle = np.arccos((np.trace(turn) - 1.0) / 2.0)
        assert angle == pytest.approx(0.3) and turn[k, k] == pytest.approx(1.0)
    unit = robot().mass * robot().height_com ** 2 * env.scales.omega
    for k, name in enumerate(("momentum_x", "momentum_y")):
        moved = (found[name][2] - momentum) / unit
        np.testing.assert_allclose(moved, 0.1 * np.eye(3)[k], atol=1e-9)


def test_torques_are_added_within_the_limits_of_the_motors():
    """τ = clip(τ_c + scale · a · τ_max, ± τ_max); entries of zero are the controller's, bitwise."""
    env = ResidualBalanceEnv(robot(), residual={"torque": 0.4})
    assert env.action_names[4:] == robot().motor_names
    limit, found = np.array(robot().torque_limit), {}
    action = np.zeros(len(env.action_names))
    for value in (0.0, 0.5, 1.0):
        env.reset(seed=0, options={"push": [], "noise": 0.0})
        action[6], action[-1] = value, -value
        env.set_action(action)
        env.tick()
        found[value] = env.simulation.data.ctrl.copy()
    for value in (0.5, 1.0):
        asked = found[0.0].copy()
        asked[2] += 0.4 * value * limit[2]
        asked[-1] -= 0.4 * value * limit[-1]
        np.testing.assert_allclose(found[value], np.clip(asked, -limit, limit), atol=1e-12)
    huge = ResidualBalanceEnv(robot(), residual={"torque": 3.0})
    huge.reset(seed=0, options={"push": []})
    huge.set_action(np.r_[np.zeros(4), np.ones(len(limit))])
    huge.tick()
    np.testing.assert_array_equal(huge.simulation.data.ctrl, limit)


def test_added_torques_are_mirrored_and_the_same_from_python():
    """A step mirrored is the mirror image of a step, by compiled ticks and by those of Python."""
    ends, action = [], np.random.default_rng(0).uniform(-1.0, 1.0, 4 + robot().model.nu)
    for compiled in (True, False):
        env = ResidualBalanceEnv(robot(), residual={"torque": 0.4}, gate=0.05, smoothing=0.03)
        env._compiled = compiled
        env.reset(seed=1, options={"push": []})
        for _ in range(5):
            env.step(action)
        ends.append(np.concatenate([env.simulation.data.qpos, env.simulation.data.qvel]))
    np.testing.assert_array_equal(*ends)
    observations, actions = env.mirrors()
    found = []
    for mirrored in (False, True):
        env.reset(seed=0, options={"push": [], "noise": 0.0})
        for _ in range(5):
            env.step(action[actions.order] * actions.sign if mirrored else action)
        found.append(env.episode.observation.copy())
    image = found[0][observations.order] * observations.sign
    np.testing.assert_allclose(found[1], image, atol=1e-4)  # as in test_mirror.py


def test_scales_come_from_the_arguments():
    """A mapping and an object mean the same; wrong ones are refused."""
    for residual in ({"com": 0.1, "cop": 0.3}, ResidualScales(com=0.1, cop=0.3)):
        env = ResidualBalanceEnv(robot(), residual=residual)
        assert env.residual.com == 0.1 and env.residual.cop == 0.3
        assert list(env._residual.scale[:4]) == [0.1, 0.1, 0.3, 0.3]
    for wrong, named in (({"com": -0.1}, "com"), ({"zmp": 0.1}, "zmp"), (0.1, "residual")):
        with pytest.raises(ConfigError, match=named):
            ResidualBalanceEnv(robot(), residual=wrong)


def test_the_observation_is_relative_to_the_motion():
    """Halfway down a squat the joints are observed near the squat, not near standing."""
    env = ResidualBalanceEnv(robot(), motion="squat", noise={"joints": 0.0})
    env.reset(seed=0, options={"push": [], "noise": 0.0})
    for _ in range(30):
        observation = env.step(zero(env))[0]
    sizes = np.cumsum([term.size for term in env.terms])
    names = [term.name for term in env.terms]
    joints = slice(sizes[names.index("joint_pos") - 1], sizes[names.index("joint_pos")])
    bent = np.abs(env.simulation.state.q - robot().standing_qpos[7:]).max()
    assert bent > 0.05 and np.abs(observation[joints]).max() < 0.5 * bent


@pytest.mark.parametrize("solver", ["daqp", "active-set"])
def test_another_solver_is_really_used(solver):
    """A controller that names a solver is solved by it, and agrees with the default."""
    default = ResidualBalanceEnv(robot(), motion="squat")
    config = replace(controller_config("momentum-qp"), solver=solver)
    other = ResidualBalanceEnv(robot(), controller=MomentumQP(robot(), config), motion="squat")
    solved = []
    if other.controller.solver is not None:
        inner = other.controller.solver.solve
        other.controller.solver.solve = lambda qp: solved.append(1) or inner(qp)
    for env in (default, other):
        env.reset(seed=1, options={"push": {**PUSH, "impulse": 4.0}})
        for _ in range(10):
            env.step(np.full(env.action_space.shape, 0.02))
    assert len(solved) == (50 if solver == "daqp" else 0)
    np.testing.assert_allclose(other.simulation.data.qpos, default.simulation.data.qpos, atol=1e-6)


class Crouch:
    """An external controller: joint-space springs, no solver, no record."""

    period = 0.01

    def __init__(self):
        self.resets, self.targets = 0, []

    def reset(self, state):
        self.resets += 1

    def torques(self, state, targets):
        self.targets.append(targets.com.copy())
        q = targets.q_ref - state.q
        return np.clip(100.0 * q - 5.0 * state.qvel[6:], -20.0, 20.0)


def test_a_controller_from_outside():
    """Whatever has period, reset and torques may be the base; it sees the moved targets."""
    controller = Crouch()
    env = ResidualBalanceEnv(robot(), controller=controller)
    env.reset(seed=0, options={"push": [], "noise": 0.0})
    action = zero(env)
    action[0] = 1.0
    *_, info = env.step(action)
    assert controller.resets == 1 and len(controller.targets) == 2
    assert controller.targets[0][0] == pytest.approx(0.2, abs=1e-6)
    assert info["solver_failures"] == 0 and not info["root_wrench"].any()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        ({"controller": "nobody"}, ("nobody", "momentum-qp")),
        ({"controller": 3}, ("controller", "3", "momentum-qp")),
        ({"controller": {"root": "loose"}}, ("root", "loose", "hard")),
        ({"controller": {"solver": "guess"}}, ("solver", "guess", "osqp")),
        ({"motion": "dance"}, ("dance", "squat")),
        ({"policy_period": 0.006}, ("policy_period", "0.004")),
        ({"controller": {"period": 0.003}}, ("period", "0.002")),
    ],
)
def test_bad_arguments_are_refused(arguments, named):
    """One error names the field, the value and the choices."""
    with pytest.raises(ConfigError) as error:
        ResidualBalanceEnv(robot(), **arguments)
    for word in named:
        assert word in str(error.value)


def test_parts_of_another_robot_are_refused():
    """A controller or motion of another robot would read past its arrays."""
    with pytest.raises(ConfigError, match="controller.*tall"):
        ResidualBalanceEnv(robot(), controller=load_controller("momentum-qp", robot("tall")))
    with pytest.raises(ConfigError, match="motion"):
        ResidualBalanceEnv(robot(), motion=load_motion("standing", robot("toddler")))


def test_a_soft_root_is_reported():
    """Its wrench holds a robot that would fall, and is in info and in the record."""
    env = ResidualBalanceEnv(robot(), controller={"root": "soft"})
    env.reset(seed=0, options={"push": {**PUSH, "impulse": 25.0, "start": 0.0}})
    largest = 0.0
    for _ in range(10):
        *_, info = env.step(zero(env))
        largest = max(largest, np.abs(info["root_wrench"]).max())
    assert largest > 1.0
    compiled = env.episode.metrics.mutable_values()
    env._compiled = False  # the same in Python
    env.reset(seed=0, options={"push": {**PUSH, "impulse": 25.0, "start": 0.0}})
    for _ in range(10):
        env.step(zero(env))
    assert env.episode.metrics.mutable_values() == pytest.approx(compiled, rel=1e-9)


def test_failures_of_the_solver_are_counted_per_episode(env):
    """info says how often the QP was not solved since the reset."""
    env.reset(seed=0)
    env.controller.memory.failures = 3
    assert env.step(zero(env))[4]["solver_failures"] >= 3
    assert env.reset(seed=0)[1]["solver_failures"] == 0


def test_the_class_docstring_is_the_specification(env):
    """Its tables tell of every term and, for the default scales, of every entry of an action."""
    text = inspect.getdoc(ResidualBalanceEnv)
    for term in env.terms:
        assert f"| {term.name} |" in text and f"| {term.unit} | {term.meaning} |" in text
    assert not re.search(r"<\w+>", text)
    for i, (name, scale) in enumerate(zip(env.action_names, env._residual.scale, strict=True)):
        field = name.split("_")[0]
        assert f"| {i} | {name} | `residual.{field}`, {scale:g} m |" in text


def test_both_docstrings_tell_the_same_of_rewards_start_end_and_info():
    """The shared part is the same text, and names every weight, field and key."""
    parts = []
    for cls in (ResidualBalanceEnv, TorqueBalanceEnv):
        text = inspect.getdoc(cls)
        parts.append(text[text.index("Rewards:") : text.index("Arguments:")])
        for field in fields(EnvConfig):
            assert field.name in text[text.index("Arguments:") :]
        assert "Version history: v0" in text
    assert parts[0] == parts[1]
    for name, weight in vars(RewardWeights()).items():
        assert f"| {name} | {weight} |" in parts[0]
    env = TorqueBalanceEnv(robot())
    _, info = env.reset(seed=0)
    for key in [*info, *info["push"][0]]:
        assert key.split("_")[0] in parts[0]


def test_smoothing_is_a_first_order_lag():
    """a ← a + (1 − e^(−T/τ)) (action − a): the observed action and the moved target follow it."""
    env = ResidualBalanceEnv(robot(), pushes=None, smoothing=0.05)
    env.reset(seed=0, options={"noise": 0.0})
    action, expected = np.array([0.5, -1.0, 0.0, 0.2]), np.zeros(4)
    for _ in range(3):
        env.step(action)
        expected += (1.0 - np.exp(-0.02 / 0.05)) * (action - expected)
        np.testing.assert_allclose(env.episode.action, expected, rtol=1e-12)
        np.testing.assert_allclose(
            env._offsets.values[:4], expected * [0.2, 0.2, 0.15, 0.15], rtol=1e-12
        )


def test_the_gate_opens_with_the_capture_point():
    """Shut at the reference, 1 − e⁻¹ open at the distance `gate`, open far away."""
    env = ResidualBalanceEnv(robot(), pushes=None, gate=0.04)
    env.reset(seed=0, options={"noise": 0.0})
    s = env.simulation.state_arrays
    reference = s.origin[:2] + env._com_offset * s.heading
    for distance, share in ((0.0, 0.0), (0.04, 1.0 - np.exp(-1.0)), (0.4, 1.0)):
        s.capture_point[:] = reference + distance * np.array([0.6, -0.8])
        opened = gate_opening(env._residual, s, env._motion, env._com_offset)
        assert opened == pytest.approx(share, abs=1e-9)


@pytest.mark.parametrize(
    "changes", [{"smoothing": 0.05}, {"gate": 0.04}, {"controller": "macchietto09"}]
)
def test_a_replica_acts_alike(changes):
    """Whatever an environment was made with, its copies have too: the same bits."""
    first = ResidualBalanceEnv(robot(), pushes=None, **changes)
    seen = []
    for env in replicate(first, 2):
        env.reset(seed=3)
        for _ in range(5):
            observation, *_ = env.step(np.array([1.0, -0.5, 0.3, 0.2]))
        seen.append(observation)
    np.testing.assert_array_equal(seen[0], seen[1])


def test_a_controller_may_be_replaced(env):
    """Its offset, gains and period count from then on, as if the environment were made with it."""
    config = MomentumQPConfig(com=CoM(offset=0.03), period=0.01)
    env.reset(seed=0)
    env.step(zero(env))
    env.controller = MomentumQP(robot(), config)
    made = ResidualBalanceEnv(robot(), controller=config)
    for other in (env, made):
        other.reset(seed=4, options={"push": PUSH})
        for _ in range(10):
            other.step(zero(other))
    assert env.ticks == 2
    assert np.array_equal(env.simulation.data.qpos, made.simulation.data.qpos)
    assert np.array_equal(env.targets.com, made.targets.com)


@pytest.mark.parametrize("solver", ["active-set", "daqp"])
def test_failures_and_the_root_wrench_are_reported(solver):
    """Whether the controller is compiled or called from Python; a reset forgets both."""
    config = replace(controller_config("momentum-qp"), root="soft", solver=solver)
    env = ResidualBalanceEnv(robot(), controller=config, pushes=None)
    env.reset(seed=0)
    env.controller.memory.failures = 3
    info = env.step(zero(env))[-1]
    assert info["solver_failures"] == 3
    assert np.array_equal(info["root_wrench"], env.controller.root_wrench)
    assert info["root_wrench"].any()
    _, info = env.reset(seed=0)
    assert info["solver_failures"] == 0 and not info["root_wrench"].any()


def test_a_motion_that_waits_is_late_and_the_standing_one_is_not_changed() -> None:
    """Pushed hard, the squat waits and catches up; what stands has the same bits either way."""
    push = {"push": {"impulse": 14.0, "direction": 0.0, "start": 0.3, "duration": 0.1}}
    late = []
    for tempo in ({}, {"waits": True}, {"waits": True, "after": "resume"}):
        env = ResidualBalanceEnv(robot(), motion="squat", tempo=tempo, duration=8.0)
        env.reset(seed=3, options=push)
        for _ in range(100):
            env.step(zero(env))
        late.append(env.simulation.time - env.motion_time)
        env.reset(seed=3, options=push)
        assert env.motion_time == 0.0
    assert late[0] == 0.0 and late[2] > 0.1 and 0.0 <= late[1] < late[2]
    ends = []
    for waits in (False, True):
        env = ResidualBalanceEnv(robot(), tempo={"waits": waits})
        env.reset(seed=3, options=push)
        for _ in range(60):
            env.step(zero(env))
        ends.append(env.simulation.data.qpos.copy())
    assert np.array_equal(*ends)


def test_a_policy_sees_the_phase_of_the_motion() -> None:
    """Sine, cosine and what is left, by the motion's own time; held at the end, over in a loop."""
    names = {"observation": {"extra": ["motion_phase"]}}
    env = ResidualBalanceEnv(robot(), names, motion="squat", duration=60.0)
    plain = ResidualBalanceEnv(robot(), motion="squat")
    size = plain.observation_space.shape[0]
    assert env.observation_space.shape == (size + 3,)
    observation, _ = env.reset(seed=3, options={"push": []})
    assert observation[-3:] == pytest.approx([0.0, 1.0, 1.0])
    for _ in range(20):
        observation, *_ = env.step(zero(env))
    over = 2.0 * np.pi * 0.4 / env.motion.duration
    left = 1.0 if env.motion.loop else 1.0 - 0.4 / env.motion.duration
    assert observation[-3:-1] == pytest.approx([np.sin(over), np.cos(over)], abs=1e-5)
    assert observation[-1] == pytest.approx(1.0 - 0.4 / env.motion.duration, abs=1e-5) and left
    slow = ResidualBalanceEnv(robot(), names, motion="squat", tempo={"waits": True}, duration=9.0)
    slow.reset(seed=3, options={"push": {"impulse": 14.0, "start": 0.0, "duration": 0.1}})
    for _ in range(20):
        observation, *_ = slow.step(zero(slow))
    assert observation[-1] == pytest.approx(1.0 - slow.motion_time / slow.motion.duration, abs=1e-5)
    assert slow.motion_time < 0.4


def test_the_estimated_force_is_observed_along_the_heading():
    """`push_force` and `push_mean` are what the controller's own estimate finds, in their units."""
    alike = {"gain": 0.0, "reach": 0.0, "smoothing": SMOOTHING}
    config = {"base": "momentum-qp", "compensation": alike}
    extra = {"observation": {"extra": ["push_force", "push_mean"], "privileged": ["push"]}}
    env = ResidualBalanceEnv(robot(), extra, controller=config, pushes=None, duration=4.0)
    push = {"body": "torso", "force": 12.0, "duration": 4.0, "direction": 90.0, "start": 0.2}
    env.reset(seed=0, options={"push": push})
    sizes = {term.name: term.size for term in env.terms}
    assert (sizes["push_force"], sizes["push_mean"], sizes["true_push"]) == (2, 2, 3)
    ends = dict(zip(sizes, np.cumsum(list(sizes.values())), strict=True))
    for _ in range(120):
        env.step(zero(env))
    seen = env.episode.observation
    own = env.controller.compensation(env.state_source.state, env.targets).push
    cos, sin = env.simulation.state.heading
    weight = env.scales.weight
    for name, value, unit in (("push_force", own.force, 0.1), ("push_mean", own.mean, 0.02)):
        expected = np.array([cos * value[0] + sin * value[1], cos * value[1] - sin * value[0]])
        entries = seen[ends[name] - 2 : ends[name]]
        np.testing.assert_allclose(entries, expected / (unit * weight), rtol=0.02, atol=1e-3)
    assert seen[ends["push_force"] - 1] > 0.2  # to the left
    env.reset(seed=0, options={"push": []})
    assert not env.episode.observation[ends["push_mean"] - 2 : ends["push_mean"]].any()
