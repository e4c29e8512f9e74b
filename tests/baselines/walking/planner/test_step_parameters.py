"""Step parameters that a walk is told: clearance, step length, width, the swing of its arms."""

from dataclasses import replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import load_controller
from poise.baselines.walking.planner.arms import arm_scales, largest_swing
from poise.baselines.walking.planner.command import GaitCommand, command_of
from poise.baselines.walking.planner.reach import COMMANDED, shared_reach, touching_width
from poise.configs.errors import ConfigError
from tests.support.refused import invalid
from tests.support.shared import robot

PERIOD = 0.02
ROBOTS = ("humanoid", "tall", "compact", "toddler", "human")


class Played:
    """A walk by commands, (seconds, command) after each other, and what its feet and arms did."""

    def __init__(self, *commands, name="humanoid", seed=1):
        self.env = ResidualBalanceEnv(robot(name), controller="walk", pushes=None, duration=60.0)
        self.env.reset(seed=seed)
        rows = []
        for seconds, command in commands:
            self.env.command = command
            for _ in range(round(seconds / PERIOD)):
                self.env.step(np.zeros(len(self.env.action_names)))
                state = self.env.simulation.state
                rows.append((state.sole_points.copy(), state.contacts > 0.5, state.q.copy(),
                             state.angular_momentum[2], state.heading.copy()))  # fmt: skip
        self.feet, self.down, self.q, self.spin, self.heading = (
            np.array(column) for column in zip(*rows, strict=True)
        )

    def last(self, seconds):
        return slice(-round(seconds / PERIOD), None)

    def clearances(self, seconds):
        """The largest height of each foot in each of its swings."""
        found, part = [], self.last(seconds)
        for foot in range(2):
            height, air = self.feet[part, foot, 2], ~self.down[part, foot]
            edges = np.flatnonzero(np.diff(air.astype(int)))
            found += [height[a + 1 : b + 1].max() for a, b in pairwise(edges)
                      if air[a + 1] and b - a > 4]  # fmt: skip
        return np.array(found)

    def arms(self, seconds):
        """(n, 2) the turn of the arm on the side of each foot about the robot's left axis."""
        scales, part = arm_scales(self.env.robot), self.last(seconds)
        off = self.q[part] - self.env.robot.standing_qpos[7:]
        return off @ scales.T / np.sum(scales**2, axis=1)

    def ahead(self, seconds):
        """(n,) by how much the first foot is ahead of the second one [m]."""
        part = self.last(seconds)
        apart = self.feet[part, 0, :2] - self.feet[part, 1, :2]
        return np.sum(apart * self.heading[part], axis=1)


def test_a_foot_clears_the_ground_by_what_is_commanded():
    """Within 15 % or 8 mm, as soon as it is asked for; the gait's own comes back."""
    own = Played((5.0, GaitCommand(0.5)))
    free = own.clearances(2.0).mean()
    for wanted in (0.03, 0.08, 0.11):
        found = Played((2.0, GaitCommand(0.5)), (3.0, GaitCommand(0.5, clearance=wanted)))
        assert not found.env.fallen
        assert found.clearances(2.0).mean() == pytest.approx(wanted, abs=max(0.008, 0.15 * wanted))
    found.env.command = GaitCommand(0.5)
    again = Played((2.0, GaitCommand(0.5, clearance=0.11)), (4.0, GaitCommand(0.5)))
    assert again.clearances(2.0).mean() == pytest.approx(free, abs=0.004)


def test_arms_swing_against_the_legs():
    """By what is commanded, each against the leg of its side; else they only balance the robot."""
    swung = Played((8.0, GaitCommand(0.6, arm_swing=0.4)))
    assert not swung.env.fallen
    arms, ahead = swung.arms(4.0), swung.ahead(4.0)
    for arm, sign in ((0, 1.0), (1, -1.0)):  # positive is backward
        turn = arms[:, arm] - arms[:, arm].mean()
        assert np.corrcoef(turn, sign * ahead)[0, 1] > 0.9
        assert 0.5 * np.ptp(turn) == pytest.approx(0.4, abs=0.08)


