"""envs/sensing/motors.py: what comes of the torques that are asked for."""

import numpy as np
import pytest

from poise.envs.compiled.calls import run
from poise.envs.physics.motor_bus import ask_servo
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.motors import fraction_at
from tests.support.sensing import PLAIN, estimated, start
from tests.support.shared import robot


@pytest.fixture(scope="module")
def source() -> EstimatedState:
    return estimated(PLAIN)


def asked(source: EstimatedState, torque: np.ndarray) -> np.ndarray:
    """The torques that act in a step with these controls, and that the model applies."""
    source.simulation.step(torque)
    data, dofs = source.simulation.data, robot().motor_dofs
    acting = data.qfrc_actuator[dofs] + data.qfrc_applied[dofs]
    assert np.array_equal(data.ctrl, torque)
    np.testing.assert_allclose(acting, source.motors.torque, atol=1e-12)
    return source.motors.torque.copy()


def test_torques_are_late_by_whole_steps(source):
    """5 ms are two steps and a half; to even, two. Before, the motors held what they were asked."""
    start(source, {"latency": {"command": 0.006}})
    rng = np.random.default_rng(0)
    torques = 0.2 * robot().torque_limit * rng.uniform(-1.0, 1.0, (8, robot().model.nu))
    acted = [asked(source, torque) for torque in torques]
    np.testing.assert_allclose(acted[3:], torques[:-3], rtol=1e-12)
    assert not np.any(acted[:3])
    start(source, {"latency": {"command": 0.005}})
    assert source.motors.late == 2


def test_a_lag_is_of_first_order(source):
    """After n steps gain · u (1 − exp(−n dt/T)), of each motor's own gain."""
    drawn = start(source, {"motors": {"lag": 0.01, "gain_error": 0.2}}, 5)
    torque = 0.1 * robot().torque_limit
    assert np.ptp(drawn.gain) > 0.1
    for n in range(1, 12):
        expected = drawn.gain * torque * (1.0 - np.exp(-n * 0.002 / 0.01))
        np.testing.assert_allclose(asked(source, torque), expected, rtol=1e-12)


def test_a_fast_motor_has_less_torque():
    """All of it up to half of the no-load speed, none from there on, all of it for braking."""
    assert [fraction_at(v, 1.0, 10.0) for v in (0.0, 5.0, 7.5, 10.0, 20.0)] == [1, 1, 0.5, 0, 0]
    assert fraction_at(-7.5, -1.0, 10.0) == 0.5
    assert fraction_at(7.5, -1.0, 10.0) == fraction_at(7.5, 1.0, 0.0) == 1.0


def test_torques_are_limited_by_the_joints_speed(source):
    start(source, {"motors": {"no_load_speed": 4.0}})
    limit, views = robot().torque_limit, source.simulation.views
    views.qvel[robot().motor_dofs] = 3.0
    for sign, part in ((1.0, 0.5), (-1.0, 1.0)):
        views.ctrl[:] = sign * limit
        run(source.drive)
        np.testing.assert_allclose(source.motors.torque, sign * part * limit, rtol=1e-12)


def test_motors_begin_with_what_held_the_robot(source):
    """Times their gains, until the first torques arrive."""
    drawn = start(source, {"latency": {"command": 0.004}, "motors": {"gain_error": 0.1}})
    holding = 0.1 * robot().torque_limit
    source.begin(drawn, holding)
    for _ in range(2):
        np.testing.assert_allclose(asked(source, 0.0 * holding), drawn.gain * holding)
    assert not np.any(asked(source, 0.0 * holding))


def test_servos_run_in_the_motors(source):
    """Targets are late, the motor's own encoder is not, and errs by its bias."""
    drawn = start(source, {"latency": {"command": 0.006}, "sensors": {"encoder_bias": 0.05}})
    rng, bus, state = np.random.default_rng(1), source.bus, source.simulation.state
    nu, joints, limit = robot().model.nu, robot().motor_dofs - 6, robot().torque_limit
    targets, zero = state.q[joints] + rng.uniform(-0.2, 0.2, (8, nu)), np.zeros(nu)
    for k, target in enumerate(targets):
        for i in range(nu):
            ask_servo(bus, i, 1.0, target[i], 50.0, 2.0)
        read = state.q[joints] + drawn.encoder_bias[joints]
        torque = 1.0 + 50.0 * (targets[max(k - 3, 0)] - read) - 2.0 * state.qvel[joints + 6]
        acted = asked(source, zero)
        if k >= 3:
            np.testing.assert_allclose(acted, np.clip(torque, -limit, limit), atol=1e-9)
        else:
            assert not np.any(acted)
    start(source, PLAIN)
    assert not np.any(asked(source, zero))  # nobody asks for servos any more
