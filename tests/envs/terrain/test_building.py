"""Terrain in the simulation: that it is there, and that robots stand on it as on level ground."""

import mujoco
import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import on_terrain
from poise.envs.robots.variants import coarser_robot
from poise.envs.terrain.building import BUILT
from poise.envs.terrain.flat import Flat
from poise.envs.terrain.slope import Slope
from poise.envs.terrain.stairs import Stairs
from poise.envs.terrain.stones import Stones
from tests.support.physics import contact_forces, controller, forward, robot_named, slippery

TERRAINS = [Stairs(), Stairs(down=True), Slope(angle=-8.0), Stones(gap=0.05, error=0.02, seed=3)]


def standing_at(robot, x, sink=0.0):
    """A simulation of the robot standing at x on its terrain."""
    simulation = Simulation(robot)
    qpos = robot.standing_qpos.copy()
    qpos[0] += x
    qpos[2] += robot.terrain.height(x, 0.0) - sink
    simulation.reset(qpos)
    return simulation


def hold(simulation, seconds):
    """Let the momentum QP stand still."""
    qp, state = controller(simulation.robot), simulation.state
    targets = Targets.standing(simulation.robot, state)
    for _ in range(round(seconds / 0.004)):
        state = simulation.step(qp.torques(state, targets), 2)
    return state


@pytest.mark.parametrize("name", ["humanoid", "tall"])
@pytest.mark.parametrize("terrain", TERRAINS, ids=lambda t: t.kind)
def test_rays_from_above_meet_the_surfaces(name, terrain):
    """What is simulated is what the data say: everywhere, to the edge."""
    model = on_terrain(robot_named(name), terrain).model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    geom, met = np.zeros(1, dtype=np.int32), 0
    for x, y in np.random.default_rng(1).uniform([-1.0, -1.4], [6.0, 1.4], (300, 2)):
        above = np.array([x, y, 3.0])
        way = mujoco.mj_ray(model, data, above, np.array([0.0, 0.0, -1.0]), None, 1, -1, geom)
        if model.geom_bodyid[geom[0]] == 0:
            assert 3.0 - way == pytest.approx(terrain.height(x, y), abs=1e-9)
            met += 1
    assert met > 200


@pytest.mark.parametrize("name", ["humanoid", "unitree_g1"])
def test_surfaces_have_shades_of_their_own(name):
    """By turns, and not the material that a robot's description gives all of its geoms."""
    model = on_terrain(robot_named(name), Stairs()).model
    boxes = [g for g in range(model.ngeom) if model.geom(g).name.startswith(BUILT)]
    assert boxes and np.all(model.geom_matid[boxes] == -1)
    assert np.all(model.geom_rgba[boxes[0], :3] != model.geom_rgba[boxes[1], :3])


def test_level_ground_is_the_model_itself():
    robot = robot_named("humanoid")
    assert on_terrain(robot, Flat()) is robot
    stairs = on_terrain(robot, Stairs())
    assert on_terrain(stairs, Stairs()) is stairs
    back = on_terrain(stairs, Flat())
    assert back.model.ngeom == robot.model.ngeom and back.model.nsensor == robot.model.nsensor
    assert stairs.fingerprint == robot.fingerprint  # policies and controllers fit
    np.testing.assert_array_equal(stairs.standing_qpos, robot.standing_qpos)


def test_variants_of_a_robot_are_the_same_on_a_terrain():
    robot = robot_named("humanoid")
    varied = slippery(coarser_robot(robot, 0.004), 0.4)
    moved = on_terrain(varied, Stairs())
    assert moved.model.opt.timestep == 0.004 and moved.mass == varied.mass
    assert moved.fingerprint == varied.fingerprint != robot.fingerprint
    np.testing.assert_array_equal(moved.model.geom_friction[:, 0], 0.4)
    np.testing.assert_array_equal(moved.model.body_inertia, varied.model.body_inertia)


