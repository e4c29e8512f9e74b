"""envs/sensors: what is believed of the state, and environments that go by it."""

from __future__ import annotations

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.configs.errors import ConfigError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot
from poise.envs.robots.variants import perturbed_robot
from poise.envs.sensors.delayed import DelayedState
from poise.envs.sensors.source import StateSource
from tests.support.shared import robot

PUSH = {"impulse": 8.0, "direction": 30.0, "start": 0.05}
SEEN = ("qpos", "qvel", "com", "com_vel", "cop", "capture_point", "contact_wrench", "M", "h", "A")


def late(actual: Robot, delay: float = 0.0) -> DelayedState:
    """A source whose simulation is measured by `Simulation.step`."""
    simulation = Simulation(actual)
    source = DelayedState(simulation, robot(), delay)
    simulation.sensors = source.sense
    return source


def test_the_truth_is_believed_by_default() -> None:
    """A plain source has the simulation's own arrays and nothing to do."""
    simulation = Simulation(robot())
    source = StateSource(simulation)
    assert source.state_arrays is simulation.state_arrays and source.arrays is simulation.arrays
    assert len(source.sense.rows) == len(source.estimate.rows) == 0


def test_without_delay_and_error_the_truth_is_believed() -> None:
    """Positions to the last bit; what follows from them, and the measured forces, too."""
    source, plain = late(robot()), Simulation(robot())
    torques = 0.1 * robot().torque_limit
    for _ in range(5):
        source.simulation.step(torques, 2)
        plain.step(torques, 2)
    assert np.array_equal(source.simulation.state.qpos, plain.state.qpos)
    source.update()
    believed = source.state
    for name in SEEN:
        assert getattr(believed, name) == pytest.approx(getattr(plain.state, name), abs=1e-9), name
    assert believed.time == plain.time


def test_sensors_are_late_by_the_delay() -> None:
    """After n steps the state of n − 3 is believed, and the start until then."""
    source, plain = late(robot(), 0.006), Simulation(robot())
    torques, seen = 0.2 * robot().torque_limit, [plain.state.copy()]
    for step in range(1, 8):
        source.simulation.step(torques)
        source.update()
        seen.append(plain.step(torques).copy())
        then, believed = seen[max(step - 3, 0)], source.state
        assert np.array_equal(believed.qpos, then.qpos) and np.array_equal(believed.cop, then.cop)
        assert np.array_equal(believed.contacts, then.contacts)
    source.simulation.reset()
    source.reset()
    assert np.array_equal(source.state.qpos, seen[0].qpos)


def test_the_known_robot_is_believed() -> None:
    """Masses are those the controller knows; the forces are those of the true robot."""
    source = late(perturbed_robot(robot(), mass_error=0.1))
    for _ in range(50):
        source.simulation.step(np.zeros(robot().model.nu))
    source.update()
    believed, true = source.state, source.simulation.state
    assert believed.mass == pytest.approx(robot().mass) and true.mass > 1.05 * believed.mass
    assert believed.M[:3, :3] == pytest.approx(robot().mass * np.eye(3), abs=1e-9)
    assert np.array_equal(believed.contact_wrench, true.contact_wrench)


def test_a_delay_is_a_number_of_steps() -> None:
    """3 ms are one and a half steps, of a source as of an environment's configuration."""
    for make in (lambda: late(robot(), 0.003), lambda: TorqueBalanceEnv(sensors={"delay": 0.003})):
        with pytest.raises(ConfigError, match=r"sensors.delay: 0.003 s is not a whole number"):
            make()


def play(env: BalanceEnv, steps: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Observations and final position of a pushed episode without action."""
    seen = [env.reset(seed=3, options={"push": PUSH})[0]]
    for _ in range(steps):
        seen.append(env.step(np.zeros(env.action_space.shape))[0])
    return np.array(seen), env.simulation.state.qpos.copy()


def believing(env: BalanceEnv, actual: Robot, delay: float) -> BalanceEnv:
    """The environment with another world, which it believes to be its own robot's."""
    env.simulation = Simulation(actual)
    env.state_source = DelayedState(env.simulation, env.robot, delay)
    return env


@pytest.mark.parametrize("controller", ["momentum-qp", "pd"])
def test_perfect_sensors_change_nothing(controller: str) -> None:
    """The same path as without sensors, of a compiled controller and of one called from Python."""
    env = ResidualBalanceEnv(robot(), controller=controller, duration=1.0, pushes=None)
    seen, end = play(env)
    seen_other, end_other = play(believing(env, robot(), 0.0))
    assert seen_other == pytest.approx(seen, abs=1e-5)
    assert end_other == pytest.approx(end, abs=1e-6)


def test_the_policy_sees_late_observations() -> None:
    """With one policy step of delay every observation is that of one step before."""
    env = TorqueBalanceEnv(robot(), duration=1.0, pushes=None)
    late = TorqueBalanceEnv(robot(), duration=1.0, pushes=None, sensors={"delay": 0.02})
    (seen, end), (seen_late, end_late) = play(believing(env, robot(), 0.0), 8), play(late, 8)
    assert np.array_equal(end, end_late)  # the torques are zero, whatever is seen
    assert np.array_equal(seen_late[1:], seen[:-1]) and not np.array_equal(seen, seen_late)
    env.simulation = Simulation(robot())  # and with it the truth
    assert np.array_equal(play(env, 8)[1], end)


def test_a_late_controller_acts_on_what_it_sees() -> None:
    """Before the delay has passed the push is unknown; then it is answered, too late."""
    env = ResidualBalanceEnv(robot(), controller="pd", duration=1.0, pushes=None)
    end = play(env)[1]
    assert not np.allclose(end, play(believing(env, robot(), 0.02))[1], atol=1e-6)
    heavy = perturbed_robot(robot(), mass_error=0.1)
    assert not np.allclose(end, play(believing(env, heavy, 0.0))[1], atol=1e-6)


@pytest.mark.parametrize("kind", [TorqueBalanceEnv, ResidualBalanceEnv, ResidualStepEnv])
def test_late_environments_run_compiled(kind: type[BalanceEnv]) -> None:
    """A delay takes no step to Python, and a compiled tick sees what one from Python does."""
    env = kind(robot(), duration=1.0, pushes=None, sensors={"delay": 0.008})
    env.reset(seed=0)
    assert env.compiled_step() is not None
    if kind is TorqueBalanceEnv:
        return
    seen, end = play(env)
    env._compiled = False
    seen_python, end_python = play(env)
    np.testing.assert_allclose(seen_python, seen, atol=1e-6)
    np.testing.assert_allclose(end_python, end, atol=1e-8)


def test_a_source_is_of_the_environments_simulation() -> None:
    """Another one's is refused."""
    env = TorqueBalanceEnv(robot(), pushes=None)
    with pytest.raises(ConfigError, match="state_source: is about another simulation"):
        env.state_source = StateSource(Simulation(robot()))


def test_the_fall_is_judged_by_the_truth() -> None:
    """A limp robot falls when it does, however late that is known."""
    falls = []
    for delay in (0.0, 0.2):
        env = TorqueBalanceEnv(robot(), pushes=None, sensors={"delay": delay})
        env.reset(seed=0, options={"noise": 0.0})
        while env.episode.running[0]:
            env.step_without_info(np.zeros(env.action_space.shape))
        falls.append(env.steps)
    assert env.fallen and falls[0] == falls[1]
