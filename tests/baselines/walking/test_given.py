"""Walking over terrain: on treads that are given, and on ground that is not seen."""

import numpy as np
import pytest

from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.registry import load_controller
from poise.baselines.walking.config import TreadConfig
from poise.baselines.walking.given import given_footholds
from poise.baselines.walking.planner.command import GaitCommand
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import on_terrain
from poise.envs.terrain.flat import Flat
from poise.envs.terrain.slope import Slope
from poise.envs.terrain.stairs import Stairs
from poise.envs.terrain.stones import Stones
from tests.support.refused import invalid
from tests.support.shared import robot

WALK = GaitCommand(0.5)


@pytest.fixture(scope="module")
def env():
    return ResidualStepEnv(controller="walk", duration=60.0, pushes=None)


def over(env, terrain, *commands, seed=0):
    """Play (seconds, command) on a terrain; the soles (n, 2, 3) where feet have landed."""
    env.simulation = Simulation(on_terrain(env.robot, terrain))
    env.reset(seed=seed)
    action, landed, swinging = np.zeros(len(env.action_names)), [], False
    for seconds, command in commands:
        env.controller.command = command
        for _ in range(round(seconds / 0.02)):
            env.step_without_info(action)
            before, swinging = swinging, bool(env.controller.memory.swinging)
            if before and not swinging:
                foot = env.controller.foot
                landed.append(env.simulation.state.sole_points[foot].copy())
            if env.fallen:
                return np.array(landed)
    return np.array(landed)


@pytest.mark.parametrize("down", [False, True])
def test_stairs_are_walked_foot_over_foot_each_sole_on_its_tread(env, down):
    stairs = Stairs(count=4, down=down)
    landed = over(env, stairs, (6.5, WALK))
    assert not env.fallen and env.episode.metrics.edge_contacts == 0.0
    assert env.simulation.state.support_height == pytest.approx(-0.4 if down else 0.4, abs=0.01)
    half = max(np.ptp(sole.polygon[:, 0]) for sole in robot().soles) / 2
    surfaces, reached = stairs.surfaces(), []
    for x, _, z in landed:
        (on,) = [i for i, s in enumerate(surfaces) if s.x_min <= x <= s.x_max]
        reached.append(on)
        assert surfaces[on].x_min < x - half and x + half < surfaces[on].x_max
        assert z == pytest.approx(surfaces[on].height, abs=0.02)
    assert [i for i in reached if i in (1, 2, 3)] == [1, 2, 3]  # one foot each


def test_it_stops_on_stairs_with_both_feet_on_one_tread(env):
    over(env, Stairs(), (4.5, WALK), (5.0, GaitCommand()))
    feet, state = env.simulation.state.sole_points[:, 2], env.simulation.state
    assert not env.fallen and not env.controller.walking
    assert abs(feet[0] - feet[1]) < 0.01 and 0.05 < state.support_height < 0.85
    assert np.linalg.norm(state.com_vel) < 0.1


@pytest.mark.parametrize("angle", [-8.0, 8.0])
def test_a_slope_that_is_not_seen_is_walked_on(env, angle):
    over(env, Slope(angle=angle, length=2.0, unseen=True), (7.0, WALK))
    rise = 2.0 * np.tan(np.radians(angle))
    assert not env.fallen
    assert env.simulation.state.support_height == pytest.approx(rise, abs=0.02)


def test_level_ground_after_stairs_is_walked_as_before_bit_for_bit(env):
    def path():
        over(env, Flat(), (3.0, WALK))
        return env.simulation.state.qpos.copy()

    before = path()
    over(env, Stairs(count=1), (2.0, WALK))
    assert env.controller.gait.treads.surfaces.shape[0] == 2
    np.testing.assert_array_equal(path(), before)
    assert env.controller.gait.treads.surfaces.shape[0] == 0


@pytest.mark.parametrize(
    ("terrain", "says"),
    [
        (Stairs(tread=0.2), ("terrain", "0.2 m", "'humanoid'", "0.28 m")),
        (Stairs(rise=0.3), ("terrain", "0.3 m", "0.197 m")),
        (Stairs(rise=0.3, down=True), ("terrain", "-0.3 m")),
        (Stones(gap=0.4), ("terrain", "0.472 m")),
        (Slope(angle=20.0), ("terrain", "20°", "10°")),
    ],
)
def test_what_cannot_be_stepped_is_told_with_the_limits_of_the_robot(terrain, says):
    walk = load_controller("walk", robot())
    with invalid(*says):
        walk.terrain = terrain
    walk.terrain = type(terrain)(**{**vars(terrain), "unseen": True})  # it does not know
    assert walk.gait.treads.surfaces.shape[0] == 0


def test_ground_without_treads_leaves_footholds_free():
    config = TreadConfig()
    assert given_footholds(Flat(), robot(), config) == []
    assert given_footholds(Slope(), robot(), config) == []
    assert len(given_footholds(Stairs(count=3), robot(), config)) == 4


def test_the_trunk_leans_ahead_over_high_stairs_only(env):
    """What the leading knee cannot bear of an upright robot; it is upright again on the landing."""

    def leans(rise, seconds):
        over(env, Stairs(count=2, rise=rise), (2.0, WALK))
        most = 0.0
        for _ in range(round(seconds / 0.02)):
            env.step_without_info(np.zeros(len(env.action_names)))
            most = max(most, float(env.controller.gait.treads.leaning))
        return most, float(env.controller.gait.treads.leaning)

    config, h = TreadConfig(), robot().height_com
    most, end = leans(0.15, 3.5)
    assert not env.fallen and env.simulation.state.support_height == pytest.approx(0.3, abs=0.01)
    asked = config.lean * (0.15 / h - config.lean_from)
    assert 0.9 * asked < most <= asked and end < 0.1 * asked
    assert leans(0.10, 2.0) == (0.0, 0.0)
