"""envs/sensors/delayed.py and baselines/environments/sensed.py."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.sensed import SensedTorqueEnv, sensed_env
from poise.configs.errors import ConfigError
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.variants import altered_robot
from poise.envs.sensors.delayed import SensedSimulation
from tests.support.shared import robot

PUSH = {"impulse": 8.0, "direction": 30.0, "start": 0.05}
SEEN = ("qpos", "qvel", "com", "com_vel", "cop", "capture_point", "contact_wrench", "M", "h", "A")


def test_without_delay_and_error_the_truth_is_believed() -> None:
    """Positions to the last bit; what follows from them, and the measured forces, too."""
    sensed, plain = SensedSimulation(robot(), robot()), Simulation(robot())
    torques = 0.1 * robot().torque_limit
    for _ in range(5):
        sensed.step(torques, 2)
        plain.step(torques, 2)
    assert np.array_equal(sensed.state.qpos, plain.state.qpos)
    believed = sensed.believe().state
    for name in SEEN:
        assert getattr(believed, name) == pytest.approx(getattr(plain.state, name), abs=1e-9), name
    assert believed.time == plain.time


def test_sensors_are_late_by_the_delay() -> None:
    """After n steps the state of n − 3 is believed, and the start until then."""
    late, plain = SensedSimulation(robot(), robot(), 0.006), Simulation(robot())
    torques, seen = 0.2 * robot().torque_limit, [plain.state.copy()]
    for step in range(1, 8):
        late.step(torques)
        seen.append(plain.step(torques).copy())
        then, believed = seen[max(step - 3, 0)], late.believe().state
        assert np.array_equal(believed.qpos, then.qpos) and np.array_equal(believed.cop, then.cop)
        assert np.array_equal(believed.contacts, then.contacts)
    late.reset()
    assert np.array_equal(late.believe().state.qpos, seen[0].qpos)


def test_the_known_robot_is_believed() -> None:
    """Masses are those the controller knows; the forces are those of the true robot."""
    heavy = altered_robot(robot(), mass_error=0.1)
    sensed = SensedSimulation(heavy, robot())
    for _ in range(50):
        sensed.step(np.zeros(robot().model.nu))
    believed = sensed.believe().state
    assert believed.mass == pytest.approx(robot().mass) and sensed.state.mass > 1.05 * believed.mass
    assert believed.M[:3, :3] == pytest.approx(robot().mass * np.eye(3), abs=1e-9)
    assert np.array_equal(believed.contact_wrench, sensed.state.contact_wrench)


def test_a_delay_is_a_number_of_steps() -> None:
    """3 ms are one and a half steps."""
    with pytest.raises(ConfigError, match="delay: 0.003 s is not a whole number of steps"):
        SensedSimulation(robot(), robot(), 0.003)


def play(env, steps: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Observations and final position of a pushed episode without action."""
    seen = [env.reset(seed=3, options={"push": PUSH})[0]]
    for _ in range(steps):
        seen.append(env.step(np.zeros(env.action_space.shape))[0])
    return np.array(seen), env.simulation.state.qpos.copy()


def test_perfect_sensors_change_nothing() -> None:
    """The same path as without sensors, of a compiled controller and of one called from Python."""
    for controller in ("momentum-qp", "pd"):
        env = ResidualBalanceEnv(robot(), controller=controller, duration=1.0, pushes=None)
        other = sensed_env(env)
        other.set_plant(robot(), 0.0)
        (seen, end), (seen_other, end_other) = play(env), play(other)
        assert seen_other == pytest.approx(seen, abs=1e-5)
        assert end_other == pytest.approx(end, abs=1e-6)


def test_the_policy_sees_late_observations() -> None:
    """With one policy step of delay every observation is that of one step before."""
    env = TorqueBalanceEnv(robot(), duration=1.0, pushes=None)
    late, prompt = sensed_env(env), sensed_env(env)
    assert isinstance(late, SensedTorqueEnv)
    late.set_plant(robot(), 0.02)
    prompt.set_plant(robot(), 0.0)
    (seen, end), (seen_late, end_late) = play(prompt, 8), play(late, 8)
    assert np.array_equal(end, end_late)  # the torques are zero, whatever is seen
    assert np.array_equal(seen_late[1:], seen[:-1]) and not np.array_equal(seen, seen_late)
    assert np.array_equal(play(env, 8)[1], end)


def test_a_late_controller_acts_on_what_it_sees() -> None:
    """Before the delay has passed the push is unknown; then it is answered, too late."""
    env = ResidualBalanceEnv(robot(), controller="pd", duration=1.0, pushes=None)
    other = sensed_env(env)
    other.set_plant(robot(), 0.02)
    assert not np.allclose(play(env)[1], play(other)[1], atol=1e-6)
    other.set_plant(altered_robot(robot(), mass_error=0.1), 0.0)
    assert not np.allclose(play(env)[1], play(other)[1], atol=1e-6)
