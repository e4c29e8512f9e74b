"""`Plant` of envs/sensing/drawn.py: bodies and ground of an episode."""

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.physics.arms import find_arms
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import on_terrain
from poise.envs.sensing.drawn import CHANGED, Plant
from poise.envs.terrain.arrays import ground_height
from poise.envs.terrain.bumps import Bumps
from poise.envs.terrain.terrain import Surface
from tests.support.physics import random_state
from tests.support.sensing import drawn_of
from tests.support.shared import robot

DERIVED = ("body_subtreemass", "dof_M0", "dof_invweight0", "body_invweight0")


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant(robot())


def test_masses_and_their_centres(plant):
    """Factors of each body; shift and payload of the pushed one; the other rooms see the sum."""
    drawn = drawn_of({"body": {"mass": 0.1, "payload": 0.2, "com": 0.05, "scale": 0.1}}, 2)
    plant.become(drawn)
    model, nominal = plant.simulation.model, robot().model
    loaded = nominal.body(push_bodies(robot())[0]).id
    masses = nominal.body_mass * drawn.mass_factor
    np.testing.assert_allclose(
        model.body_inertia, nominal.body_inertia * drawn.mass_factor[:, None]
    )
    masses[loaded] += 0.2 * robot().mass
    np.testing.assert_allclose(model.body_mass, masses)
    moved = model.body_ipos - nominal.body_ipos
    assert np.linalg.norm(moved[loaded]) == pytest.approx(0.05)
    assert not np.any(np.delete(moved, loaded, axis=0))
    assert 0.98 < np.delete(drawn.mass_factor, 0).mean() < 1.22 and np.ptp(drawn.mass_factor) > 0.1
    state = plant.simulation.reset(*random_state(robot(), np.random.default_rng(0)))
    data = plant.simulation.data
    com = masses @ data.xipos / masses.sum()
    np.testing.assert_allclose(state.com, com, atol=1e-12)
    assert state.mass == pytest.approx(masses.sum())
    mujoco.mj_subtreeVel(model, data)  # its momentum, over its mass
    np.testing.assert_allclose(state.com_vel, data.subtree_linvel[robot().root_body_id], atol=1e-12)


def test_joints_and_ground(plant):
    """Coulomb friction over the motor's limit; the ground's friction; contacts no harder."""
    drawn = drawn_of(
        {"motors": {"friction": [0.01, 0.05]}, "ground": {"friction": 0.4, "softness": 0.05}}
    )
    plant.become(drawn)
    model, nominal, dofs = plant.simulation.model, robot().model, robot().motor_dofs
    added = model.dof_frictionloss - nominal.dof_frictionloss
    np.testing.assert_allclose(added[dofs], drawn.joint_friction[dofs - 6] * robot().torque_limit)
    assert not np.any(added[:6]) and np.ptp(drawn.joint_friction) > 0.02
    assert np.all(model.geom_friction[:, 0] == 0.4) and np.all(model.pair_friction[:, :2] == 0.4)
    assert np.array_equal(model.geom_friction[:, 1:], nominal.geom_friction[:, 1:])
    assert np.all(model.geom_solref[:, 0] == 0.05)
    plant.become(drawn_of({"ground": {"softness": 0.001}}))
    assert np.array_equal(model.geom_solref, nominal.geom_solref)


def test_a_slope_tilts_gravity(plant):
    """To where the ground falls, by its angle, as strong as ever."""
    drawn = drawn_of({"ground": {"slope": 10.0}})
    plant.become(drawn)
    g = plant.simulation.model.opt.gravity
    assert np.linalg.norm(g) == pytest.approx(9.81)
    np.testing.assert_allclose(-g[:2] / g[2], drawn.slope, atol=1e-12)
    assert np.degrees(np.arccos(-g[2] / 9.81)) == pytest.approx(10.0)


def test_nothing_is_left_of_the_robot_before(plant):
    """A model that has been another one is the one that a new plant makes, and moves alike."""
    plant.become(drawn_of("field", 1))
    fresh = Plant(robot())
    for each in (plant, fresh):
        each.become(drawn_of("lab", 2))
    for name in (*CHANGED, *DERIVED):
        one, other = getattr(plant.simulation.model, name), getattr(fresh.simulation.model, name)
        assert np.array_equal(one, other), name
    ends = []
    for each in (plant, fresh):
        each.simulation.reset()
        ends.append(each.simulation.step(np.zeros(robot().model.nu), 50).qpos.copy())
    assert np.array_equal(*ends)


def test_the_known_robot_stays_as_it_is(plant):
    """The model that environments share is not the plant's."""
    plant.become(drawn_of("field", 1))
    model, fresh = robot().model, mujoco.MjModel
    assert isinstance(model, fresh) and model is not plant.simulation.model
    assert Simulation(robot()).arrays.mass == pytest.approx(model.body_mass.sum())
    assert plant.simulation.arrays.mass != pytest.approx(robot().mass, rel=1e-3)


@pytest.fixture(scope="module")
def bumpy() -> Plant:
    return Plant(robot(), bumpy=True)


