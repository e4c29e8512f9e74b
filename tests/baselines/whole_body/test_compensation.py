"""baselines/whole_body/compensation.py: targets that lean against what pushes."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.registry import controller_config
from poise.baselines.whole_body.compensation import (
    ForceCompensation,
    compensate,
    keep_supported,
    set_shift,
)
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from tests.support.physics import robot_named

ROBOT = robot_named("humanoid")
PLAIN = controller_config("momentum-qp")
LEANING = replace(PLAIN, compensation=ForceCompensation())


def played(config, pushes, seconds, env_class=ResidualBalanceEnv):
    """The environment after `seconds` of these pushes, or where the robot fell."""
    env = env_class(ROBOT, controller=config, pushes=None, duration=seconds)
    env.reset(seed=0, options={"push": pushes})
    action = np.zeros(len(env.action_names))
    for _ in range(env.max_steps):
        if env.step(action)[2]:
            break
    return env


def block(config=LEANING):
    """The block of a controller in its standing state."""
    qp, simulation = MomentumQP(ROBOT, config), Simulation(ROBOT)
    targets = Targets.standing(ROBOT, simulation.state)
    return qp, qp.compensation(simulation.state, targets), targets


def test_a_push_that_lasts_is_held_which_the_controller_alone_does_not_hold():
    """38 N on the torso for 3 s, forward."""
    push = {"body": "torso", "force": 38.0, "duration": 3.0, "direction": 0.0, "start": 0.5}
    assert played(PLAIN, push, 6.0).fallen
    env = played(LEANING, push, 6.0)
    assert not env.fallen and env.recovered


def test_at_rest_the_cop_is_in_the_middle_with_a_gain_of_one():
    """p = c_ref under a force that lasts: what static balance, Δ = −F z/W, says."""
    config = replace(PLAIN, compensation=ForceCompensation(gain=1.0, reach=0.0))
    push = {"body": "torso", "force": 15.0, "duration": 20.0, "direction": 90.0, "start": 0.2}
    errors = []
    for each in (PLAIN, config):
        env = played(each, push, 8.0)
        errors.append(env.simulation.state.cop[1] - env.targets.com[1])
    assert abs(errors[0]) > 0.03  # the whole moment is borne by the soles
    assert abs(errors[1]) < 0.2 * abs(errors[0])


def test_pushes_from_one_side_leave_a_lean_against_them_and_pushes_from_all_sides_none():
    """Δ after five pushes from the left, and after five around the circle."""
    shifts = []
    for turn in (0.0, 72.0):
        pushes = [
            {"body": "torso", "impulse": 7.0, "direction": (90.0 + k * turn) % 360.0,
             "start": 0.5 + 2.0 * k}
            for k in range(5)
        ]  # fmt: skip
        env = played(LEANING, pushes, 11.5)
        assert not env.fallen
        qp = env.controller
        shifts.append(qp.compensation(env.state_source.state, env.targets).shift.copy())
    assert shifts[0][1] < -0.02 and abs(shifts[0][0]) < 0.01
    assert np.linalg.norm(shifts[1]) < 0.3 * np.linalg.norm(shifts[0])


@pytest.mark.parametrize("angle", np.linspace(0.0, 330.0, 12))
def test_the_target_stays_within_the_support(angle):
    """However large F̂ is, c_ref + Δ is the margin away from the edge, and on the line to Δ."""
    _, c, targets = block()
    way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    c.shift[:] = 0.5 * way
    keep_supported(c)
    state = Simulation(ROBOT).state
    distance = state.support_distance(targets.com[:2] + c.shift)
    assert c.margin <= distance < c.margin + 0.02
    assert c.shift @ way == pytest.approx(np.linalg.norm(c.shift))


def test_the_lean_is_released_while_the_capture_point_is_away():
    """λ is 0 where ξ is not where it is to be, and comes back with its time constant."""
    _, c, targets = block()
    c.push.mean[1], c.push.size = 10.0, 10.0
    compensate(c)
    leaning = c.shift[1]
    assert leaning < -0.03
    c.state.capture_point[0] += 2.0 * c.release
    compensate(c)
    assert c.share == 0.0 and abs(c.shift[1]) < 0.1 * abs(leaning)
    c.state.capture_point[:] = targets.com[:2]
    ticks = round(c.return_time / c.period)
    for _ in range(ticks):
        c.push.mean[1], c.push.size = 10.0, 10.0
        c.state.capture_point[:] = targets.com[:2] + c.shift
        compensate(c)
    assert 0.55 < c.share < 0.7  # 1 − 1/e


def test_targets_that_are_given_stay_as_they_are():
    """A caller may hand over the same targets every tick: they are not moved twice."""
    qp, c, targets = block()
    before = targets.com.copy(), targets.cop.copy()
    c.push.force[0] = 20.0
    simulation = Simulation(ROBOT)
    for _ in range(3):
        qp.torques(simulation.state, targets)
    np.testing.assert_array_equal(targets.com, before[0])
    np.testing.assert_array_equal(targets.cop, before[1])


def test_python_and_compiled_ticks_agree_and_a_reset_forgets():
    """A run of `torques` from Python has the bits of the compiled policy step, twice."""
    push = {"body": "torso", "force": 20.0, "duration": 0.6, "direction": 30.0, "start": 0.1}
    ends = []
    env = ResidualBalanceEnv(ROBOT, controller=LEANING, pushes=None, duration=1.2)
    for compiled in (True, True, False):
        env.reset(seed=3, options={"push": push})
        for _ in range(env.max_steps):
            if compiled:
                env.step(np.zeros(4))
            else:
                for _ in range(env.ticks):
                    env._tick_in_python()
        ends.append(env.simulation.state.qpos.copy())
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


def test_other_solvers_lean_too():
    """DAQP, called from Python, is handed the same targets."""
    config = replace(LEANING, solver="daqp")
    simulation = Simulation(ROBOT)
    targets = Targets.standing(ROBOT, simulation.state)
    qp = MomentumQP(ROBOT, config)
    c = qp.compensation(simulation.state, targets)
    qp.torques(simulation.state, targets)
    c.push.force[1] = c.force[1] = 20.0
    qp.torques(simulation.state, targets)
    assert c.moved.com[1] < targets.com[1] - 0.01


@pytest.mark.parametrize("name", ["capture-step", "feedback-step", "walk"])
def test_controllers_that_step_lean_while_they_stand_and_watch_while_they_step(name):
    """With `qp.compensation` c_ref is moved before the first step; after it, F̂ is still known."""
    config = controller_config({"base": name, "uncertain": None, "qp": {"compensation": {}}})
    push = {"body": "torso", "force": 25.0, "duration": 4.0, "direction": 90.0, "start": 0.2}
    env = played(config, push, 2.5, ResidualStepEnv)
    assert env.stepper.steps == 0
    standing = env.stepper.qp.compensation(env.state_source.state, env.targets)
    assert standing.shift[1] < -0.03 and abs(standing.shift[0]) < 0.02
    env = played(config, {**push, "force": 120.0}, 0.7, ResidualStepEnv)
    assert env.stepper.steps > 0
    seen = env.stepper.qp.compensation(env.state_source.state, env.targets).push.force
    before = seen.copy()
    for _ in range(env.ticks):
        env._tick_in_python()
    assert np.abs(seen - before).max() > 0.01  # [N]: it is not frozen where the first step began


def test_it_belongs_to_the_standing_qp():
    """In the QP of steps it would be without effect, and is refused."""
    data = {"base": "capture-step", "step_qp": {"compensation": {}}}
    with pytest.raises(ConfigError, match=r"step_qp\.compensation"):
        ResidualStepEnv(ROBOT, controller=controller_config(data))


def impulse_of_the_root(config, direction):
    """|∫F dt| [N·s] of the force that a soft root takes, under 70 N on the torso for 3 s."""
    env = ResidualBalanceEnv(ROBOT, controller=config, pushes=None, duration=6.0)
    push = {"body": "torso", "force": 70.0, "duration": 3.0, "direction": direction, "start": 0.5}
    env.reset(seed=0, options={"push": push})
    total = np.zeros(3)
    for _ in range(env.max_steps):
        env.step(np.zeros(4))
        total += env.config.policy_period * env.episode.root_wrench[:3]
    assert not env.fallen
    return np.linalg.norm(total)


@pytest.mark.parametrize("direction", [0.0, 90.0, 180.0])
def test_a_soft_root_takes_less_from_nowhere(direction):
    """moskalev24 takes 70 to 85 N·s of the 210 of this push, and at most 30 if it leans."""
    soft = controller_config("moskalev24")
    leaning = controller_config("moskalev24-compensated")
    assert impulse_of_the_root(soft, direction) > 60.0
    assert impulse_of_the_root(leaning, direction) < 30.0


def test_the_lean_follows_a_jump_of_the_force_through_two_low_passes():
    """Of a step of the first one's output the first tick has the part dt/(τ + dt), the last all."""
    _, c, _ = block()
    c.push.force[0] = 20.0
    set_shift(c)
    first = c.shift[0]
    for _ in range(400):
        set_shift(c)
    settled = c.shift[0]
    assert settled < -0.02
    assert first == pytest.approx(settled * c.part, rel=1e-3)
    omega = Simulation(ROBOT).state.omega
    assert c.part == pytest.approx(c.period / (0.35 / omega + c.period), rel=0.05)
