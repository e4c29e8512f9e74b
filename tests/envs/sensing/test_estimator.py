"""envs/sensing/estimator.py: what is believed of a state that is late, and of which robot."""

import numpy as np
import pytest

from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state_source import StateSource
from poise.envs.sensing.estimator import EstimatedState
from tests.support.refused import invalid
from tests.support.sensing import PLAIN, drawn_of, estimated, start
from tests.support.shared import robot

SEEN = ("qpos", "qvel", "com", "com_vel", "cop", "capture_point", "contact_wrench", "M", "h", "A")


@pytest.fixture(scope="module")
def source() -> EstimatedState:
    return estimated(PLAIN)


def test_the_truth_is_believed_by_default():
    """A plain source has the simulation's own arrays and nothing to do."""
    simulation = Simulation(robot())
    plain = StateSource(simulation)
    assert plain.state_arrays is simulation.state_arrays and plain.arrays is simulation.arrays
    assert len(plain.drive.rows) == len(plain.sense.rows) == len(plain.estimate.rows) == 0


def test_without_delay_and_error_the_truth_is_believed(source):
    """Positions to the last bit; what follows from them, and the measured forces, too."""
    start(source, PLAIN)
    plain, torques = Simulation(robot()), 0.1 * robot().torque_limit
    for _ in range(5):
        source.simulation.step(torques, 2)
        plain.step(torques, 2)
    assert np.array_equal(source.simulation.state.qpos, plain.state.qpos)
    source.update()
    believed = source.state
    for name in SEEN:
        assert getattr(believed, name) == pytest.approx(getattr(plain.state, name), abs=1e-9), name
    assert believed.time == plain.time


def test_sensors_are_late_by_the_delay():
    """After n steps the state of n − 3 is believed, and the start until then."""
    source = estimated({"latency": {"sense": 0.006}}, predictor="none")
    plain, torques = Simulation(robot()), 0.2 * robot().torque_limit
    seen = [plain.state.copy()]
    for step in range(1, 8):
        source.simulation.step(torques)
        source.update()
        seen.append(plain.step(torques).copy())
        then, believed = seen[max(step - 3, 0)], source.state
        np.testing.assert_allclose(believed.qpos, then.qpos, atol=1e-12)
        np.testing.assert_allclose(believed.cop, then.cop, atol=1e-9)
        assert np.array_equal(believed.contacts, then.contacts)
    start(source, {"latency": {"sense": 0.006}})
    np.testing.assert_allclose(source.state.qpos, seen[0].qpos, atol=1e-12)


def test_the_known_robot_is_believed(source):
    """Masses are those the controller knows; the forces are those of the true robot."""
    start(source, {"body": {"scale": 0.1}})
    for _ in range(50):
        source.simulation.step(np.zeros(robot().model.nu))
    source.update()
    believed, true = source.state, source.simulation.state
    assert believed.mass == pytest.approx(robot().mass) and true.mass > 1.05 * believed.mass
    assert believed.M[:3, :3] == pytest.approx(robot().mass * np.eye(3), abs=1e-9)
    np.testing.assert_allclose(believed.contact_wrench, true.contact_wrench, atol=1e-9)


def test_sources_of_one_robot_share_its_model():
    """A hundred environments would else hold a hundred models, of 75 MB each on the G1."""
    one, other = estimated(PLAIN), estimated(PLAIN)
    assert one.known.model is other.known.model is not one.simulation.model
    assert one.simulation.model is not other.simulation.model  # each draws a robot of its own


def delays(source: EstimatedState) -> tuple[int, int, int, bool]:
    """Physics steps that are late, were asked for before, and are predicted; whether exact."""
    b = source.estimation
    return b.sense, b.earlier, b.horizon, b.exact


def test_auto_is_exact_where_no_sensor_errs():
    """And the time that is led on is what the estimator takes for the delay."""
    level = {
        "latency": {"sense": 0.01, "command": 0.004, "misjudged": 0.004},
        "motors": {"lag": 0.006},
    }
    source = estimated(level)
    assert delays(source) == (5, 7, 12, True)
    under = {"latency": {"sense": 0.01, "misjudged": -0.004}}
    assert delays(estimated(under)) == (5, 0, 3, True)
    assert not estimated("lab").estimation.exact
    assert estimated("lab", kind="exact").estimation.exact
    assert delays(estimated(level, predictor="none")) == (5, 7, 0, True)


@pytest.mark.parametrize(
    ("kind", "predictor"), [("odometry", "promised"), ("odometry", "rollout"), ("inekf", "auto")]
)
def test_an_episode_forgets_the_one_before(kind, predictor):
    """The same robot and torques give the same beliefs, whatever was estimated before."""
    source = estimated("field", 1, kind=kind, predictor=predictor)
    torques = 0.1 * robot().torque_limit
    seen = []
    for seed in (1, 2, 1):
        start(source, "field", seed)
        source.promise[:] = seed
        for _ in range(25):
            source.simulation.step(torques)
            source.update()
        seen.append(np.concatenate([source.state.qpos, source.state.qvel]))
    assert np.array_equal(seen[0], seen[2]) and not np.allclose(seen[0], seen[1])


def test_a_source_is_of_the_environments_simulation():
    """Another one's is refused."""
    env = TorqueBalanceEnv(robot(), pushes=None)
    with invalid("state_source"):
        env.state_source = StateSource(Simulation(robot()))


def test_the_drawn_robot_is_what_the_source_begins_with(source):
    drawn = drawn_of("lab", 9)
    source.plant.become(drawn)
    source.simulation.reset()
    source.begin(drawn, np.zeros(robot().model.nu))
    assert source.drawn is drawn and source.estimation.sense == drawn.sense
