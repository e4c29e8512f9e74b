"""A controller in a loop of MuJoCo alone, from an IMU, encoders and force sensors, to servos.

    python examples/measured_mujoco.py feedback-step

Its position and velocity are estimated. It is pushed forward and to the left, with 15 N·s.
"""

import sys

import mujoco
import numpy as np

import poise
from poise.training import Measurement, Readings

controller = poise.load_standalone(
    sys.argv[1] if len(sys.argv) > 1 else "feedback-step",
    realism={"sensors": {"velocity_noise": 0.05, "gyro_noise": 0.01, "accelerometer_noise": 0.1}},
)
robot, rng = controller.robot, np.random.default_rng(0)
model, data = robot.model, mujoco.MjData(robot.model)
data.qpos[:] = robot.standing_qpos
mujoco.mj_forward(model, data)
torso, dofs = model.body("torso").id, np.array(robot.motor_dofs)
before = data.qvel[:3].copy()


def measure() -> Measurement:
    """Return the sensor readings after a physics step."""
    axes = data.xmat[robot.root_body_id].reshape(3, 3)
    acceleration = (data.qvel[:3] - before) / model.opt.timestep - model.opt.gravity
    ground = data.qfrc_constraint[:6].copy()  # force in the world's axes, moment in the root's
    ground[:3] = axes.T @ ground[:3]
    return Measurement(
        attitude=data.qpos[3:7].copy(),
        angular_velocity=data.qvel[3:6] + rng.normal(0.0, 0.01, 3),
        acceleration=axes.T @ acceleration + rng.normal(0.0, 0.1, 3),
        joint_positions=data.qpos[7:].copy(),
        joint_velocities=data.qvel[6:] + rng.normal(0.0, 0.05, model.nv - 6),
        ground_wrench=ground,
        contacts=[data.sensor(f"contact_{sole.name}").data[0] > 0 for sole in robot.soles],
    )


def step(command: tuple[np.ndarray, ...]) -> Measurement:
    """Return a physics step of motors that run the servo on their own encoders."""
    torque, target, stiffness, damping = command
    q, dq = data.qpos[dofs + 1], data.qvel[dofs]
    data.ctrl[:] = torque + stiffness * (target - q) - damping * dq
    data.xfrc_applied[torso, :2] = 106.0 if 0.5 <= data.time < 0.6 else 0.0  # [N] forward, left
    before[:] = data.qvel[:3]
    mujoco.mj_step(model, data)
    return measure()


controller.reset(Readings.of_mujoco(data.qpos.copy(), data.qvel.copy()), measure())
command = controller.command()
while data.time < 5.0:
    command = controller.command([step(command) for _ in range(controller.measurements)])

estimated = controller.state.com[2] / robot.height_com
print(controller.name, "stands" if data.subtree_com[0, 2] > 0.8 * robot.height_com else "fell")
print(f"height of the CoM, estimated: {estimated:.2f} of that at rest")