def test_no_arm_swing_is_the_walk_as_it_was_bit_for_bit():
    """Zero or None; and the weights of the posture are as before when it is taken back."""
    ends = [Played((3.0, GaitCommand(0.5, arm_swing=swing))).env for swing in (None, 0.0)]
    np.testing.assert_array_equal(*(env.simulation.data.qpos for env in ends))
    weight = ends[0].controller.gait_sets.posture.weight.copy()
    env = Played((1.5, GaitCommand(0.5, arm_swing=0.4))).env
    assert np.any(env.controller.gait_sets.posture.weight != weight)
    env.command = GaitCommand(0.5)
    env.step(np.zeros(len(env.action_names)))
    np.testing.assert_array_equal(env.controller.gait_sets.posture.weight, weight)


def test_a_step_length_is_commanded():
    """Steps of 0.2 m at 0.5 m/s last 0.4 s from one to the next."""
    found = Played((8.0, GaitCommand(0.5, step_length=0.22)))
    assert not found.env.fallen
    assert np.abs(found.ahead(4.0)).max() == pytest.approx(0.22, abs=0.03)


def test_steps_that_last_longer_than_the_planner_lets_them_by_itself_stay_as_long():
    """Steps of 0.5 m at 0.8 m/s last 0.59 s, and its own longest are 0.57 s."""
    found = Played((10.0, GaitCommand(0.8, step_length=0.5)))
    env = found.env
    own = env.controller.gait_limits.time_max / env.robot.omega
    assert not env.fallen and own < 0.57
    both = found.down.all(axis=1)[found.last(4.0)]
    assert np.abs(found.ahead(4.0))[both].mean() == pytest.approx(0.5, abs=0.04)
    assert env.controller._swing.duration > own + 0.01


@pytest.mark.parametrize("width", [0.12, 0.28])
def test_a_width_is_commanded(width):
    """Also one below what the planner chooses itself."""
    found = Played((6.0, GaitCommand(0.4, width=width)))
    across = np.stack([-found.heading[:, 1], found.heading[:, 0]], axis=1)
    apart = np.abs(np.sum((found.feet[:, 0, :2] - found.feet[:, 1, :2]) * across, axis=1))
    both = found.down.all(axis=1)[found.last(3.0)]
    assert not found.env.fallen
    assert apart[found.last(3.0)][both].mean() == pytest.approx(width, abs=0.02)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ({"ahead": 9.0}, ("command.ahead", "9 m/s", "0.591 m", "1.85 m/s")),
        ({"left": -2.0}, ("command.left", "-2 m/s", "0.355 m")),
        ({"turn": 1.9}, ("command.turn", "1.9 rad/s", "-1.72 to 1.72 rad/s", "-98.6 to 98.6 °/s")),
        ({"ahead": 0.5, "clearance": 0.9}, ("command.clearance", "0.9 m", "0.787 m")),
        ({"ahead": 0.5, "width": 0.05}, ("command.width", "0.05 m", "0.09 to 0.591 m")),
        ({"ahead": 0.5, "width": 1.0}, ("command.width", "1 m", "0.09 to 0.591 m")),
        ({"ahead": 0.5, "arm_swing": 3.0}, ("command.arm_swing", "3 rad", "0.881 rad")),
        ({"ahead": 0.8, "step_length": 0.1}, ("command.step_length", "0.1 m", "0.199 m")),
    ],
)
def test_a_command_out_of_reach_is_refused_with_the_limits_of_the_robot(command, said):
    """At the reset, and while it walks; the command that held goes on."""
    env = ResidualBalanceEnv(robot(), controller="walk", pushes=None, duration=1.0)
    with invalid(*said, "'humanoid'"):
        env.reset(seed=0, options={"command": command})
    env.reset(seed=0, options={"command": {"ahead": 0.4}})
    with invalid(*said, "'humanoid'"):
        env.command = command
    assert env.command == GaitCommand(0.4)


