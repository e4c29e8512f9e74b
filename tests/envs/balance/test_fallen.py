"""Postures on the ground, and episodes that go on after a fall: envs/balance/fallen.py."""

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.balance import fallen
from poise.envs.balance.fallen import fallen_posture
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot

GOES_ON = {"terminates": False}


@pytest.mark.parametrize("name", ["humanoid", "toddler"])
def test_a_fallen_robot_lies_at_rest_on_the_ground(name):
    """Low, within its joints' ranges, above the ground, slow without motors; every number another
    posture, and some on the belly, some on the back."""
    robot = load_robot(name)
    simulation, ups = Simulation(robot), []
    for number in range(12):
        qpos = fallen_posture(robot, number)
        state = simulation.reset(qpos)
        ups.append(state.root_axes[0] @ [0.0, 0.0, 1.0])
        assert state.com[2] < 0.55 * robot.height_com
        low, high = robot.joint_range.T
        assert np.all(qpos[7:] > low - 0.1) and np.all(qpos[7:] < high + 0.1)
        assert simulation.data.contact.dist[: simulation.data.ncon].min() > -0.02
        before = state.com.copy()
        for _ in range(20):
            simulation.step(np.zeros(robot.model.nu))
        assert np.linalg.norm(simulation.state.com - before) < 0.05
    assert min(ups) < -0.5 and max(ups) > 0.5
    assert len({round(up, 6) for up in ups}) == 12


def test_a_posture_depends_on_its_number_alone():
    """The same bits in any order, and a caller cannot change what the next one gets."""
    robot = load_robot()
    first = fallen_posture(robot, 3)
    fallen_posture(robot, 4)[:] = 0.0
    fallen._settled.cache_clear()
    other = fallen_posture(robot, 4)
    np.testing.assert_array_equal(fallen_posture(robot, 3), first)
    assert np.linalg.norm(other[3:7]) == pytest.approx(1.0)


def test_an_episode_begins_on_the_ground():
    """By the option of a reset, by a fraction of the episodes, never without either."""
    env = PositionBalanceEnv(pushes=None, fall=GOES_ON)
    env.reset(seed=0)
    assert not env.fallen and env.simulation.state.com[2] > 0.9 * env.robot.height_com
    env.reset(seed=0, options={"fallen": 7})
    np.testing.assert_array_equal(env.simulation.data.qpos[7:], fallen_posture(env.robot, 7)[7:])
    assert not env.simulation.data.qvel.any()
    env = PositionBalanceEnv(pushes=None, fall=GOES_ON, fallen=0.5)
    low = 0
    for seed in range(20):
        env.reset(seed=seed)
        low += env.simulation.state.com[2] < 0.6 * env.robot.height_com
    assert 3 < low < 17


@pytest.mark.parametrize("value", [-1, 1.5, "back", True])
def test_a_posture_is_a_whole_number(value):
    env = PositionBalanceEnv()
    with pytest.raises(ConfigError, match="fallen"):
        env.reset(options={"fallen": value})


def test_a_fall_may_be_no_end():
    """Pushed over without torques: it is fallen, goes on to the end of time, and is truncated."""
    env = TorqueBalanceEnv(duration=3.0, fall=GOES_ON, reward={"rise": 1.0})
    push = {"impulse": 60.0, "start": 0.0, "body": "torso"}
    env.reset(seed=0, options={"push": push})
    ended, was_down = False, []
    while not ended:
        _, _, terminated, ended, info = env.step(np.zeros(env.action_space.shape))
        assert not terminated
        was_down.append(env.fallen)
    assert env.simulation.time == pytest.approx(3.0) and env.fallen and not info["is_success"]
    assert not was_down[0] and info["reward_terms"]["alive"] == 0.0
    assert 0.0 < info["reward_terms"]["rise"] < 0.5


def test_a_simulation_that_diverges_ends_all_the_same(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log here
    env = TorqueBalanceEnv(fall=GOES_ON)
    qvel = np.zeros(env.robot.model.nv)
    qvel[8] = 1e9
    env.reset(seed=0, options={"push": [], "qvel": qvel})
    assert env.step(np.zeros(env.action_space.shape))[2]


def test_rise_is_height_times_uprightness():
    """1 standing; (z/h)(1 + cos φ)/2 of a robot turned by φ and moved, whatever its feet do."""
    env = PositionBalanceEnv(fall=GOES_ON, pushes=None, reward={"rise": 1.0})
    env.reset(seed=0, options={"noise": 0.0})
    standing = env.step(np.zeros(env.action_space.shape))[4]["reward_terms"]["rise"]
    assert standing == pytest.approx(1.0, abs=1e-3)
    qpos, angle = env.robot.standing_qpos.copy(), 2.0
    qpos[2] = 0.5
    qpos[3:7] = [np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0]
    env.reset(seed=0, options={"qpos": qpos})
    got = env.step(np.zeros(env.action_space.shape))[4]["reward_terms"]["rise"]
    state, arrays = env.simulation.state, env.simulation.arrays
    cosine = state.root_axes[2] @ arrays.root_standing[2]
    assert got == pytest.approx(state.com[2] / env.robot.height_com * (1.0 + cosine) / 2.0)
    assert got < 0.4
