"""baselines/walking/smoothing.py: targets of a robot that stands calmly are a low-pass."""

import numpy as np
import pytest

from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.walking.calibration import Calibration
from poise.baselines.walking.evasion import FELT
from poise.baselines.walking.smoothing import Smoothing, aim_smoothly
from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.balance.servos import ServoConfig, aim, make_servos
from tests.support.shared import generic_state, robot

OMEGA, LEAST = 3.5, 0.4


def law(size: float, command: tuple[float, ...] = (0.0, 0.0, 0.0)) -> Smoothing:
    """A state that turns at `size` of the threshold, at a generic angle."""
    state = generic_state(seed=1).state_arrays
    state.qvel[3:5] = size * FELT * OMEGA * np.array([np.cos(2.0), np.sin(2.0)])
    return Smoothing(state, np.array([*command, 0.0, 0.0, 0.0, 0.0, 0.0]), LEAST, OMEGA)


@pytest.mark.parametrize(
    ("size", "part"), [(0.0, LEAST), (0.3, LEAST), (0.7, 0.7), (1.0, 1.0), (3.0, 1.0)]
)
def test_the_share_of_a_new_target_grows_with_the_rate(size: float, part: float) -> None:
    servos, other = (make_servos(robot(), ServoConfig()) for _ in range(2))
    rng = np.random.default_rng(0)
    first, second = rng.uniform(-1.0, 1.0, (2, len(servos.target)))
    aim(servos, first)
    before = servos.target.copy()
    aim_smoothly(law(size), servos, second)
    aim(other, second)
    np.testing.assert_allclose(servos.target, before + part * (other.target - before), atol=1e-12)


@pytest.mark.parametrize("command", [(0.3, 0.0, 0.0), (0.0, -0.1, 0.0), (0.0, 0.0, 0.2)])
def test_who_walks_is_asked_for_all_of_it(command: tuple[float, ...]) -> None:
    """To the last bit."""
    servos, other = (make_servos(robot(), ServoConfig()) for _ in range(2))
    action = np.linspace(-1.0, 1.0, len(servos.target))
    aim_smoothly(law(0.0, command), servos, action)
    aim(other, action)
    np.testing.assert_array_equal(servos.target, other.target)


def torques(smoothing: float, command: float = 0.0) -> np.ndarray:
    """Of some steps by random actions, after another episode."""
    env = VelocityEnv(robot(), calibration=Calibration(smoothing=smoothing), pushes=None)
    told = {"command": {"ahead": command}}
    rng, found = np.random.default_rng(4), []
    env.reset(seed=1, options=told)
    env.step(env.action_space.sample())
    env.reset(seed=1, options=told)
    for _ in range(8):
        env.step(rng.uniform(-0.05, 0.05, env.action_space.shape).astype(np.float32))
        found.append(env.simulation.data.ctrl.copy())
    return np.array(found)


def test_a_standing_robot_s_torques_vary_less() -> None:
    """And those of one that is to walk are as they were."""
    plain, smooth = torques(1.0), torques(LEAST)
    assert np.abs(np.diff(smooth, axis=0)).mean() < 0.7 * np.abs(np.diff(plain, axis=0)).mean()
    np.testing.assert_array_equal(torques(1.0, 0.3), torques(LEAST, 0.3))


def test_nothing_of_the_last_episode_is_left() -> None:
    env = VelocityEnv(robot(), calibration=Calibration(smoothing=LEAST), pushes=None)
    env.reset(seed=1)
    ends = []
    for _ in range(2):
        env.reset(seed=2)
        env.step(0.05 * np.ones(env.action_space.shape, np.float32))
        ends.append(env.simulation.data.qpos.copy())
        env.step(-np.ones(env.action_space.shape, np.float32))
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize("least", [0.0, 1.5])
def test_a_share_is_within_its_range(least: float) -> None:
    with pytest.raises(ConfigError, match="smoothing"):
        build(Calibration, {"smoothing": least}, "own.yaml")