def heights(plant: Plant) -> np.ndarray:
    """Of what is built, as a ray from above meets it in the middle of each bump [m]."""
    simulation, down, hit = plant.simulation, np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    mujoco.mj_kinematics(simulation.model, simulation.data)
    found = []
    for x, y in (
        (0.5 * (s["x_min"] + s["x_max"]), 0.5 * (s["y_min"] + s["y_max"]))
        for s in simulation.arrays.surfaces[1:]
    ):
        origin = np.array([x, y, 0.2])
        way = mujoco.mj_ray(simulation.model, simulation.data, origin, down, None, 1, -1, hit)
        found.append(0.2 - way)
    return np.array(found)


def test_bumps_are_as_high_as_drawn_and_half_of_them_are_there(bumpy):
    """What is built is what compiled code takes for the ground; the start is clear."""
    for seed in (1, 2):
        drawn = drawn_of({"ground": {"bumps": [0.01, 0.03]}}, seed)
        bumpy.become(drawn)
        bumpy.simulation.reset()
        found, surfaces = heights(bumpy), bumpy.simulation.arrays.surfaces
        x_min, x_max, y_min, y_max, height = (surfaces[name][1:] for name in Surface._fields[:5])
        middles = 0.5 * np.stack([x_min + x_max, y_min + y_max], axis=1)
        believed = [ground_height(surfaces, 0.0, x, y) for x, y in middles]
        np.testing.assert_allclose(found, believed, atol=1e-9)
        assert 0.9 * drawn.bumps < found.max() <= drawn.bumps
        assert 0.3 < np.mean(height > 0.0) < 0.7
        model = bumpy.simulation.model  # those that are not there share no plane with the floor
        tops = np.array([model.geom(f"terrain_{i}").pos[2] + model.geom(f"terrain_{i}").size[2]
                         for i in range(1, len(surfaces))])  # fmt: skip
        np.testing.assert_allclose(tops, np.where(height > 0, height, -0.05))
        edges = np.abs([x_min, x_max, y_min, y_max])
        assert np.all(edges.max(axis=0) > 0.1)
        assert np.all(np.hypot(*middles.T) > 0.3)
    before = surfaces["height"][1:].copy()
    bumpy.become(drawn_of({"ground": {"bumps": [0.01, 0.03]}}, 1))
    assert not np.array_equal(surfaces["height"][1:], before)


def test_a_foot_stands_on_a_bump(bumpy):
    """Its sole is held up by the bump's height, wherever it was let down from."""
    bumpy.become(drawn_of({"ground": {"bumps": 0.02}}, 5))
    simulation = bumpy.simulation
    surfaces = simulation.arrays.surfaces
    highest = Surface(*surfaces[np.argmax(surfaces["height"])].tolist())
    qpos = robot().standing_qpos.copy()
    foot = simulation.reset(qpos).arrays.sole_point[0]
    middle = [highest.x_min + highest.x_max, highest.y_min + highest.y_max]
    qpos[:2] += 0.5 * np.array(middle) - foot[:2]
    qpos[2] += highest.height
    state = simulation.reset(qpos)
    assert state.contacts[0] == 1.0
    assert state.ground[0] == pytest.approx(highest.height)


def test_bumps_need_level_ground():
    with pytest.raises(ConfigError, match="realism: ground.bumps: only on level ground"):
        Plant(on_terrain(robot(), Bumps()), bumpy=True)


def test_a_load_is_in_the_hand_that_was_drawn():
    """In the hand that was drawn alone; it weighs on the root, and pulls to its side."""
    sides, moments = set(), {}
    for seed in range(8):
        plant = Plant(robot())
        drawn = drawn_of({"body": {"hand": 0.05}}, seed)
        plant.become(drawn)
        hand = find_arms(robot())[drawn.side].hand
        added = plant.simulation.model.body_mass - robot().model.body_mass
        assert added[hand] == pytest.approx(0.05 * robot().mass) and np.count_nonzero(added) == 1
        if drawn.side in sides:
            continue
        sides.add(drawn.side)
        simulation = plant.simulation
        model, data = simulation.model, simulation.data
        data.qpos[:] = robot().standing_qpos
        data.qvel[:] = 0.0
        mujoco.mj_inverse(model, data)  # at rest: the force that must come from outside
        bare = mujoco.MjData(robot().model)
        bare.qpos[:] = robot().standing_qpos
        mujoco.mj_inverse(robot().model, bare)
        more = data.qfrc_bias[:6] - bare.qfrc_bias[:6]
        np.testing.assert_allclose(more[2], 0.05 * robot().units.force, rtol=1e-9)
        moments[drawn.side] = more[3]
    assert sides == {0, 1} and moments[0] > 0.1 and moments[1] == pytest.approx(-moments[0])


def test_the_ground_bears_the_load_of_a_hand():
    """Standing by servos for 2 s: the soles' force is the weight of robot and load."""
    env = PositionBalanceEnv(robot(), realism={"body": {"hand": 0.05}}, pushes=None)
    env.reset(seed=1, options={"noise": 0.0})
    for _ in range(100):
        env.step_without_info(np.zeros(len(env.action_names)))
    force = env.data.qfrc_constraint[2]
    assert force == pytest.approx(1.05 * robot().units.force, rel=0.01)
