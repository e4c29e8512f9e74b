"""Walking at a commanded velocity, from standing and back."""

import copy

import numpy as np
import pytest

from poise.baselines.balance.stepping.planning.swing_speed import possible_limits
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.registry import controller_config, load_controller
from poise.baselines.walking.planner.command import GaitCommand
from poise.configs.errors import ConfigError
from poise.configs.schema import to_dict
from poise.envs.robots.robot import Robot
from tests.support.shared import robot

PERIOD = 0.02
STILL = GaitCommand()


def walk(*commands, push=(), seed=0, noise=1.0, controller="walk"):
    """Play (seconds, command) after each other; heading (n, 2), CoM (n, 3), and the environment."""
    env = ResidualStepEnv(controller=controller, duration=60.0)
    env.reset(seed=seed, options={"push": list(push), "noise": noise})
    action, heading, com = np.zeros(len(env.action_names)), [], []
    for seconds, command in commands:
        if controller == "walk":
            env.controller.command = command
        for _ in range(round(seconds / PERIOD)):
            _, _, fallen, _, _ = env.step(action)
            heading.append(env.simulation.state.heading.copy())
            com.append(env.simulation.state.com.copy())
            if fallen:
                return np.array(heading), np.array(com), env
    return np.array(heading), np.array(com), env


def speed(com, seconds):
    """Mean velocity (2,) [m/s] of the last seconds."""
    n = round(seconds / PERIOD)
    return (com[-1, :2] - com[-1 - n, :2]) / seconds


@pytest.mark.parametrize("impulse", [0.0, 26.0])
def test_without_a_command_it_is_feedback_step_bit_for_bit(impulse):
    push = {"impulse": impulse, "direction": 30.0, "start": 0.3, "duration": 0.1}
    ends = [
        walk((2.5, STILL), push=[push], controller=name)[1] for name in ("walk", "feedback-step")
    ]
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize("ahead, left", [(0.3, 0.0), (0.8, 0.0), (-0.4, 0.0), (0.0, 0.25)])
def test_it_walks_at_the_velocity_that_is_asked_for(ahead, left):
    _, com, env = walk((8.0, GaitCommand(ahead, left)), seed=3)
    assert not env.fallen and env.controller.walking
    period = env.controller.gait.step_time + env.controller.gait.transfer_time
    error = speed(com, round(4.0 / period / 2) * 2 * period) - [ahead, left]
    assert np.linalg.norm(error) < 0.05


def test_it_turns():
    heading, _, env = walk((6.0, GaitCommand(0.3, 0.0, 0.4)), seed=1)
    yaw = np.unwrap(np.arctan2(heading[:, 1], heading[:, 0]))
    assert not env.fallen
    assert (yaw[-1] - yaw[-101]) / (100 * PERIOD) == pytest.approx(0.4, abs=0.1)


def test_it_stops_and_stands():
    _, com, env = walk((4.0, GaitCommand(0.5)), (4.0, STILL), seed=2)
    steps = env.controller.steps
    assert not env.controller.walking and not env.fallen
    assert np.linalg.norm(speed(com, 0.5)) < 0.1
    assert steps > 8


def test_a_command_that_is_taken_back_before_the_first_step_is_no_step():
    _, _, env = walk((PERIOD, GaitCommand(0.5)), (1.0, STILL), noise=0.0)
    assert env.controller.steps == 0 and not env.controller.walking


def test_it_walks_on_after_a_push():
    push = {"impulse": 12.0, "direction": 180.0, "start": 3.1, "duration": 0.1}
    _, com, env = walk((8.0, GaitCommand(0.5)), push=[push], seed=4)
    assert not env.fallen
    assert speed(com, 2.0)[0] == pytest.approx(0.5, abs=0.06)


def test_a_reset_forgets_the_command():
    _, _, env = walk((2.0, GaitCommand(0.5)))
    assert env.controller.command == GaitCommand(0.5)
    env.reset(seed=0)
    assert env.controller.command == STILL and not env.controller.walking


def test_compiled_and_python_ticks_are_the_same_bits():
    ends = []
    for compiled in (True, False):
        env = ResidualStepEnv(controller="walk", duration=3.0)
        env.reset(seed=5, options={"push": []})
        env.controller.command = GaitCommand(0.4, 0.1, 0.2)
        env._compiled = env._compiled and compiled
        for _ in range(100):
            env.step(np.zeros(len(env.action_names)))
        ends.append(np.concatenate([env.simulation.data.qpos, env.simulation.data.qvel]))
    np.testing.assert_array_equal(*ends)


