"""Feet that have stepped go back to the stance of standing."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.balance.stepping.planning.recentring import (
    BOUNCE_TIME,
    INACTIVE,
    LOADING,
    SHIFTING,
    SLIP_TIME,
    SWINGING,
    limit_cop_distance,
    lower_foot,
    plan_recentring,
    shift_weight,
    slipped_foot,
)
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config, load_controller
from poise.envs.physics.simulation import Simulation
from tests.baselines.balance.stepping.test_capture_step import trial
from tests.support import planned
from tests.support import stepping_reference as readable
from tests.support.shared import robot


def play(direction, home=True, **settings):
    """feedback-step after a push that it steps for."""
    config = controller_config("feedback-step")
    if not home:
        config = replace(config, recentring=replace(config.recentring, distance=0.0))
    controller = CaptureStep(robot(), config)
    # to the left 22 N·s are next to where it falls: starts 1e-5 rad apart would end otherwise
    impulse = 20.0 if direction == 90.0 else 22.0
    return trial(controller, impulse, direction, seed=3, **{"duration": 6.0, **settings})


def away(env):
    """How far the feet are from their stance at rest, in the heading of the last step [m]."""
    level = env.controller.memory.level_frame[:2, :2]
    apart = np.diff(env.simulation.state.sole_points[::-1, :2], axis=0)[0]
    return np.linalg.norm(level.T @ apart - env.controller.recentring.nominal)


@pytest.mark.parametrize("direction", [0.0, 90.0, 180.0, 315.0])
def test_feet_go_home_once_it_is_calm(direction):
    """Without, they stay where the fall was caught; either way the robot ends quiet."""
    fallen, env = play(direction, home=False)
    assert not fallen and env.recovered
    assert away(env) > 0.14 * env.controller.robot.height_com
    steps = env.controller.steps
    fallen, env = play(direction)
    assert not fallen and env.recovered
    assert away(env) < 0.14 * env.controller.robot.height_com
    assert env.controller.steps > steps
    yaws = [np.arctan2(axes[1, 0], axes[0, 0]) for axes in env.simulation.state.sole_axes]
    assert abs(yaws[0] - yaws[1]) < np.radians(25.0)


def test_the_next_push_meets_a_first_step():
    """At home and calm nothing is left of the steps before, but their count."""
    _, env = play(0.0)
    assert env.controller.steps > 1
    assert env.controller.memory.recovering == 0
    _, env = play(0.0, home=False)
    assert env.controller.memory.recovering == 1


def test_a_push_on_the_way_home_is_caught():
    """The step home becomes one that catches the fall."""
    begun = []

    def look(env):
        if env.controller.recentring.stage == SWINGING:
            begun.append(env.simulation.time)

    play(0.0, watch=look)
    stages = []

    def watch(env):
        stages.append((env.simulation.time, int(env.controller.recentring.stage)))

    second = {"impulse": 20.0, "direction": 150.0, "start": begun[0] + 0.04, "body": "torso"}
    fallen, env = play(0.0, later=[second], watch=watch, duration=6.5)
    assert not fallen and env.recovered
    after = [stage for time, stage in stages if second["start"] < time < second["start"] + 0.3]
    assert INACTIVE in after


def moved_state(controller, shift):
    """Standing, with a velocity that brings ξ away by `shift` (2,)."""
    simulation = Simulation(robot())
    velocity = np.zeros(robot().model.nv)
    velocity[:2] = np.asarray(shift) * controller.robot.omega
    simulation.reset(robot().standing_qpos, velocity)
    return simulation.state


@pytest.mark.parametrize("shift", [(0.0, 0.06), (0.0, 0.12), (0.05, 0.2), (0.3, 0.3)])
def test_foothold_home(shift):
    """The first of nine footholds, from home to the planner's own, with ξ inside by `margin`."""
    controller = load_controller("feedback-step", robot())
    state, planner, recentring = (
        moved_state(controller, shift),
        planned.Planner.of(controller),
        controller.recentring,
    )
    q = planner.search(state)
    q.heading[:] = 1.0, 0.0
    recentring.foot, q.feedback.signals.later_step = 1, 1.0
    plan_recentring(q, recentring)
    stance, foot = state.sole_points[:, :2]
    readers = readable.ReadablePlanner(planner)
    time = controller.config.recentring.swing_time / controller.robot.omega
    catch, _ = readers.foothold(state, 1, 0.0, time, foot)
    own = planned.alone(controller.region, 0, stance, 0.0)
    p = readable.nearest_inside(own, state.capture_point)
    end = readable.drifted(state.capture_point, p, state.omega, time)
    rest = stance - recentring.nominal
    for share in np.linspace(0.0, 1.0, 9):
        wanted = rest + share * (catch - rest)
        outside = readable.beyond(controller.region, stance, wanted, 0.0, end)
        if outside < -controller.config.recentring.margin * controller.robot.height_com:
            break
    np.testing.assert_allclose([q.best_x, q.best_y], wanted, atol=1e-9)
    np.testing.assert_allclose([q.best_time, q.best_cost], [time, outside], atol=1e-9)
    if shift == (0.0, 0.06):
        np.testing.assert_allclose(wanted, rest)  # home itself
    if shift == (0.3, 0.3):
        assert share == 1.0 and outside > 0.0


