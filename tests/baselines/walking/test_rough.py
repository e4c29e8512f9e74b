"""Rough ground that is not seen: feet high before they are far, which land on what there is."""

import numpy as np
import pytest

from poise.baselines.balance.stepping.planning.config import SwingTask
from poise.baselines.balance.stepping.planning.swing import (
    advance_high,
    aim_swing,
    swing_at,
    time_left,
)
from poise.baselines.balance.stepping.planning.swing_speed import swing_time
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.registry import load_controller
from poise.baselines.walking.config import GaitConfig
from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.tick import stands_higher
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import on_terrain
from poise.envs.terrain.stones import Stones
from tests.support.shared import robot

DT, PERIOD = 0.002, 0.02


def walking(controller, terrain=None, seed=0, seconds=4.0):
    """An environment that has walked at 0.5 m/s for some seconds, or until it fell."""
    env = ResidualStepEnv(controller=controller, duration=60.0, pushes=None)
    if terrain is not None:
        env.simulation = Simulation(on_terrain(env.robot, terrain))
    env.reset(seed=seed)
    env.controller.command = GaitCommand(0.5)
    action = np.zeros(len(env.action_names))
    for _ in range(round(seconds / PERIOD)):
        env.step_without_info(action)
        if env.fallen:
            break
    return env


def test_the_foot_is_high_before_it_is_far_and_comes_down_when_it_is_there():
    task = SwingTask(clearance=0.08, lift=0.35, landing_speed=0.3)
    swing = swing_at(np.array([0.0, 0.1, 0.01]), 0.4, task, robot().units)
    aim_swing(swing, 0.3, 0.1, 0.4)
    top, lower, way = 0.09, 0.75, []
    while time_left(swing) > 0.0:
        advance_high(swing, top, lower, DT)
        way.append((swing.time, *swing.reference[0, [0, 2]], *swing.reference[1:, 2]))
    time, x, z, speed, accel = np.array(way).T
    high = (time > 0.35 * 0.4) & (time < 0.75 * 0.4)
    assert np.all(np.abs(z[high] - top) < 2e-3)
    assert z[x < 0.05].max() > 0.08  # up, where most swings go ahead
    assert x[time >= 0.75 * 0.4].min() > 0.85 * 0.3
    assert (x[-1], z[-1], speed[-1]) == pytest.approx((0.3, 0.01, -swing.landing_speed), abs=2e-3)
    assert np.abs(np.diff(speed)).max() < 1.5 * np.abs(accel).max() * DT  # C¹ at least, everywhere


def test_uneven_tiles_that_are_not_seen_are_walked_over_where_toes_caught_before():
    tiles = Stones(count=6, error=0.02, unseen=True, seed=117)
    ends = {}
    for name in ("walk", "walk-rough"):
        env = walking(name, tiles, seed=117, seconds=7.0)
        ends[name] = env.fallen, float(env.simulation.state.com[0])
    assert ends["walk"][0]
    assert not ends["walk-rough"][0] and ends["walk-rough"][1] > 0.5 + 6 * 0.3


def test_a_foot_that_higher_ground_holds_up_has_landed():
    env = walking("walk-rough", seconds=3.0)
    tick = env.controller._walk_tick
    memory, state, swing = tick.walk.memory, tick.walk.state, tick.walk.swing
    while not memory.swinging or swing.time < 0.7 * swing.duration:
        env.step_without_info(np.zeros(len(env.action_names)))
    foot = memory.foot
    state.sole_point[foot, 2] = swing.reference[0, 2] + 0.02
    state.sole_axes[foot] = np.eye(3)
    assert not stands_higher(tick)  # it touches nothing
    state.contacts[foot] = 1.0
    assert stands_higher(tick)
    swing.time *= 0.5
    assert not stands_higher(tick)  # an edge on the way
    swing.time *= 2.0
    state.sole_axes[foot, 2, 2] = np.cos(np.radians(15.0))
    assert not stands_higher(tick)  # on an edge of its sole
    state.sole_axes[foot, 2, 2] = 1.0
    state.sole_point[foot, 2] = swing.reference[0, 2] + 0.005
    assert not stands_higher(tick)  # where it is led


def test_a_foot_that_comes_down_late_has_as_much_time_as_its_motors_need():
    config = load_controller("walk-rough", robot())._gait_config
    assert config.lifting.lift == pytest.approx(0.25) and GaitConfig().lifting.lift == 0.45
    late, soon = (swing_time(robot(), swing, 0.1) for swing in (config.lifting, config.swing))
    assert late == pytest.approx(0.35 / 0.25 * soon)


def test_a_foot_does_not_come_down_before_it_is_up():
    with pytest.raises(ValueError, match=r"lower: must be 0 or at least swing.lift, 0.45"):
        GaitConfig(lower=0.3)