@pytest.mark.parametrize("name", ["humanoid", "toddler"])
def test_the_reach_of_a_robot_is_what_it_is_not_refused(name):
    """Each end by itself is taken, and what is beyond it is not."""
    walker = load_controller("walk", robot(name))
    reach, said = walker.reach, {}
    for key in COMMANDED:
        for end, sign in zip(getattr(reach, key), (-1.0, 1.0), strict=True):
            if end == 0.0:  # to have none is no command
                continue
            for outside in (False, True):
                value = end + sign * 3e-3 * outside  # [m], [m/s] or [rad]
                said[key, sign, outside] = _refused(walker, key, value)
    assert len(said) == 2 * 11 and {case: case[2] for case in said} == said
    assert reach.own_width == pytest.approx(0.288 * robot(name).height_com)


def _refused(walker, key, value):
    """Whether a walk, slow enough for it, is refused such a step."""
    command = {key: value}
    if key == "clearance":  # the longest swing that the planner takes
        command["step_time"] = walker.gait_limits.time_max / walker.robot.omega
    if key == "step_length":
        command["ahead"] = 0.2
    try:
        walker.check_command(GaitCommand(**command))
    except ConfigError as error:
        assert error.field == f"command.{'ahead' if key == 'step_length' else key}"
        return True
    return False


def test_robots_side_by_side_reach_what_both_do():
    """A walk that does not say what it reaches leaves nothing to offer."""
    large, small = (load_controller("walk", robot(name)).reach for name in ("humanoid", "toddler"))
    both = shared_reach([large, small])
    assert both.width == (large.width[0], small.width[1]) and both.period == large.period
    assert both.ahead[1] == small.ahead[1] > 0.0 and both.left[0] == small.left[0] < 0.0
    assert shared_reach([large, None]) is None and shared_reach([]) is None


def test_a_robot_without_named_arms_swings_none():
    body = robot("humanoid")
    description = replace(body.description, roles={})
    env = ResidualBalanceEnv(replace(body, description=description), controller="walk", pushes=None)
    with invalid("command.arm_swing"):
        env.reset(seed=0, options={"command": {"ahead": 0.2, "arm_swing": 0.2}})


@pytest.mark.parametrize("name", ROBOTS)
def test_every_packaged_robot_says_what_swings_its_arms(name):
    """The arm that swings ahead is before its shoulder: a turn about the left axis is backward."""
    body = robot(name)
    scales = arm_scales(body)
    assert np.all(np.abs(scales).sum(axis=1) > 0.0) and 0.3 < largest_swing(body) < 3.0
    found = Played((0.04, GaitCommand()), name=name)
    for foot, sign in enumerate((1.0, -1.0)):
        assert _hand_ahead(found.env, scales[foot]) < -0.02, (name, foot, sign)
    assert 0.0 < touching_width(body) < 0.3 * body.height_com


def _hand_ahead(env, scales):
    """By how much the arms' farthest bodies go ahead for a turn of 0.3 rad [m]."""
    model, data = env.robot.model, mujoco.MjData(env.robot.model)
    data.qpos[:] = env.robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    before = data.xpos.copy()
    data.qpos[7:] += 0.3 * scales
    mujoco.mj_kinematics(model, data)
    moved = data.xpos[:, 0] - before[:, 0]
    return moved[np.argmax(np.abs(moved))]


def test_a_command_and_its_array_say_the_same():
    for command in (
        GaitCommand(0.3, 0.1, -0.2),
        GaitCommand(0.5, width=0.2, clearance=0.07, arm_swing=0.3, step_length=0.25),
        GaitCommand(0.5, step_time=0.4),
    ):
        assert command_of(command.array()) == command


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"clearance": 0.0}, ("command.clearance", "above 0")),
        ({"arm_swing": -0.1}, ("command.arm_swing", "0 or above")),
        (
            {"ahead": 0.5, "step_length": 0.3, "step_time": 0.4},
            ("command.step_length", "step_time", "not both"),
        ),
        ({"step_length": 0.3}, ("command.step_length", "a speed")),
    ],
)
def test_bad_step_parameters(fields, said):
    with invalid(*said):
        GaitCommand(**fields)


def test_limits_are_those_of_the_robots_size():
    """A larger body takes larger clearances and widths."""
    walkers = [load_controller("walk", robot(name)) for name in ("toddler", "tall")]
    wide = GaitCommand(0.3, width=0.7)
    walkers[1].check_command(wide)
    with pytest.raises(ConfigError, match="'toddler' supports"):
        walkers[0].check_command(wide)