def test_a_command_is_of_finite_numbers():
    with pytest.raises(ConfigError, match=r"command\.left.*finite"):
        GaitCommand(0.1, np.nan)


def test_the_gait_has_the_units_of_the_robot():
    """Lengths in h, times in 1/ω: a controller of another robot has the same gait, scaled."""
    gaits = [load_controller("walk", robot(name)).gait for name in ("humanoid", "tall")]
    units = [robot(name).units for name in ("humanoid", "tall")]
    for name, power in (("width", 1.0), ("step_time", 0.5), ("time_price", 0.5)):
        ratio = (units[1].height / units[0].height) ** power
        assert getattr(gaits[1], name) / getattr(gaits[0], name) == pytest.approx(ratio)


def test_step_time_and_width_are_commanded():
    """They hold as soon as they are asked for, and the gait's own come back."""
    still = {"ahead": 0.2}
    _, _, env = walk(
        (2.0, GaitCommand(**still)), (4.0, GaitCommand(**still, step_time=0.45, width=0.28))
    )
    gait, state = env.controller.gait, env.simulation.state
    assert not env.fallen and env.controller._swing.duration == pytest.approx(0.45, abs=0.05)
    across = np.array([-state.heading[1], state.heading[0]])
    feet = state.sole_points[:, :2]
    assert abs((feet[0] - feet[1]) @ across) == pytest.approx(0.28, abs=0.04)
    assert env.controller.command == GaitCommand(0.2, step_time=0.45, width=0.28)
    env.controller.command = GaitCommand(0.2)
    for _ in range(150):
        env.step(np.zeros(len(env.action_names)))
    assert env.controller._swing.duration == pytest.approx(gait.step_time, abs=0.05)


@pytest.mark.parametrize("share, lasts", [(0.2, 0.75), (0.6, 0.5)])
def test_a_step_time_that_comes_late_in_a_swing_is_that_of_the_next_step(share, lasts):
    """Else a robot that is a little late takes each step of a clip as long as the next."""
    _, _, env = walk((4.0, GaitCommand(0.2, step_time=0.5)), seed=4)
    swing, action = env.controller._swing, np.zeros(len(env.action_names))
    memory = env.controller.memory

    def until(reached):
        while not reached():
            env.step(action)

    until(lambda: not memory.swinging)
    until(lambda: memory.swinging and swing.time > share * swing.duration)
    env.controller.command = GaitCommand(0.2, step_time=0.75)
    until(lambda: swing.time > swing.duration - 0.05)
    assert swing.duration == pytest.approx(lasts, abs=0.06)
    until(lambda: not memory.swinging)
    until(lambda: memory.swinging and swing.time > swing.duration - 0.05)
    assert swing.duration == pytest.approx(0.75, abs=0.06)


def test_a_step_time_of_a_command_is_above_zero():
    with pytest.raises(ConfigError, match=r"command\.step_time.*above 0"):
        GaitCommand(0.1, step_time=0.0)


@pytest.mark.parametrize("step_time", [5.1, np.inf, np.nan])
def test_a_step_time_of_a_command_is_one_that_a_pendulum_stands(step_time):
    """Longer ones would have e^(ωT) overflow, and the torques not be numbers."""
    with pytest.raises(ConfigError, match=r"command\.step_time.*at most 5"):
        GaitCommand(0.1, step_time=step_time)


def damped(factor: float) -> Robot:
    """The toddler with so many times the damping in its joints."""
    changed = copy.deepcopy(robot("toddler"))
    changed.model.dof_damping[6:] *= factor
    return changed


def test_slow_legs_walk_with_steps_that_they_can_do():
    """Mean speed and least time of a step are those of `possible_limits`, in SI units."""
    slow = damped(5.0)
    env = ResidualStepEnv(slow, controller="walk")
    env.reset(seed=0)
    controller = env.controller
    config, units = controller.config.gait, slow.units
    limits = possible_limits(slow, config.limits, config.swing, config.qp.torque.share)
    tick = controller.block(env.simulation.state, env.targets)
    pace = units.height * units.omega
    assert limits.speed < config.limits.speed
    assert tick.walk.search.speed == pytest.approx(limits.speed * pace)
    assert tick.walk.search.side_speed == pytest.approx(limits.side_speed * pace)
    assert tick.walk.search.time_min == pytest.approx(limits.time_min / units.omega)
    assert tick.walk.search.time_min > config.limits.time_min / units.omega
    assert tick.capture.search.time_max == pytest.approx(
        controller.config.limits.time_max / units.omega
    )