@pytest.mark.parametrize("down", [False, True])
def test_standing_on_a_step_is_as_standing_on_level_ground(down):
    """Contact, CoP, capture point, ω and fall are relative to the step, at −0.9 m as at 0.9 m."""
    robot = robot_named("humanoid")
    level = Simulation(robot)
    plain = hold(level, 0.2).copy()
    stairs = Stairs(tread=0.5, down=down)
    x, y = 2.75, 0.0
    simulation = standing_at(on_terrain(robot, stairs), x)
    state = hold(simulation, 0.2)
    z = stairs.height(x, y)
    assert z == pytest.approx(-0.5 if down else 0.5)
    np.testing.assert_array_equal(state.contacts, [1.0, 1.0])
    assert not state.other_contact
    np.testing.assert_allclose(state.ground, z)
    assert state.support_height == pytest.approx(z, abs=1e-3)
    assert state.omega == pytest.approx(plain.omega, rel=1e-4)
    np.testing.assert_allclose(state.cop - [x, y], plain.cop, atol=1e-4)
    np.testing.assert_allclose(state.capture_point - [x, y], plain.capture_point, atol=1e-4)
    np.testing.assert_array_equal(state.arrays.edges, 0.0)


def test_the_centre_of_pressure_is_where_the_contacts_are():
    """On a step 0.5 m up a horizontal force would move the CoP of z = 0 by a centimetre."""
    simulation = standing_at(on_terrain(robot_named("humanoid"), Stairs(tread=0.5)), 2.75)
    hold(simulation, 0.1)
    simulation.data.xfrc_applied[simulation.robot.root_body_id, 0] = 150.0
    state = forward(simulation)
    points, forces = map(np.array, zip(*contact_forces(simulation), strict=True))
    total = forces.sum(axis=0)
    assert abs(0.5 * total[0] / total[2]) > 0.008
    pressed = points[:, :2].T @ forces[:, 2] / total[2]
    np.testing.assert_allclose(state.cop, pressed, atol=1e-3)


def test_toes_over_an_edge_are_told_from_a_foot_on_its_tread():
    stairs = Stairs(tread=0.5, down=True)
    robot = on_terrain(robot_named("humanoid"), stairs)
    assert hold(standing_at(robot, 0.2), 0.02).arrays.edges.tolist() == [0.0, 0.0]
    assert hold(standing_at(robot, 0.45), 0.02).arrays.edges.tolist() == [1.0, 1.0]


def test_toes_against_a_step_touch_its_edge():
    robot = on_terrain(robot_named("humanoid"), Stairs(start=0.5))
    toes = max(sole.polygon[:, 0].max() for sole in robot.soles)
    simulation = standing_at(robot, 0.5 - toes - 0.005)
    assert simulation.state.arrays.edges.tolist() == [0.0, 0.0]
    simulation.data.qvel[0] = 1.0
    simulation.reset(simulation.data.qpos.copy(), simulation.data.qvel.copy())
    state = simulation.step(np.zeros(robot.model.nu), 8)
    assert state.arrays.edges.tolist() == [1.0, 1.0]


def test_shins_in_a_step_are_a_fall_and_feet_are_none():
    """Contact of anything but the feet, with any part of the terrain."""
    robot = on_terrain(robot_named("humanoid"), Stairs())
    assert not standing_at(robot, 1.25).state.other_contact
    assert standing_at(robot, 1.25, sink=0.3).state.other_contact


@pytest.mark.parametrize("down", [False, True])
def test_an_environment_judges_relative_to_the_ground(down):
    """Quiet and upright 0.9 m above or below the start; the same posture dropped there is none."""
    env = TorqueBalanceEnv(terrain={"kind": "stairs", "down": down}, pushes=None)
    qpos = env.robot.standing_qpos.copy()
    qpos[0] += 4.0
    qpos[2] += env.robot.terrain.height(4.0, 0.0)
    env.reset(seed=0, options={"qpos": qpos, "qvel": np.zeros(env.model.nv)})
    env.step(np.zeros(env.action_space.shape))
    assert not env.fallen
    height = env.robot.terrain.height(4.0, 0.0)
    assert env.simulation.state.support_height == pytest.approx(height, abs=0.01)
    for _ in range(100):
        if env.step(np.zeros(env.action_space.shape))[2]:
            break
    assert env.fallen


def test_edges_are_counted_once_each_time_a_foot_comes_to_one():
    env = TorqueBalanceEnv(terrain={"kind": "stairs", "down": True, "tread": 0.5}, pushes=None)
    for x, count in ((0.2, 0.0), (0.45, 2.0)):
        qpos = env.robot.standing_qpos.copy()
        qpos[0] += x
        env.reset(seed=0, options={"qpos": qpos, "qvel": np.zeros(env.model.nv)})
        for _ in range(3):
            env.step(np.zeros(env.action_space.shape))
        assert env.episode.metrics.edge_contacts == count