def test_the_pressure_stays_near_a_foot_that_came_home():
    """p is at most `cop_distance` from ξ until ξ has come to rest."""
    controller = load_controller("feedback-step", robot())
    env = ResidualBalanceEnv(robot(), controller=controller)
    env.reset(seed=0)
    t = controller.tick(env.simulation.state, env.targets)
    xi, h = t.state.capture_point, controller.robot.height_com
    t.recentring.stage = LOADING
    p = np.array([xi[0] + 0.3, xi[1] - 0.4])
    limit_cop_distance(t, xi[0] + 0.1, xi[1], p)
    np.testing.assert_allclose(p - xi[:2], 0.05 * h * np.array([0.6, -0.8]), atol=1e-12)
    assert t.recentring.stage == LOADING
    limit_cop_distance(t, xi[0] + 0.01 * h, xi[1], p)
    assert t.recentring.stage == INACTIVE


def test_a_foot_that_slipped_is_lowered():
    """Off the ground or sliding for `SLIP_TIME`, the other one standing; not at touchdown."""
    controller = load_controller("feedback-step", robot())
    env = ResidualBalanceEnv(robot(), controller=controller)
    env.reset(seed=0)
    t = controller.tick(env.simulation.state, env.targets)
    ticks = int(np.ceil(SLIP_TIME / controller.period)) + 1
    t.state.contacts[:] = 1.0, 0.0
    t.memory.clock = 0.5 * BOUNCE_TIME
    assert all(slipped_foot(t) < 0 for _ in range(2 * ticks))
    t.memory.clock = 2.0 * BOUNCE_TIME
    found = [slipped_foot(t) for _ in range(ticks)]
    assert found[-1] == 1 and set(found[:-2]) == {-1}
    t.state.contacts[1] = 1.0
    assert slipped_foot(t) == -1
    t.state.J_v[6] = 0.5
    assert [slipped_foot(t) for _ in range(ticks)][-1] == 1
    t.state.sole_point[1, 2] = 0.04
    lower_foot(t, 1)
    assert controller.swing is not None and controller.foot == 1
    assert controller.swing.reference[1, 0] == 0.5
    heights = [planned.advance(controller.swing, 0.004)[0, 2] for _ in range(60)]
    assert max(heights) < heights[0] + 0.01  # it does not rise again
    assert heights[-1] < 0.0


@pytest.mark.parametrize("direction", [0.0, 90.0, 200.0])
def test_where_the_weight_goes_before_a_step_home(direction):
    """From the middle of the stance sole's region: `capture_offset` to the nominal place, and
    `counterbalance` of the way."""
    _, env = play(direction, home=False)
    state, controller = env.simulation.state, env.controller
    t, c, h = (
        controller.tick(state, env.targets),
        controller.config.recentring,
        controller.robot.height_com,
    )
    shift_weight(t)
    soles, foot = state.sole_points[:, :2], t.recentring.foot
    distances = np.linalg.norm(soles - state.capture_point, axis=1)
    assert t.recentring.stage == SHIFTING and foot == np.argmax(distances)
    ahead = t.state.sole_axes[1 - foot, :2, 0]
    ahead = ahead / np.linalg.norm(ahead)
    home = controller.recentring.nominal * (1.0 if foot == 0 else -1.0)
    axes = np.array([ahead, [-ahead[1], ahead[0]]])  # rows
    way = axes @ (soles[foot] - soles[1 - foot]) - home
    assert np.linalg.norm(way) > 0.1
    rest = controller.region.middle[1 - foot] + c.counterbalance * way
    rest = rest + c.capture_offset * h * home / np.linalg.norm(home)
    np.testing.assert_allclose(
        t.recentring.capture_target, soles[1 - foot] + rest @ axes, atol=1e-12
    )


def test_weight_goes_to_one_foot_before_the_other_lifts_off():
    """ξ is nearer to the foot that stays than before."""
    seen = []

    def watch(env):
        recentring = env.controller.recentring
        if recentring.stage == SHIFTING:
            xi = env.simulation.state.capture_point
            seen.append(np.linalg.norm(xi - recentring.capture_target))

    play(90.0, watch=watch)
    assert len(seen) > 3
    assert seen[-1] < 0.5 * seen[0]
