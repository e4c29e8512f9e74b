"""Any clip of a biped on a robot by kinematics alone: wherever it goes, turns, sits or leaps."""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np

from poise.baselines.balance.references.footing import stances_of
from poise.baselines.balance.references.legs import foot_signs
from poise.baselines.balance.references.robot_clip import RATE, About, RobotClip
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import FLOOR, measure_contacts, over_ground
from poise.baselines.motion.clips.skeleton import SIDES
from poise.configs.errors import ConfigError
from poise.configs.extras import how_to_install
from poise.envs.robots.robot import Robot

from .limbs import Limbs, find_limbs
from .retarget import SMOOTH, Retargeted
from .targets import UPRIGHT, BodyTargets, clip_targets, low_pass

FLAT = 0.6  # of a foot's length that is seen from above: less, and its heading says nothing
TURNED, SPLAY = 0.35, 1.2  # [rad] by which a foot turns as it stands, at most; and from the hips
NARROW = 0.8  # of the feet's distance from the middle as the robot stands: they get no nearer
SHORTER, SHORTEST, OFF = 0.92, 0.4, 0.003  # of steps, until no planted sole is so far off [m]
SWIFTER = 2.0  # times `smooth` is what is kept of a motion that need not be performed


class Tracks(NamedTuple):
    """Where a robot's pelvis and soles go in F frames.

    Attributes:
        body: directions of the segments.
        pelvis: (F, 3) the middle of the hips [m].
        ankles: (F, 2, 3) where ankles are if soles are level, by the robot's soles [m].
        yaws: (F, 2) headings of the soles [rad].
        planted: (F, 2) bool.
    """

    body: BodyTargets
    pelvis: np.ndarray
    ankles: np.ndarray
    yaws: np.ndarray
    planted: np.ndarray


def retarget_freely(clip: Clip, robot: Robot, *, smooth: float = SMOOTH) -> Retargeted:
    """The postures in which a robot does what a clip shows, by kinematics, at `RATE`.

    The clip's first heading becomes x. Hips and feet go where the clip's do, times the ratio of the
    legs; directions of the segments are the clip's. Soles are level. Planted ones rest at the
    median of the clip's places in the stance; between stances a foot goes the clip's way, and what
    it was off grows into what it will be off. Where the legs cannot reach, the hips get lower. Ways
    get shorter until every planted sole is within 3 mm of its place. Whether a controller can
    perform that is another question.

    Args:
        clip: of any skeleton whose hips, knees and ankles are known.
        robot: with two feet.
        smooth: half the low-pass on what is asked for [Hz].

    Raises:
        ConfigError: unknown joints, fewer than 8 frames, mink is missing.
        PoiseError: no posture keeps the soles and the limits.
    """
    limbs, stride = find_limbs(robot), 1.0
    while True:
        tracks = find_tracks(clip, robot, limbs, SWIFTER * smooth, stride)
        solved = _solver()(robot, limbs, tracks, SWIFTER * smooth)
        if solved.sole_error < OFF or stride * SHORTER < SHORTEST:
            break
        stride *= SHORTER
    joints = solved.qpos[:, 7:]
    low, high = robot.joint_range.T
    about = About(robot.name, robot.fingerprint, clip.name, clip.name, clip.licence)
    return Retargeted(
        RobotClip(about, RATE, solved.qpos, tracks.planted),
        limbs.leg_length / clip.skeleton.leg_length,
        solved.sole_error,
        solved.direction_error,
        solved.penetration,
        solved.time_per_frame,
        float(max(np.maximum(low - joints, joints - high).max(), 0.0)),
        stride,
        0.0,
    )


