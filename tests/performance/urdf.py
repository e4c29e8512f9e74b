"""A URDF of a compiled MuJoCo robot, for libraries that read nothing else.

The hinges of one body become a chain of massless links; geometry is left out. Fixed links named
`sole_NAME` sit at the soles' reference points.
"""

from __future__ import annotations

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from poise.envs.robots.robot import Robot


def urdf(robot: Robot) -> str:
    """The text of the URDF, its root link the robot's free body.

    Raises ValueError for a joint that is no hinge.
    """
    model = robot.model
    parts = [f'<robot name="{robot.name}">', _link(robot, robot.root_body_id, np.zeros(3))]
    for body in range(robot.root_body_id + 1, model.nbody):
        if model.body_rootid[body] == model.body_rootid[robot.root_body_id]:
            parts += _body(robot, body)
    for sole in robot.soles:
        name, parent = f"sole_{sole.name}", _name(robot, sole.body_id)
        rotation = Rotation.from_matrix(sole.rotation)
        position = np.asarray(sole.position) - _anchor(robot, sole.body_id)
        parts.append(f'<link name="{name}"/>')
        parts.append(_joint(f"{name}_joint", "fixed", parent, name, position, rotation))
    return "\n".join([*parts, "</robot>"])


def _body(robot: Robot, body: int) -> list[str]:
    """The links and joints between a body's parent and itself."""
    model, parts = robot.model, []
    parent_body = int(model.body_parentid[body])
    parent, name = _name(robot, parent_body), _name(robot, body)
    rotation = Rotation.from_quat(model.body_quat[body], scalar_first=True)
    before = model.body_pos[body] - _anchor(robot, parent_body)
    first, count = model.body_jntadr[body], model.body_jntnum[body]
    if count == 0:
        return [
            _link(robot, body, np.zeros(3)),
            _joint(f"{name}_fixed", "fixed", parent, name, before, rotation),
        ]
    last = np.zeros(3)
    for k in range(count):
        j = first + k
        if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_HINGE:
            raise ValueError(f"joint {model.joint(j).name!r} of {robot.name!r} is no hinge")
        anchor = model.jnt_pos[j]
        position = before + rotation.apply(anchor) if k == 0 else anchor - last
        turn = rotation if k == 0 else Rotation.identity()
        child = name if k == count - 1 else f"{name}_{k}"
        parts.append(_link(robot, body, anchor) if k == count - 1 else f'<link name="{child}"/>')
        parts.append(
            _joint(
                model.joint(j).name, "revolute", parent, child, position, turn, model.jnt_axis[j]
            )
        )
        parent, last = child, anchor
    return parts


def _anchor(robot: Robot, body: int) -> np.ndarray:
    """Where a body's link has its origin, in the body's frame: at its last hinge."""
    model, count = robot.model, robot.model.body_jntnum[body]
    if body == robot.root_body_id or count == 0:
        return np.zeros(3)
    return model.jnt_pos[model.body_jntadr[body] + count - 1]


def _name(robot: Robot, body: int) -> str:
    return robot.model.body(body).name


def _link(robot: Robot, body: int, anchor: np.ndarray) -> str:
    model = robot.model
    x, y, z = model.body_inertia[body]
    turn = Rotation.from_quat(model.body_iquat[body], scalar_first=True)
    return (
        f'<link name="{_name(robot, body)}"><inertial>'
        f"{_origin(model.body_ipos[body] - anchor, turn)}"
        f'<mass value="{model.body_mass[body]:.17g}"/><inertia ixx="{x:.17g}" iyy="{y:.17g}" '
        f'izz="{z:.17g}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(name, kind, parent, child, position, turn, axis=None) -> str:
    limit = '<limit lower="-10" upper="10" effort="1000" velocity="1000"/>'
    moved = "" if axis is None else f'<axis xyz="{_numbers(axis)}"/>{limit}'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"{_origin(position, turn)}{moved}</joint>"
    )


def _origin(position: np.ndarray, turn: Rotation) -> str:
    return f'<origin xyz="{_numbers(position)}" rpy="{_numbers(turn.as_euler("xyz"))}"/>'


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.17g}" for value in values)
