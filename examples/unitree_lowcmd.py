"""A controller on Unitree's messages: LowState in, LowCmd out, in a loop of MuJoCo alone.

    python examples/unitree_lowcmd.py [CONTROLLER] [--targets]

The G1 has an inertial unit and encoders, and no sensors of force: the ground's wrench comes from
the torques of its legs. The motors do what those of the robot do at 500 Hz on their own encoders,
tau + kp (q − q_m) − kd dq_m. With `--targets` they are sent no torques, but positions. The robot is
pushed forward with 10 N·s.
"""

import sys
from dataclasses import dataclass, field

import mujoco
import numpy as np

import poise
from poise.training import Measurement, Readings

MOTORS = 29  # of the G1, in the order of its messages, which is that of Menagerie's model


@dataclass
class LowState:
    """The fields of unitree_hg's LowState_ that are read."""

    quaternion: np.ndarray  # imu_state, w first
    gyroscope: np.ndarray
    accelerometer: np.ndarray
    q: np.ndarray  # motor_state[i]
    dq: np.ndarray
    tau_est: np.ndarray


@dataclass
class LowCmd:
    """The fields of unitree_hg's LowCmd_ that are written: motor_cmd[i]."""

    tau: np.ndarray = field(default_factory=lambda: np.zeros(MOTORS))
    q: np.ndarray = field(default_factory=lambda: np.zeros(MOTORS))
    kp: np.ndarray = field(default_factory=lambda: np.zeros(MOTORS))
    kd: np.ndarray = field(default_factory=lambda: np.zeros(MOTORS))


arguments = [word for word in sys.argv[1:] if word != "--targets"]
name, by_targets = (arguments or ["momentum-qp-g1"])[0], "--targets" in sys.argv
controller = poise.load_standalone(name, robot="unitree_g1", realism="lab")
robot = controller.robot
model, data, known = robot.model, mujoco.MjData(robot.model), mujoco.MjData(robot.model)
data.qpos[:] = robot.standing_qpos
mujoco.mj_forward(model, data)
soles = [(sole, model.geom_bodyid[sole.geom_ids[0]]) for sole in robot.soles]
stiffness = np.full(MOTORS, 100.0)  # [N·m/rad] of a motor that has only a target


def ground(state: LowState) -> tuple[np.ndarray, list[bool]]:
    """The wrench on the root (6,), in its axes, and whether each sole touches: from the legs.

    A leg at rest has τ = g − Jᵀ w: six joints, and the six components of its sole's wrench w.
    """
    known.qpos[:3], known.qpos[3:7], known.qpos[7:] = 0.0, state.quaternion, state.q
    known.qvel[:3], known.qvel[3:6], known.qvel[6:] = 0.0, state.gyroscope, state.dq
    mujoco.mj_forward(model, known)
    total, touching = np.zeros(6), []
    for _, body in soles:
        jacobian = np.zeros((6, model.nv))
        mujoco.mj_jac(model, known, jacobian[:3], jacobian[3:], known.xpos[0], body)
        leg = np.flatnonzero(np.abs(jacobian[:, 6:]).max(axis=0) > 1e-9)
        rest = known.qfrc_bias[6:][leg] - state.tau_est[leg]
        wrench = np.linalg.lstsq(jacobian[:, 6 + leg].T, rest, rcond=1e-3)[0]
        touching.append(bool(wrench[2] > 0.05 * robot.mass * 9.81))
        total += wrench * touching[-1]
    axes = known.xmat[robot.root_body_id].reshape(3, 3)
    return np.concatenate([axes.T @ total[:3], axes.T @ total[3:]]), touching


def measured(state: LowState) -> Measurement:
    """Return the controller's measurements."""
    wrench, touching = ground(state)
    return Measurement(state.quaternion, state.gyroscope, state.accelerometer, state.q, state.dq,
                       wrench, touching)  # fmt: skip


def simulate(command: LowCmd) -> LowState:
    """2 ms of the robot: its motors, and what it then publishes."""
    torque = command.tau + command.kp * (command.q - data.qpos[7:]) - command.kd * data.qvel[6:]
    data.ctrl[:] = np.clip(torque, -robot.torque_limit, robot.torque_limit)
    data.xfrc_applied[model.body("torso_link").id, 0] = 100.0 if 1.0 <= data.time < 1.1 else 0.0
    before = data.qvel[:3].copy()
    mujoco.mj_step(model, data)
    axes = data.xmat[robot.root_body_id].reshape(3, 3)
    force = axes.T @ ((data.qvel[:3] - before) / model.opt.timestep - model.opt.gravity)
    return LowState(data.qpos[3:7].copy(), data.qvel[3:6].copy(), force, data.qpos[7:].copy(),
                    data.qvel[6:].copy(), data.ctrl.copy())  # fmt: skip


standing = LowState(data.qpos[3:7].copy(), np.zeros(3), -model.opt.gravity, data.qpos[7:].copy(),
                    np.zeros(MOTORS), np.zeros(MOTORS))  # fmt: skip
weight = np.array([0.0, 0.0, robot.mass * 9.81, 0.0, 0.0, 0.0])
start = Measurement(standing.quaternion, standing.gyroscope, standing.accelerometer, standing.q,
                    standing.dq, weight, [True] * len(soles))  # fmt: skip
controller.reset(Readings.of_mujoco(data.qpos.copy(), data.qvel.copy()), start)
asked, state = controller.command(), standing
while data.time < 4.0:
    if by_targets:
        asked = asked.targets(state.q, state.dq, stiffness, 0.05 * stiffness)
    low, heard = LowCmd(asked.torque, asked.target, asked.stiffness, asked.damping), []
    for _ in range(controller.measurements):
        state = simulate(low)
        heard.append(measured(state))
    asked = controller.command(heard)

stands = data.subtree_com[0, 2] > 0.8 * robot.height_com
print(controller.name, "by targets" if by_targets else "by torques", "stands" if stands else "fell")
