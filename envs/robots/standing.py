"""The standing posture: both soles exactly flat on the ground, the robot facing along +x."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from poise.configs.errors import ConfigError, shown

from .actuators import SIMPLE_JOINTS
from .description import RobotDescription, match_names
from .soles import SolePlane

HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)
MAX_CORRECTION = np.deg2rad(3.0)  # [rad] that levelling may change a joint
TOLERANCE = 1e-10  # [rad] and [m]


def described_qpos(
    model: mujoco.MjModel,
    description: RobotDescription,
    keyframes: dict[str, np.ndarray],
    source: str,
) -> np.ndarray:
    """(nq,) the posture as described, not yet levelled.

    Joints that the description leaves out stay within their range.

    Args:
        model: the robot.
        description: its ``posture`` is used.
        keyframes: keyframe name → qpos, of the source model.
        source: the description file, for errors.

    Raises:
        ConfigError: an unknown keyframe or joint, or an angle out of the joint's range.
    """
    posture = description.posture
    qpos = model.qpos0.copy()
    if posture.keyframe is not None:
        if posture.keyframe not in keyframes:
            raise ConfigError(
                f"no keyframe is called {shown(posture.keyframe)}",
                source=source,
                field="posture.keyframe",
                choices=keyframes,
            )
        qpos = keyframes[posture.keyframe].copy()
    simple = [i for i in range(model.njnt) if model.jnt_type[i] in SIMPLE_JOINTS]
    names = [model.joint(i).name for i in simple]
    given = match_names(posture.joints, names, source, "posture.joints")
    for i, name in zip(simple, names, strict=True):
        low, high = model.jnt_range[i] if model.jnt_limited[i] else (-np.inf, np.inf)
        value = qpos[model.jnt_qposadr[i]]
        if name in given:
            degrees = posture.unit == "degree" and model.jnt_type[i] == HINGE
            value = np.deg2rad(given[name]) if degrees else given[name]
            if not low <= value <= high:
                unit = 180.0 / np.pi if degrees else 1.0
                raise ConfigError(
                    f"{given[name]:g} is outside the range of the joint {name!r}, "
                    f"{low * unit:g} to {high * unit:g}",
                    source=source,
                    field="posture.joints",
                )
        qpos[model.jnt_qposadr[i]] = np.clip(value, low, high)
    return qpos


def level_soles(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    feet: Sequence[int],
    planes: Sequence[SolePlane],
    source: str,
) -> None:
    """Turn the leg joints of ``data.qpos`` a little so that both soles are level and equally high.

    Gauss–Newton with the smallest joint change, over the joints that move just one foot; the root
    keeps its orientation.

    Args:
        model: the robot.
        data: its ``qpos`` is changed; the kinematics are up to date afterwards.
        feet: foot body ids.
        planes: where each foot rests.
        source: the description file, for errors.

    Raises:
        ConfigError: the legs cannot do it within 3° per joint.
    """
    start = data.qpos.copy()
    for _ in range(50):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        residual, jacobian = _levelness(model, data, feet, planes)
        if np.abs(residual).max() < TOLERANCE:
            break
        mujoco.mj_integratePos(model, data.qpos, -np.linalg.pinv(jacobian) @ residual, 1.0)
    change = np.abs(data.qpos - start)
    if np.abs(residual).max() >= TOLERANCE or change.max() > MAX_CORRECTION:
        raise ConfigError(
            "the soles cannot be made flat and equally high by small changes of the leg joints; "
            "correct the standing posture",
            source=source,
            field="posture",
        )


def _levelness(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    feet: Sequence[int],
    planes: Sequence[SolePlane],
) -> tuple[np.ndarray, np.ndarray]:
    """(5,) tilt of both sole normals and height difference, and its (5, nv) Jacobian."""
    tilts, heights, tilt_rows, height_rows = [], [], [], []
    for body, plane in zip(feet, planes, strict=True):
        rotation = data.xmat[body].reshape(3, 3)
        normal = rotation @ plane.normal
        point = data.xpos[body] + rotation @ plane.points.mean(0)
        jac_pos, jac_rot = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jac(model, data, jac_pos, jac_rot, point, body)
        tilts.append(normal[:2])
        tilt_rows.append(np.cross(jac_rot.T, normal).T[:2])  # ṅ = ω × n
        heights.append(point[2])
        height_rows.append(jac_pos[2])
    moved = [np.any(rows != 0, axis=0) for rows in tilt_rows]
    one_leg = moved[0] ^ moved[1]
    residual = np.concatenate([*tilts, [heights[0] - heights[1]]])
    jacobian = np.vstack([*tilt_rows, height_rows[0] - height_rows[1]])
    return residual, np.where(one_leg, jacobian, 0.0)


def turn_forward(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    root: int,
    forward: tuple[float, float, float],
    source: str,
) -> None:
    """Turn the robot about the vertical until its forward axis points along +x.

    Args:
        model: the robot.
        data: its ``qpos`` is changed; the kinematics are up to date afterwards.
        root: id of the root body.
        forward: forward direction in the root body's frame.
        source: the description file, for errors.

    Raises:
        ConfigError: the forward axis is steeper than 60° in the standing posture.
    """
    axis = data.xmat[root].reshape(3, 3) @ np.asarray(forward)
    if np.hypot(axis[0], axis[1]) < 0.5 * np.linalg.norm(axis):
        raise ConfigError(
            "this axis of the root body is not level in the standing posture",
            source=source,
            field="forward",
        )
    half = -0.5 * np.arctan2(axis[1], axis[0])
    turn = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
    mujoco.mju_mulQuat(data.qpos[3:7], turn, data.qpos[3:7].copy())
    mujoco.mj_kinematics(model, data)
