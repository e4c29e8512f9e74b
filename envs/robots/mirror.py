"""Left and right exchanged: observations and actions of a robot's mirror image."""

from dataclasses import dataclass

import mujoco
import numpy as np

from poise.configs.errors import ConfigError

from .robot import Robot

SIDES = np.array([1.0, -1.0, 1.0])  # of a vector's x, y, z when left and right are exchanged
# of the CoM's height, by which a robot may differ from its mirror image: real ones by a millimetre
TOLERANCE = 2e-3
HEAVY = 0.1  # of the robot's mass: a lighter body may be farther off in proportion,
FARTHER = 5.0  # up to so many times


@dataclass(frozen=True, eq=False)
class Mirror:
    """x → sign · x[order]; twice is the identity."""

    order: np.ndarray  # (n,) int
    sign: np.ndarray  # (n,) ±1

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """The mirror image of `values` (..., n)."""
        return self.sign * values[..., self.order]


def mirror_robot(robot: Robot) -> dict[str, Mirror]:
    """The mirrors of joints, motors and the root's axes in the plane y = 0.

    They hold in the standing posture. With S = diag(1, −1, 1) a slide's axis a becomes S a, and a
    hinge's −S a. With the root's axes R a vector u along them becomes Rᵀ S R u, and a turn
    −Rᵀ S R u. Places, axes, masses and torque limits are compared; inertia, joint ranges, springs,
    dampers and armature may differ.

    The keys are "joints" (nv − 6), "motors" (nu), "root vector" and "root turn" (3).

    Raises ConfigError naming the robot and the body, joint or motor that has no mirror image.
    """
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(robot.model, data)
    _check_bodies(robot, data)
    joints = _mirror_joints(robot, data)
    vector = _mirror_root(robot, data)
    return {
        "joints": joints,
        "motors": _mirror_motors(robot, joints),
        "root vector": vector,
        "root turn": Mirror(vector.order, -vector.sign),
    }


def _check_bodies(robot: Robot, data: mujoco.MjData) -> None:
    model = robot.model
    for body in range(1, model.nbody):
        light = HEAVY * robot.mass / max(model.body_mass[body], 1e-9)
        near = TOLERANCE * robot.height_com * np.clip(light, 1.0, FARTHER)
        there = abs(data.xipos - SIDES * data.xipos[body]).max(axis=1) < near
        same = abs(model.body_mass - model.body_mass[body]) < TOLERANCE * robot.mass
        if not np.any(there & same):
            raise _lopsided(robot, f"the body {model.body(body).name!r} has no mirror image")


def _mirror_joints(robot: Robot, data: mujoco.MjData) -> Mirror:
    near, order, sign = TOLERANCE * robot.height_com, [], []
    kinds, places, axes = robot.model.jnt_type[1:], data.xanchor[1:], data.xaxis[1:]
    for joint, name in enumerate(robot.joint_names):
        hinge = kinds[joint] == mujoco.mjtJoint.mjJNT_HINGE
        axis = (-SIDES if hinge else SIDES) * axes[joint]
        there = abs(places - SIDES * places[joint]).max(axis=1) < near
        along = np.where(there & (kinds == kinds[joint]), axes @ axis, 0.0)
        image = int(np.argmax(abs(along)))
        if abs(along[image]) < 1.0 - TOLERANCE:
            raise _lopsided(robot, f"the joint {name!r} has no mirror image")
        order.append(image)
        sign.append(np.sign(along[image]))
    return Mirror(np.array(order), np.array(sign))


def _mirror_motors(robot: Robot, joints: Mirror) -> Mirror:
    driven, limit = robot.motor_dofs - 6, robot.torque_limit
    motors = {int(joint): motor for motor, joint in enumerate(driven)}
    images = [motors.get(int(joint), -1) for joint in joints.order[driven]]
    for motor, image in enumerate(images):
        if image < 0 or abs(limit[image] - limit[motor]) > TOLERANCE * limit[motor]:
            name = robot.joint_names[driven[motor]]
            raise _lopsided(robot, f"the motor of {name!r} has no mirror image of its strength")
    return Mirror(np.array(images), joints.sign[driven])


def _mirror_root(robot: Robot, data: mujoco.MjData) -> Mirror:
    axes = data.xmat[robot.root_body_id].reshape(3, 3)
    image = axes.T @ (SIDES[:, None] * axes)
    order = abs(image).argmax(axis=1)
    sign = image[np.arange(3), order]
    if abs(sign).min() < 1.0 - TOLERANCE:
        name = robot.description.root
        raise _lopsided(robot, f"the axes of the root {name!r} are not each other's mirror images")
    return Mirror(order, np.sign(sign))


def _lopsided(robot: Robot, why: str) -> ConfigError:
    return ConfigError(f"{robot.name!r} is not its own mirror image: {why}", field="robot")
