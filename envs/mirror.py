"""Left and right exchanged: what the mirror image of a robot observes, and does."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from .errors import ConfigError
from .observation import Term
from .robot import Robot

SIDES = np.array([1.0, -1.0, 1.0])  # of a vector's x, y, z when left and right are exchanged
TOLERANCE = 1e-5  # of the CoM's height, by which a robot may differ from its mirror image


@dataclass(frozen=True, eq=False)
class Mirror:
    """x → sign · x[order]; twice is the identity."""

    order: np.ndarray  # (n,) int
    sign: np.ndarray  # (n,) ±1

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """The mirror image of `values` (..., n)."""
        return self.sign * values[..., self.order]


def mirror_joints(robot: Robot) -> Mirror:
    """How joint positions, velocities and torques (nv − 6) look in the mirror plane y = 0.

    A slide's axis a becomes S a, a hinge's −S a, S = diag(1, −1, 1), in the standing posture.
    Places, axes and masses are compared; springs, dampers and armature may differ.

    Raises ConfigError naming the robot and the joint or body that has no mirror image.
    """
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    near = TOLERANCE * robot.height_com
    root = data.xmat[robot.root_body_id].reshape(3, 3)
    if abs(root[:, 1] - [0.0, 1.0, 0.0]).max() > TOLERANCE:
        raise _lopsided(robot, f"the root {robot.description.root!r} does not point to the front")
    for body in range(1, model.nbody):
        away = (
            abs(data.xipos - SIDES * data.xipos[body]).max(axis=1)
            + abs(model.body_mass - model.body_mass[body]) / robot.mass
        )
        if away.min() > near:
            raise _lopsided(robot, f"the body {model.body(body).name!r} has no mirror image")
    order, sign = [], []
    kinds, places, axes = model.jnt_type[1:], data.xanchor[1:], data.xaxis[1:]
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


def mirror_terms(terms: Sequence[Term], joints: Mirror, actions: Mirror) -> Mirror:
    """How an observation with these `terms` looks in the mirror, by their `image`."""
    order, sign, first = [], [], 0
    for term in terms:
        if term.image == "joints":
            part = joints
        elif term.image == "actions":
            part = actions
        else:
            part = _plain(term)
        order.append(first + part.order)
        sign.append(part.sign)
        first += term.size
    return Mirror(np.concatenate(order), np.concatenate(sign))


def _plain(term: Term) -> Mirror:
    """Of numbers and vectors, which keep their places, and of feet, which change them."""
    places = np.arange(term.size)
    if term.image == "feet":
        return Mirror(places[::-1].copy(), np.ones(term.size))
    signs = {"number": np.ones(3), "vector": SIDES, "turn": -SIDES, "between feet": -SIDES}
    axes = [0 if term.image == "number" else "xyz".index(entry[-1]) for entry in term.entries]
    return Mirror(places, signs[term.image][axes])


def _lopsided(robot: Robot, why: str) -> ConfigError:
    return ConfigError(f"{robot.name!r} is not its own mirror image: {why}", field="robot")
