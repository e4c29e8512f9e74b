"""envs/sensing/measurement.py: readings against the motion that they are of."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.envs.compiled.calls import run
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.measurement import DRIFT_TIME, RING, levelling, rotation
from tests.support.physics import random_state
from tests.support.sensing import PLAIN, estimated, remeasured, start
from tests.support.shared import robot

DT, G = 0.002, 9.81
SIGMAS = 5.0  # a mean is off by more once in two million seeds


@pytest.fixture(scope="module")
def source() -> EstimatedState:
    return estimated(PLAIN)


def flight(source: EstimatedState, level: dict) -> list[dict[str, np.ndarray]]:
    """Pose and readings after each of some steps of a robot that turns, moves and is driven."""
    rng = np.random.default_rng(3)
    start(source, level, 1, *random_state(robot(), rng))
    rings, data, seen = source.sensors.rings, source.simulation.data, []
    for _ in range(6):
        source.simulation.step(0.3 * robot().torque_limit * rng.uniform(-1, 1, robot().model.nu))
        row = rings.next - 1
        pose = {"p": data.qpos[:3].copy(), "R": Rotation.from_quat(data.qpos[[4, 5, 6, 3]])}
        seen.append(
            pose | {n: getattr(rings, n)[row].copy() for n in ("gyro", "force", "attitude")}
        )
        seen[-1] |= {
            "q": data.qpos[7:].copy(),
            "dq": rings.dq[row].copy(),
            "read": rings.q[row].copy(),
        }
    return seen


@pytest.mark.parametrize("slope", [0.0, 12.0])
def test_the_imu_reads_the_motion_of_the_root(source, slope):
    """Turns and second differences of the true pose, on a slope seen with gravity as z."""
    seen = flight(source, {"ground": {"slope": slope}, "motors": {"lag": 0.001}})
    gravity = source.simulation.model.opt.gravity
    L = levelling(gravity)
    np.testing.assert_allclose(L @ gravity, [0.0, 0.0, -G], atol=1e-12)
    assert np.degrees(np.arccos(L[2, 2])) == pytest.approx(slope, abs=1e-6)
    for before, last, now in zip(seen, seen[1:], seen[2:], strict=False):
        turned = (last["R"].inv() * now["R"]).as_rotvec() / DT
        np.testing.assert_allclose(now["gyro"], turned, atol=1e-6)
        accel = (now["p"] - 2.0 * last["p"] + before["p"]) / DT**2
        R = now["R"].as_matrix()
        np.testing.assert_allclose(now["force"], R.T @ (accel - gravity), atol=1e-6)
        np.testing.assert_allclose(now["attitude"], L @ R, atol=1e-12)
        np.testing.assert_allclose(now["read"], now["q"], atol=1e-12)
        np.testing.assert_allclose(now["dq"], (now["q"] - last["q"]) / DT, atol=1e-6)


def test_a_tilted_mount_turns_all_that_the_imu_reads(source):
    """And biases are added in its own axes."""
    bent = {"tilt_bias": 0.05, "gyro_bias": 0.3, "accelerometer_bias": 0.5}
    plain, tilted = flight(source, PLAIN), flight(source, {"sensors": bent})
    drawn, mount = source.drawn, rotation(source.drawn.tilt_bias)
    angle = Rotation.from_matrix(mount).as_rotvec()
    np.testing.assert_allclose(angle, drawn.tilt_bias, atol=1e-12)
    for one, other in zip(plain, tilted, strict=True):
        np.testing.assert_allclose(other["attitude"], one["attitude"] @ mount, atol=1e-9)
        np.testing.assert_allclose(
            other["gyro"], mount.T @ one["gyro"] + drawn.gyro_bias, atol=1e-9
        )
        force = mount.T @ one["force"] + drawn.accelerometer_bias
        np.testing.assert_allclose(other["force"], force, atol=1e-6)


def test_noise_has_its_deviation(source):
    """Of a robot that rests: mean and variance of what is read over what is."""
    sensors = {"encoder_noise": 0.002, "velocity_noise": 0.1, "gyro_noise": 0.03,
               "accelerometer_noise": 0.2, "encoder_bias": 0.01}  # fmt: skip
    drawn = start(source, {"sensors": sensors})
    n, names = 2000, {"q": "encoder", "dq": "velocity", "gyro": "gyro", "force": "accelerometer"}
    for name, field in names.items():
        read, deviation = remeasured(source, name, n), sensors[f"{field}_noise"]
        true = {"q": source.simulation.state.q + drawn.encoder_bias, "force": np.array([0, 0, G])}
        z = (read - true.get(name, 0.0)) / deviation
        assert abs(z.mean(axis=0)).max() < SIGMAS / np.sqrt(n), name
        assert abs((z**2).mean(axis=0) - 1.0).max() < SIGMAS * np.sqrt(2.0 / n), name


def test_soles_read_the_grounds_wrench(source):
    """In root axes, about the root; force over the weight, CoP over the force; found as it is."""
    start(source, {"sensors": {"force_noise": 0.02, "cop_noise": 0.01}})
    for _ in range(20):
        source.simulation.step(np.zeros(robot().model.nu))
    f, n = source.simulation.data.qfrc_constraint, 4000
    R = Rotation.from_quat(source.simulation.data.qpos[[4, 5, 6, 3]]).as_matrix()
    read = remeasured(source, "wrench", n) - np.concatenate([R.T @ f[:3], f[3:6]])
    weight = source.simulation.arrays.mass * G
    deviation = np.array([*(3 * [0.02 * weight]), *(2 * [0.01 * f[2]])])
    z = read[:, :5] / deviation
    assert abs(z.mean(axis=0)).max() < SIGMAS / np.sqrt(n)
    assert abs((z**2).mean(axis=0) - 1.0).max() < SIGMAS * np.sqrt(2.0 / n)
    assert not np.any(read[:, 5]) and f[2] > 0.3 * weight
    adr = [*source.simulation.arrays.sole_sensor, source.simulation.arrays.ground_sensor]
    assert np.array_equal(source.sensors.rings.found[0], source.simulation.data.sensordata[adr])


def test_the_attitude_drifts(source):
    """Small turns about the level axes, of the deviation; e⁻¹ of one is left after DRIFT_TIME.

    An average over N correlation times of a square is off by √(2/N): 3 axes, 200 s.
    """
    start(source, {"sensors": {"tilt_drift": 0.01}})
    R, n = source.simulation.state.root_axes, 100_000
    attitude = remeasured(source, "attitude", n)
    turn = attitude @ R.T - np.eye(3)
    drift = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    np.testing.assert_allclose(turn, -turn.transpose(0, 2, 1), atol=1e-12)
    bound = SIGMAS * np.sqrt(2.0 / (3 * n * DT / DRIFT_TIME))
    assert (drift**2).mean() == pytest.approx(1e-4, rel=bound)
    lag = round(DRIFT_TIME / DT)
    assert (drift[lag:] * drift[:-lag]).mean() / 1e-4 == pytest.approx(np.exp(-1.0), abs=bound)


def test_backlash_is_a_play(source):
    """The reading follows the joint at half the play: y ← min(max(y, q − half), q + half)."""
    width = 0.04
    start(source, {"motors": {"backlash": width}})
    views, home = source.simulation.views, source.simulation.state.q.copy()
    y, was, read = home.copy(), home, []
    for t in np.linspace(0.0, 6.0, 300):
        q = home + 0.05 * t * np.sin(2.0 * t) * np.linspace(0.2, 1.0, len(home))
        views.qpos[7:] = q
        run(source.sense)
        y = np.minimum(np.maximum(y, q - 0.5 * width), q + 0.5 * width)
        np.testing.assert_allclose(source.bus.q, y, atol=1e-12)
        assert (abs(y - q) <= 0.5 * width + 1e-12).all()
        read.append(np.array_equal(y, was))
        was = y
    assert any(read[1:]) and not all(read)  # at a turn of its direction the reading rests


def test_what_was_before_an_episode_is_its_start(source):
    """All rows are full, one measurement is counted; another seed of noise reads otherwise."""
    start(source, {"sensors": {"encoder_noise": 0.001}}, 1)
    rings = source.sensors.rings
    assert rings.count == 1 and rings.next == 0 and len(rings.q) == RING
    assert np.array_equal(rings.truth_qpos, np.tile(source.simulation.data.qpos, (RING, 1)))
    first = rings.q.copy()
    start(source, {"sensors": {"encoder_noise": 0.001}}, 1)
    assert np.array_equal(rings.q, first)
    start(source, {"sensors": {"encoder_noise": 0.001}}, 2)
    assert not np.array_equal(rings.q, first)