def find_tracks(
    clip: Clip, robot: Robot, limbs: Limbs, cutoff: float, stride: float = 1.0
) -> Tracks:
    """Where a clip leads a robot, low-passed at `cutoff` [Hz].

    Ways over the ground are `stride` times as long as the legs' ratio has them. Errors as of
    `retarget_freely`.
    """
    stood = measure_contacts(clip).planted
    clip = over_ground(clip).faced()
    clip, times = clip.resampled(RATE), clip.times
    nearest = np.abs(clip.times[:, None] - times).argmin(axis=1)
    stood, facing = stood[nearest], np.unwrap(clip.facing())
    body = clip_targets(clip, limbs.has_arms, cutoff, 0.0)
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(robot.model, data)
    mine = {role: point.place(data) for role, point in limbs.points.items()}
    roles, places = clip.skeleton.roles, clip.places()
    scale = limbs.leg_length / clip.skeleton.leg_length
    hips, feet = (np.stack([places[:, roles[f"{role}_{side}"]] for side in SIDES], axis=1)
                  for role in ("hip", "ankle"))  # fmt: skip
    floors = np.percentile(feet[..., 2], FLOOR, axis=0)
    pelvis = low_pass(hips.mean(axis=1), cutoff)
    height = pelvis[:, 2] - floors.mean()
    borne = height[stood.any(axis=1)] if stood.any() else height
    upright = max(float(borne.max()), UPRIGHT * clip.skeleton.leg_length)
    ground = mine["feet"][2]
    hip_height = (mine["pelvis"][2] - ground) * height / upright + ground
    root = np.column_stack([scale * stride * pelvis[:, :2], hip_height])
    ahead = np.column_stack([np.cos(facing), np.sin(facing)])
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    wider = scale * float(np.median(np.linalg.norm(hips[:, 0] - hips[:, 1], axis=1))) / 2.0
    first = int(np.argmax(foot_signs(robot)))
    ankles, yaws = np.empty((len(clip), 2, 3)), np.empty((len(clip), 2))
    planted = np.zeros((len(clip), 2), dtype=bool)
    for i, (side, sign) in enumerate(zip(SIDES, (1.0, -1.0), strict=True)):
        ankle, rise = feet[:, i], feet[:, i, 2] - floors[i]
        yaw, flat = facing.copy(), ankle
        if f"toe_{side}" in roles:
            toe = places[:, roles[f"toe_{side}"]]
            yaw, flat = _heading(toe - ankle, facing), toe.copy()
            length = np.percentile(np.linalg.norm((toe - ankle)[:, :2], axis=1), 90.0)
            flat[:, :2] -= length * np.column_stack([np.cos(yaw), np.sin(yaw)])
            rise = np.minimum(rise, toe[:, 2] - np.percentile(toe[:, 2], FLOOR))
        beside = abs(float(mine[f"ankle_{side}"][1] - mine["pelvis"][1]))
        away = scale * (flat - pelvis)[:, :2]
        across = np.maximum(sign * (away * left).sum(axis=1) - wider + beside, NARROW * beside)
        way = root[:, :2] + ahead * (stride * (away * ahead).sum(axis=1))[:, None]
        way += sign * left * across[:, None]
        own = np.column_stack([way, np.maximum(scale * rise, 0.0), yaw])
        foot = first if i == 0 else 1 - first
        own, planted[:, foot] = _resting(own, stood[:, i])
        ankles[:, foot] = own[:, :3] + [0.0, 0.0, mine[f"ankle_{side}"][2]]
        yaws[:, foot] = own[:, 3]
    return Tracks(body, root, ankles, yaws, planted)


def _heading(ways: np.ndarray, facing: np.ndarray) -> np.ndarray:
    """Headings (F,) of feet that point along (F, 3); while one is steep it turns as the hips do."""
    level = np.linalg.norm(ways[:, :2], axis=1) > FLAT * np.linalg.norm(ways, axis=1)
    turned = np.arctan2(ways[:, 1], ways[:, 0]) - facing
    turned = np.clip((turned + np.pi) % (2.0 * np.pi) - np.pi, -SPLAY, SPLAY)
    frames = np.arange(len(ways))
    return facing + (np.interp(frames, frames[level], turned[level]) if level.any() else 0.0)


def _resting(own: np.ndarray, stood: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A foot's way (F, 4) with rests in its stances, and (F,) when it rests: not while it turns."""
    rests, planted, frames = own.copy(), np.zeros(len(own), dtype=bool), np.arange(len(own))
    for a, b in stances_of(stood):
        stance = own[a : b + 1]
        middle = np.median(stance, axis=0) * [1.0, 1.0, 0.0, 1.0]
        held = np.abs(stance[:, 3] - middle[3]) < TURNED
        rests[a : b + 1][held] = middle
        planted[a : b + 1] = held
    if planted.any():
        off = rests - own
        for column in range(own.shape[1]):
            off[:, column] = np.interp(frames, frames[planted], off[planted, column])
        off[~planted, 2] = 0.0
        rests = own + off
    return rests, planted


def _solver() -> Any:  # the function `solve_tracks`
    try:
        from .solve_tracks import solve_tracks
    except ImportError as error:
        raise ConfigError(f"needs the package {error.name}: {how_to_install('motion')}",
                          source="motion") from None  # fmt: skip
    return solve_tracks
