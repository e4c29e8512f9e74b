"""A robot's postures as a clip, and back: so they can be written to BVH and edited there.

Each hinge is a joint of the clip at the hinge's anchor; hinges of one body are joints at one place.
So any anchors and axes are exact, and the angle is read off again without a search.
"""

import mujoco
import numpy as np

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.rotations import angle_between, exp
from poise.baselines.motion.clips.skeleton import ROLES, Skeleton
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .limbs import Point, find_limbs, joints_to

HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)


def robot_skeleton(robot: Robot) -> Skeleton:
    """The skeleton whose joints are the root and the robot's hinges; the rest pose has angles 0.

    Raises ConfigError for a robot with slide joints, which no skeleton has.
    """
    model = robot.model
    if any(model.jnt_type[1:] != HINGE):
        raise ConfigError("has joints that slide: it is no skeleton", source=robot.name)
    data = _zero(robot)
    above = [_joint_above(model, joint) for joint in range(1, model.njnt)]
    anchors = np.array([data.qpos[:3], *data.xanchor[1:]])
    offsets = np.array([np.zeros(3), *(anchors[j + 1] - anchors[p] for j, p in enumerate(above))])
    points = find_limbs(robot).points
    hands = [(body, place) for role, point in points.items()
             if role.startswith("hand") for body, place in point.parts]  # fmt: skip
    feet = [(sole.body_id, sole.position) for sole in robot.soles]
    ends = [(_joints_above(model, body)[-1], Point(((body, place),)).place(data))
            for body, place in (*hands, *feet)]  # fmt: skip
    return Skeleton(
        (model.body(robot.root_body_id).name or "root", *robot.joint_names),
        np.array([-1, *above]),
        offsets,
        np.array([joint for joint, _ in ends]),
        np.array([place - anchors[joint] for joint, place in ends]),
        ("ZYX",) * model.njnt,
        {role: _hinge_at(model, points[role]) for role in ROLES if role in points},
    )


def clip_of_robot(robot: Robot, qpos: np.ndarray, dt: float, name: str) -> Clip:
    """Postures (F, nq) as a clip of `robot_skeleton`."""
    turns = exp(qpos[:, 7:, None] * _axes(robot))
    rotations = np.concatenate([qpos[:, None, 3:7], turns], axis=1)
    return Clip(name, robot_skeleton(robot), dt, qpos[:, :3].copy(), rotations)


def robot_qpos(clip: Clip, robot: Robot) -> np.ndarray:
    """The postures (F, nq) of a clip of this robot's skeleton.

    Of every joint's rotation, that about its axis counts: φ = 2 atan2(u · a, w), within ±π.

    Raises:
        ConfigError: a joint is missing, hangs elsewhere, or turns by more than 0.1° about another
            axis than its own.
    """
    own, order = robot_skeleton(robot), []
    for name in own.names:
        if name not in clip.skeleton.names:
            raise ConfigError(f"has no joint {name!r} of the robot {robot.name!r}",
                              source=clip.name, choices=clip.skeleton.names)  # fmt: skip
        order.append(clip.skeleton.names.index(name))
    turns, axes = clip.rotations[:, order[1:]], _axes(robot)
    angles = 2.0 * np.arctan2(np.einsum("fji,ji->fj", turns[..., 1:], axes), turns[..., 0])
    angles = (angles + np.pi) % (2.0 * np.pi) - np.pi
    beside = angle_between(exp(angles[..., None] * axes), turns)
    frame, joint = np.unravel_index(np.argmax(beside), beside.shape)
    if beside[frame, joint] > np.radians(0.1):
        raise ConfigError(
            f"joint {robot.joint_names[joint]!r} turns by {np.degrees(beside[frame, joint]):.1f}° "
            f"beside its axis in frame {frame}", source=clip.name,
        )  # fmt: skip
    return np.concatenate([clip.root, clip.rotations[:, order[0]], angles], axis=1)


def _zero(robot: Robot) -> mujoco.MjData:
    """Kinematics of all angles 0, the root's axes those of the world."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = 0.0
    data.qpos[3] = 1.0
    mujoco.mj_kinematics(robot.model, data)
    return data


def _axes(robot: Robot) -> np.ndarray:
    """(nj, 3) axes of the hinges in the rest pose, where all joints' axes are the world's."""
    return _zero(robot).xaxis[1:].copy()


def _hinge_at(model: mujoco.MjModel, point: Point) -> int:
    """The first joint at an anchor: other hinges of the same limb's joint hang on it."""
    body, place = point.parts[0]
    first = int(model.body_jntadr[body])
    joints = range(first, first + int(model.body_jntnum[body]))
    return next(joint for joint in joints if np.array_equal(model.jnt_pos[joint], place))


def _joints_above(model: mujoco.MjModel, body: int) -> list[int]:
    """The joints that move a body, the free one first."""
    return [0, *joints_to(model, body)]


def _joint_above(model: mujoco.MjModel, joint: int) -> int:
    """The joint that moves a joint."""
    above = _joints_above(model, int(model.jnt_bodyid[joint]))
    return above[above.index(joint) - 1]
