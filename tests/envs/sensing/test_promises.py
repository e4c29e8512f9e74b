"""envs/sensing/promises.py: a state led on by promised accelerations."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.promises import Promises, keep_promises, predict, turn_axes
from tests.support.physics import random_state
from tests.support.sensing import estimated, start
from tests.support.shared import robot

LATE = {"latency": {"sense": 0.02, "command": 0.01}}  # 10 steps and 5


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-7, 1e-5, 0.3, 3.0])
def test_axes_turn_about_themselves(angle):
    """R exp(skew φ), of any angle."""
    rng = np.random.default_rng(1)
    R = Rotation.random(random_state=1)
    axis = rng.normal(size=3)
    phi = angle * axis / np.linalg.norm(axis)
    turned = R.as_matrix().copy()
    turn_axes(turned, *phi)
    np.testing.assert_allclose(turned, (R * Rotation.from_rotvec(phi)).as_matrix(), atol=1e-14)


def test_a_prediction_is_mujocos_integration():
    """Of the promised rows, as late as `earlier` says; none before the first and after the last."""
    model, rng = robot().model, np.random.default_rng(2)
    promises, dt, earlier = Promises.allocate({"n": 16, "nv": model.nv}), 0.002, 3
    rows = rng.normal(0.0, 20.0, (20, model.nv))
    for now, row in enumerate(rows, 1):
        promises.last[:] = row
        keep_promises(promises, now)
    assert np.array_equal(promises.rows[19 % 16], rows[19]) and promises.written == 20
    for first, count in ((8, 12), (14, 14)):  # the latter longer than what is promised
        qpos, v = random_state(robot(), rng)
        position, q, velocity = qpos[:3].copy(), qpos[7:].copy(), v.copy()
        R = Rotation.from_quat(qpos[[4, 5, 6, 3]]).as_matrix()
        predict(promises, first, count, earlier, dt, position, R, q, velocity)
        for x in range(first, first + count):
            if x - earlier < len(rows):
                v += dt * rows[x - earlier]
            mujoco.mj_integratePos(model, qpos, v, dt)
        np.testing.assert_allclose(velocity, v, atol=1e-12)
        np.testing.assert_allclose(np.r_[position, q], np.r_[qpos[:3], qpos[7:]], atol=1e-12)
        expected = Rotation.from_quat(qpos[[4, 5, 6, 3]]).as_matrix()
        np.testing.assert_allclose(R, expected, atol=1e-12)


def test_steps_before_the_first_promise_have_none():
    """A row counts once it is written; what was written is not changed by the next promise."""
    promises = Promises.allocate({"n": 8, "nv": robot().model.nv})
    keep_promises(promises, 0)
    assert promises.written == 0
    promises.last[:] = 1.0
    keep_promises(promises, 3)
    promises.last[:] = 2.0
    keep_promises(promises, 4)
    assert np.array_equal(promises.rows[:5, 0], [1.0, 1.0, 1.0, 2.0, 0.0])
    v = np.zeros(robot().model.nv)
    args = np.zeros(3), np.eye(3), np.zeros(len(v) - 6), v
    predict(promises, 0, 2, 2, 0.1, *args)
    assert not np.any(v)
    predict(promises, 2, 2, 2, 0.1, *args)
    np.testing.assert_allclose(v, 0.2)


@pytest.fixture(scope="module")
def source() -> EstimatedState:
    return estimated(LATE)


def played(source: EstimatedState, promises: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of a robot in the air whose motors are driven: the true ones, or
    those that are believed with promises for each step."""
    rng = np.random.default_rng(4)
    start(source, LATE, 0, *random_state(robot(), rng))
    torques = 0.1 * robot().torque_limit * rng.uniform(-1.0, 1.0, (40, robot().model.nu))
    state, seen = source.simulation.state if promises is None else source.state, []
    for k, torque in enumerate(torques):
        if promises is not None:
            source.promise[:] = promises[k]
        source.simulation.step(torque)
        source.update()
        seen.append((state.qpos.copy(), state.qvel.copy()))
    positions, velocities = zip(*seen, strict=True)
    return np.array(positions), np.array(velocities)


def test_kept_promises_undo_all_delays(source):
    """15 steps late, and with the accelerations that came of each torque the state is the true one
    of when the next torque acts: from the first step on, 5 steps ahead."""
    command = 5
    qpos, qvel = played(source, None)
    accel = np.diff(qvel, axis=0) / 0.002
    promises = np.zeros((len(qvel), qvel.shape[1]))
    promises[: len(accel) + 1 - command] = accel[command - 1 :]  # row k acts in step k + 5
    believed, velocity = played(source, promises)
    # the first 5 steps follow what was asked for before the start, which nobody has promised
    first, last = command + 10, len(qpos) - command
    np.testing.assert_allclose(velocity[first:last], qvel[first + command :], atol=1e-9)
    np.testing.assert_allclose(believed[first:last], qpos[first + command :], atol=1e-9)


def test_a_constant_acceleration_is_led_on_exactly():
    """A robot without springs that falls freely is where the promise of g has it, 10 steps late;
    from the start on, when less is late."""
    level = {"latency": {"sense": 0.02}}
    source = estimated(level)
    source.simulation.model.jnt_stiffness[:] = 0.0
    qpos = robot().standing_qpos.copy()
    qpos[2] += 5.0
    qvel = np.zeros(robot().model.nv)
    qvel[0] = 1.0
    start(source, level, 0, qpos, qvel)
    source.promise[2] = -9.81
    for _ in range(20):
        source.simulation.step(np.zeros(robot().model.nu))
        source.update()
        true, believed = source.simulation.state, source.state
        np.testing.assert_allclose(believed.qpos, true.qpos, atol=1e-9)
        np.testing.assert_allclose(believed.qvel, true.qvel, atol=1e-9)
