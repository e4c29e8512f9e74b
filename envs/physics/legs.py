"""The joints of a leg: how far its knee is bent, and the axes that its ankle turns about."""

from dataclasses import dataclass

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

from .arrays import dof_chain

ALONG = 0.7  # |cos| between an axis and a direction from which the axis is of that direction
ANKLE = 1.0 / 3.0  # of the height of a leg's first joint: joints below belong to the ankle


@dataclass(frozen=True)
class Leg:
    """A leg in the standing posture: the joints that move one foot and not the other.

    Hip, knee and ankle are the last three that turn about the robot's left; None where there are
    fewer.
    """

    foot: str  #: the foot's name
    joints: tuple[str, ...]  #: from the trunk to the foot
    knee: str | None
    knee_bend: float | None  #: between the lines from hip to knee and from knee to ankle [deg]
    hip: str | None
    ankle: str | None
    ankle_pitch: bool  #: whether a joint of the ankle turns about the robot's left
    ankle_roll: bool  #: whether one turns about its forward direction


def standing_data(robot: Robot) -> mujoco.MjData:
    """The robot's data in the standing posture at rest, all of it computed, contacts too."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(robot.model, data)
    return data


def find_legs(robot: Robot) -> tuple[Leg, ...]:
    """The leg of each foot, in the order of the soles."""
    data = standing_data(robot)
    of_dofs = robot.model.dof_jntid
    chains = [
        list(dict.fromkeys(of_dofs[dof_chain(robot.model, sole.body_id)].tolist()))
        for sole in robot.soles
    ]
    shared = set(chains[0]).intersection(*chains[1:])
    return tuple(
        _leg(robot.model, data, sole.name, [joint for joint in chain if joint not in shared])
        for sole, chain in zip(robot.soles, chains, strict=True)
    )


def turn_range(robot: Robot) -> tuple[float, float]:
    """How far, to the right (≤ 0) and to the left, both feet can be turned from the trunk in the
    standing posture [rad]: by the joints of each leg whose axes are within 45° of the vertical.

    ±π at most; (0, 0) for legs without such a joint.
    """
    data, model = standing_data(robot), robot.model
    low, high = -np.pi, np.pi
    for leg in find_legs(robot):
        ends = np.zeros(2)
        for joint in (model.joint(name) for name in leg.joints):
            up = data.xaxis[joint.id, 2]
            if abs(up) > ALONG:
                limited = bool(model.jnt_limited[joint.id])
                span = joint.range - data.qpos[joint.qposadr[0]] if limited else (-np.pi, np.pi)
                ends += np.sort(np.sign(up) * np.asarray(span))
        low, high = max(low, ends[0]), min(high, ends[1])
    return min(float(low), 0.0), max(float(high), 0.0)


def _leg(model: mujoco.MjModel, data: mujoco.MjData, foot: str, joints: list[int]) -> Leg:
    names = [model.joint(i).name for i in joints]
    axes, anchors = np.abs(data.xaxis[joints]), data.xanchor[joints]
    pitch, low = axes[:, 1] > ALONG, anchors[:, 2] < ANKLE * anchors[0, 2]
    hip, knee, ankle, bend = None, None, None, None
    if np.count_nonzero(pitch) >= 3:
        chain = np.flatnonzero(pitch)[-3:]
        hip, knee, ankle = (names[i] for i in chain)
        bend = _bend(*anchors[chain][:, [0, 2]])
    return Leg(
        foot=foot,
        joints=tuple(names),
        knee=knee,
        knee_bend=bend,
        hip=hip,
        ankle=ankle,
        ankle_pitch=bool(np.any(pitch & low)),
        ankle_roll=bool(np.any((axes[:, 0] > ALONG) & low)),
    )


def _bend(hip: np.ndarray, knee: np.ndarray, ankle: np.ndarray) -> float:
    """Angle [deg] between the thigh and the shin's continuation of it, in the sagittal plane."""
    thigh, shin = knee - hip, ankle - knee
    cross = thigh[0] * shin[1] - thigh[1] * shin[0]
    return float(np.degrees(abs(np.arctan2(cross, thigh @ shin))))