def test_a_step_is_not_commanded_to_be_quicker_than_the_legs():
    _, _, env = walk((2.0, GaitCommand(0.2, step_time=0.05)))
    gait = env.controller.gait
    assert not env.fallen
    assert env.controller._swing.duration >= gait.time_min - 1e-9


def test_legs_that_would_land_too_late_do_not_walk():
    """Nothing that is asked for makes them step."""
    env = ResidualStepEnv(damped(30.0), controller="walk", duration=1.0)
    env.reset(seed=0, options={"push": [], "command": {"ahead": 0.2, "turn": 0.1}})
    for _ in range(40):
        env.step(np.zeros(len(env.action_names)))
    assert env.controller.steps == 0 and not env.controller.walking
    assert not env.fallen


def test_a_payload_is_borne():
    """A tenth of its mass on the trunk, which the model does not have: what lasts is learned, and
    the walk goes on; without that most of these fall."""
    commands = [
        {"ahead": 0.5}, {"ahead": 0.3}, {"ahead": 0.7}, {"ahead": 0.3, "left": 0.15},
        {"ahead": 0.4, "turn": 0.3}, {"left": 0.2}, {"ahead": -0.3}, {"ahead": 0.4, "turn": -0.3},
    ]  # fmt: skip
    falls = []
    for load in (False, True):
        env = ResidualStepEnv(
            robot(), controller={"base": "walk"}, duration=7.0, pushes=None,
            realism={"body": {"payload": 0.1}}, estimator={"load": load},
        )  # fmt: skip
        fallen = 0
        for seed, command in enumerate(commands):
            env.reset(seed=seed, options={"command": command})
            while True:
                *_, terminated, truncated, _ = env.step(np.zeros(env.action_space.shape))
                if terminated or truncated:
                    break
            fallen += terminated
        falls.append(fallen)
    assert falls[1] <= 2 and falls[0] >= 4, falls


def test_a_caught_walk_goes_on():
    """Where ξ misses its place by more than `gait.catch`, the steps that catch a fall take over;
    the walk goes on once both soles have been down for `calm_time`."""
    data = to_dict(controller_config("walk"))
    data["gait"]["catch"] = 0.1
    env = ResidualStepEnv(controller=controller_config(data), duration=14.0)
    push = {"impulse": 20.0, "direction": 90.0, "start": 4.0, "duration": 0.1}
    env.reset(seed=0, options={"push": [push], "command": {"ahead": 0.3}})
    gait, action, rows = env.controller.gait, np.zeros(len(env.action_names)), []
    while env.episode.running:
        env.step_without_info(action)
        rows.append((env.simulation.time, env.controller.walking, bool(gait.caught)))
    assert not env.fallen
    time, walking, caught = np.array(rows).T
    assert walking[(time > 1.0) & (time < 4.0)].all() and not caught[time < 4.0].any()
    gone = time[caught == 1]
    assert len(gone) and 4.0 < gone[0] < 5.0 and not walking[caught == 1].any()
    assert gone[-1] - gone[0] > gait.calm_time and walking[-1] and not caught[-1]


def test_the_miss_is_what_the_cop_leaves():
    """ξ at touchdown, with the CoP as it is asked for, is off its regular end by `miss`."""
    env = ResidualStepEnv(controller="walk", duration=8.0)
    push = {"impulse": 25.0, "direction": 90.0, "start": 3.0, "duration": 0.1}
    env.reset(seed=0, options={"push": [push], "command": {"ahead": 0.3}})
    gait, misses = env.controller.gait, []
    while env.episode.running and env.simulation.time < 4.0:
        env.step_without_info(np.zeros(len(env.action_names)))
        misses.append((env.simulation.time, float(gait.miss)))
    time, miss = np.array(misses).T
    before = miss[(time > 1.5) & (time < 3.0)]
    assert miss[time > 3.0].max() > 0.1 > 3.0 * np.median(before)


def test_walk_g1_catches_as_walk_off_g1():
    """All gains of the steps are the same, so that it stands and catches a fall as that does."""
    one, other = (to_dict(controller_config(name)) for name in ("walk-g1", "walk-off-g1"))
    own = {"kind", "gait", "uncertain"}
    assert {k: v for k, v in one.items() if k not in own} == {
        k: v for k, v in other.items() if k not in own
    }
    assert one["gait"]["catch"] > 0.0 and one["gait"]["swing"] == other["swing"]
    assert one["gait"]["qp"] == other["step_qp"]
