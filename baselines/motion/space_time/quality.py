"""How good a retargeted motion is, measured from its postures alone: the same for all solvers."""

from typing import NamedTuple

import numpy as np

from poise.baselines.motion.space_time.constraints.constraint import (
    Constraint,
    Violation,
    violation,
)
from poise.baselines.motion.space_time.constraints.scene import SIDES, Scene

from .asked import Asked
from .trajectory import jerk


class Quality(NamedTuple):
    """What postures miss.

    Attributes:
        sole_error: largest distance of a corner of a planted sole from where it is to be [m].
        skating, skating_largest: horizontal speed of corners of planted soles [m/s].
        penetration: largest depth of a link, or of a sole, in the floor or in another link [m].
        limit_excess: largest excess over a joint limit [rad].
        hands: side → mean distance of the hand from where the clip's directions have it, from the
            shoulder and with the robot's own lengths [m]; empty without arms.
        jerk: root mean square of the joints' third derivative [rad/s³].
        task_error: root mean square over the frames of ‖W e‖, see `FrameTasks`.
        directions: segment → root mean square of the angle to its target [rad].
        violations: of the user's constraints, all of them.
    """

    sole_error: float
    skating: float
    skating_largest: float
    penetration: float
    limit_excess: float
    hands: dict[str, float]
    jerk: float
    task_error: float
    directions: dict[str, float]
    violations: tuple[Violation, ...]


def motion_quality(scene: Scene, asked: Asked, constraints: tuple[Constraint, ...] = ()) -> Quality:
    """The quality of a scene's postures.

    Args:
        scene: with the postures.
        asked: what the clip asks for.
        constraints: the user's.
    """
    errors, angles, depth = [], [], 0.0
    hands: dict[str, list[float]] = {side: [] for side in SIDES if scene.limbs.has_arms}
    for frame in range(len(scene)):
        data = scene.at(frame)
        for side, found in hands.items():
            found.append(float(np.linalg.norm(hand_error(scene, asked, side, frame))))
        depth = max(depth, asked.limit.depth(data))
        errors.append(asked.errors(scene, frame))
        angles.append(asked.tasks.angles())
    joints, (low, high) = scene.qpos[:, 7:], scene.robot.joint_range.T
    rms = np.sqrt(np.mean(np.square(angles), axis=0))
    return measure_soles(
        scene,
        depth,
        float(np.maximum(np.maximum(low - joints, joints - high), 0.0).max()),
        dict(zip(asked.targets.directions, rms.tolist(), strict=True)),
        {side: float(np.mean(found)) for side, found in hands.items()},
        float(np.sqrt(np.mean([e @ e for e in errors]))),
        tuple(violation(each, scene) for each in constraints),
    )


def measure_soles(
    scene: Scene,
    depth: float,
    limit_excess: float,
    directions: dict[str, float],
    hands: dict[str, float] | None = None,
    task_error: float = np.nan,
    violations: tuple[Violation, ...] = (),
) -> Quality:
    """The quality of postures of which all is known but their jerk and how their soles stay; links
    are `depth` in each other or in the floor [m]."""
    corners = scene.planted_corners
    places = np.empty_like(corners)
    for frame in range(len(scene)):
        scene.at(frame)
        for foot in range(len(scene.robot.soles)):
            places[frame, foot] = scene.padded_corners(foot)
    planted = scene.planted[:, :, None, None]
    off = np.linalg.norm(np.where(planted, places - corners, 0.0), axis=-1)
    both = (scene.planted[1:] & scene.planted[:-1])[:, :, None]
    speeds = np.linalg.norm(np.diff(places[..., :2], axis=0), axis=-1) / scene.dt
    skating = speeds[np.broadcast_to(both, speeds.shape)]
    return Quality(
        float(off.max()),
        float(skating.mean()) if skating.size else 0.0,
        float(skating.max(initial=0.0)),
        max(depth, float(-places[..., 2].min())),
        limit_excess,
        hands or {},
        jerk(scene.qpos, scene.dt),
        task_error,
        directions,
        violations,
    )


def hand_error(scene: Scene, asked: Asked, side: str, frame: int) -> np.ndarray:
    """(3,) [m] h − s − l₁ d₁ − l₂ d₂: hand h, shoulder s, and the clip's directions d of upper arm
    and forearm, with the lengths l that the robot has."""
    data, points = scene.at(frame), scene.limbs.points
    shoulder, elbow, hand = (points[f"{role}_{side}"].place(data)
                             for role in ("shoulder", "elbow", "hand"))  # fmt: skip
    arm = asked.targets.directions[f"upper_arm_{side}"][frame]
    forearm = asked.targets.directions[f"forearm_{side}"][frame]
    lengths = np.linalg.norm(elbow - shoulder), np.linalg.norm(hand - elbow)
    return hand - shoulder - lengths[0] * arm - lengths[1] * forearm
