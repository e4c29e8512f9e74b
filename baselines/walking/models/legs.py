"""The joints of legs: where hips and ankles are and how far the knees are bent in a tick, and which
joints are above and below a knee."""

from dataclasses import dataclass
from typing import Annotated

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.legs import find_legs, standing_data
from poise.envs.robots.robot import Robot


@dataclass(frozen=True, eq=False)
class LegArrays(Block):
    """Two legs as rods, in the order of the soles: what they are, and where."""

    thigh: float  # L1, from hip to knee [m]
    shank: float  # L2, from knee to ankle [m]
    hip_body: Annotated[np.ndarray, 2, np.int64]  # a body that the hip is fixed to
    hip_place: Annotated[np.ndarray, 2, 3]  # the hip in that body's axes [m]
    ankle_body: Annotated[np.ndarray, 2, np.int64]
    ankle_place: Annotated[np.ndarray, 2, 3]  # [m]
    knee_dof: Annotated[np.ndarray, 2, np.int64]
    knee_sign: Annotated[np.ndarray, 2]  # 1 where the joint's angle rises with the flexion, else −1
    straight: Annotated[np.ndarray, 2]  # the joint's angle of a straight leg [rad]
    hip_dof: Annotated[np.ndarray, 2, np.int64]  # of the joint that turns about the robot's left
    hip_sign: Annotated[np.ndarray, 2]  # 1 where it rises as the thigh turns forward, else −1
    hip: Annotated[np.ndarray, 2, 3]  # world [m]
    ankle: Annotated[np.ndarray, 2, 3]  # world [m]
    sole: Annotated[np.ndarray, 2, 2]  # reference points of the soles, along the ground [m]
    flexion: Annotated[np.ndarray, 2]  # β [rad]
    flexion_rate: Annotated[np.ndarray, 2]  # β̇ [rad/s]


@compiled
def _place(s: StateArrays, body: int, offset: np.ndarray, out: np.ndarray) -> None:
    for a in range(3):
        out[a] = s.body_position[body, a]
        for b in range(3):
            out[a] += s.body_axes[body, a, b] * offset[b]


@compiled
def measure_legs(s: StateArrays, legs: LegArrays) -> None:
    """Fill hips, ankles, soles and flexions for the state."""
    for i in range(2):
        _place(s, legs.hip_body[i], legs.hip_place[i], legs.hip[i])
        _place(s, legs.ankle_body[i], legs.ankle_place[i], legs.ankle[i])
        legs.sole[i, 0], legs.sole[i, 1] = s.sole_point[i, 0], s.sole_point[i, 1]
        dof = legs.knee_dof[i]
        legs.flexion[i] = legs.knee_sign[i] * (s.qpos[dof + 1] - legs.straight[i])
        legs.flexion_rate[i] = legs.knee_sign[i] * s.qvel[dof]


def leg_arrays(robot: Robot) -> LegArrays:
    """The legs of a robot; raises ConfigError where a leg has no hip, knee and ankle that pitch."""
    legs = find_legs(robot)
    for leg in legs:
        if leg.knee is None:
            raise ConfigError(f"needs a knee, the leg of {leg.foot!r} has none", field="gait.model")
    model, data = robot.model, standing_data(robot)
    hips, knees, ankles = (
        [model.joint(str(getattr(leg, name))).id for leg in legs]
        for name in ("hip", "knee", "ankle")
    )
    places = [data.xanchor[joints] for joints in (hips, knees, ankles)]
    rods = np.linalg.norm(np.diff(places, axis=0), axis=2)  # thigh and shank of each leg
    dofs = model.jnt_dofadr[knees]
    signs = np.array(
        [_sign(model, data, joints) for joints in zip(hips, knees, ankles, strict=True)]
    )
    bend = np.radians([float(leg.knee_bend or 0.0) for leg in legs])
    turns = np.sign(data.xaxis[hips, 1])
    carriers = [np.array([_carrier(model, joint) for joint in each]) for each in (hips, ankles)]
    return LegArrays.allocate(
        thigh=float(rods[0].mean()), shank=float(rods[1].mean()),
        hip_body=carriers[0], hip_place=_in_bodies(data, carriers[0], places[0]),
        ankle_body=carriers[1], ankle_place=_in_bodies(data, carriers[1], places[2]),
        knee_dof=dofs.astype(np.int64), knee_sign=signs,
        straight=robot.standing_qpos[model.jnt_qposadr[knees]] - signs * bend,
        hip_dof=model.jnt_dofadr[hips].astype(np.int64), hip_sign=-turns,
    )  # fmt: skip


def _carrier(model: mujoco.MjModel, joint: int) -> int:
    """A body in which a joint's anchor stays: the parent's where no other joint comes before."""
    body = int(model.jnt_bodyid[joint])
    return int(model.body_parentid[body]) if joint == model.body_jntadr[body] else body


def _in_bodies(data: mujoco.MjData, bodies: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(2, 3) places in the axes of bodies [m]."""
    axes = data.xmat[bodies].reshape(-1, 3, 3)
    return np.einsum("nji,nj->ni", axes, places - data.xpos[bodies])


def no_legs() -> LegArrays:
    """Legs that nothing is known of, for models that do not ask."""
    return LegArrays.allocate(thigh=0.0, shank=0.0, knee_sign=np.ones(2), hip_sign=np.ones(2))


def _sign(model: mujoco.MjModel, data: mujoco.MjData, joints: tuple[int, int, int]) -> float:
    """1 if a knee's angle rises as it brings the ankle nearer to the hip, else −1."""
    hip, knee, ankle = data.xanchor[list(joints)]
    way = np.cross(data.xaxis[joints[1]], ankle - knee)
    return 1.0 if way @ (hip - ankle) > 0.0 else -1.0


@dataclass(frozen=True)
class LegJoints:
    """Joints of a leg, by index: on the way to the thigh, the hip's own, the knee, the ankle."""

    upper: np.ndarray
    hip: np.ndarray
    knee: np.ndarray
    ankle: np.ndarray
    bend: np.ndarray  # what a bend of 1 adds to the knee


def leg_joints(robot: Robot, sole: int) -> LegJoints:
    """Joints of a leg by how far down they are: in the upper quarter, in the lower one, between."""
    model, data = robot.model, standing_data(robot)

    def chain(body: int) -> list[int]:
        joints: list[int] = []
        while body != robot.root_body_id:
            first = model.body_jntadr[body]
            joints = [first + k for k in range(model.body_jntnum[body])] + joints
            body = model.body_parentid[body]
        return joints

    mine, other = (chain(robot.soles[i].body_id) for i in (sole, 1 - sole))
    own = np.array([j for j in mine if j not in other])
    top, foot = data.xanchor[own[0]], data.xanchor[own[-1]]
    depth = (data.xanchor[own] - top) @ (foot - top) / ((foot - top) @ (foot - top))
    knee = own[(depth > 0.25) & (depth < 0.75)]
    if len(knee) != 1:
        raise ConfigError(f"needs legs with a knee, unlike {robot.name!r}", field="controller")
    shortens = np.cross(data.xaxis[knee], foot - data.xanchor[knee]) @ (top - foot)
    return LegJoints(
        upper=np.array([j for j in mine if j < knee[0]]) - 1,  # the first joint is the root's
        hip=own[depth <= 0.25] - 1,
        knee=knee - 1,
        ankle=own[depth >= 0.75] - 1,
        bend=np.sign(shortens),
    )
