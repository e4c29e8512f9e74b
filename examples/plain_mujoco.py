"""A controller in a loop of MuJoCo alone, as in the loop of a robot: readings in, torques out.

    python examples/plain_mujoco.py feedback-step

The robot is pushed forward and to the left, with 25 N·s.
"""

import sys

import mujoco

import poise
from poise.training import Readings

controller = poise.load_standalone(sys.argv[1] if len(sys.argv) > 1 else "feedback-step")
robot = controller.robot
model, data = robot.model, mujoco.MjData(robot.model)
data.qpos[:] = robot.standing_qpos
torso = model.body("torso").id


def read() -> Readings:
    """Return readings of the encoders, the inertial unit and the state estimate of a robot."""
    return Readings(
        position=data.qpos[:3],
        orientation=data.qpos[3:7],
        velocity=data.qvel[:3],
        angular_velocity=data.qvel[3:6],
        joint_positions=dict(zip(controller.joint_names, data.qpos[7:], strict=True)),
        joint_velocities=data.qvel[6:],  # in the order of the names
    )


controller.reset(read())
while data.time < 5.0:
    data.ctrl[:] = controller.torques(read())
    data.xfrc_applied[torso, :2] = 180.0 if 0.5 <= data.time < 0.6 else 0.0  # [N] forward, left
    mujoco.mj_step(model, data, nstep=round(controller.period / model.opt.timestep))

print(controller.name, "stands" if data.subtree_com[0, 2] > 0.8 * robot.height_com else "fell")
