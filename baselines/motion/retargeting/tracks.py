"""Where a clip of a biped leads a robot's pelvis and soles, wherever it goes, turns or leaps."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.footing import stances_of
from poise.baselines.balance.references.legs import foot_signs, nominal_feet
from poise.baselines.balance.references.robot_clip import RATE
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import FLOOR, measure_contacts, over_ground
from poise.baselines.motion.clips.rotations import heading_angle
from poise.baselines.motion.clips.skeleton import SIDES
from poise.envs.robots.robot import Robot

from .limbs import Limbs
from .targets import UPRIGHT, BodyTargets, clip_targets, low_pass

FLAT = 0.6  # of a foot's length that is seen from above: less, and its heading says nothing
TURNED, SPLAY = 0.35, 1.2  # [rad] by which a foot turns as it stands, at most; and from the hips
NARROW = 0.8  # of the feet's distance from the middle as the robot stands: they get no nearer
FAR, ALONG = 0.3, 0.35  # [m] way of a clip that goes somewhere; [rad] from where it faces
FACING = 1.2  # [s] from whose headings that of the begin is found


class Tracks(NamedTuple):
    """Where a robot's pelvis and soles go in F frames.

    Attributes:
        body: directions of the segments.
        pelvis: (F, 3) the middle of the hips [m].
        ankles: (F, 2, 3) where ankles are if soles are level, by the robot's soles [m].
        soles: (F, 2, 3) where the soles' points are then.
        yaws: (F, 2) headings of the soles [rad].
        planted: (F, 2) bool.
    """

    body: BodyTargets
    pelvis: np.ndarray
    ankles: np.ndarray
    soles: np.ndarray
    yaws: np.ndarray
    planted: np.ndarray


def find_tracks(
    clip: Clip, robot: Robot, limbs: Limbs, cutoff: float, stride: float = 1.0,
    spread: float = 1.0,
) -> Tracks:  # fmt: skip
    """Where a clip leads a robot, low-passed at `cutoff` [Hz].

    Ways over the ground are `stride` times as long as the legs' ratio has them, and feet `spread`
    times as much further apart than in standing.

    Raises ConfigError for joints that are not known by name, or fewer than 8 frames.
    """
    stood = measure_contacts(clip).planted
    clip = over_ground(clip)
    clip = clip.turned(-first_heading(clip))
    clip = clip.moved(-clip.root[0] * [1.0, 1.0, 0.0])
    clip, times = clip.resampled(RATE), clip.times
    nearest = np.abs(clip.times[:, None] - times).argmin(axis=1)
    stood, facing = stood[nearest], np.unwrap(clip.facing())
    body = clip_targets(clip, limbs.has_arms, cutoff, 0.0)
    mine, roles, places = limbs.standing, clip.skeleton.roles, clip.places()
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
        across = beside + spread * (sign * (away * left).sum(axis=1) - wider)
        across = np.maximum(across, NARROW * beside)
        way = root[:, :2] + ahead * (stride * (away * ahead).sum(axis=1))[:, None]
        way += sign * left * across[:, None]
        own = np.column_stack([way, np.maximum(scale * rise, 0.0), yaw])
        foot = first if i == 0 else 1 - first
        own, planted[:, foot] = _resting(own, stood[:, i])
        ankles[:, foot] = own[:, :3] + [0.0, 0.0, mine[f"ankle_{side}"][2]]
        yaws[:, foot] = own[:, 3]
    away = nominal_feet(robot)[[first, 1 - first]]
    away = away - [mine[f"ankle_{side}"] for side in SIDES]  # of the soles' points, left first
    turns = Rotation.from_euler("z", yaws.reshape(-1, 1))
    away = turns.apply(np.tile(away[[first, 1 - first]], (len(clip), 1))).reshape(-1, 2, 3)
    return Tracks(body, root, ankles, ankles + away, yaws, planted)


def first_heading(clip: Clip) -> float:
    """Where a clip faces at its begin [rad]: on the line through 1.2 s, since hips swing.

    Or where it goes, if that is within 20° and it does not turn by 45°.
    """
    facing, count = np.unwrap(clip.facing()), int(np.searchsorted(clip.times, FACING))
    first = float(np.polyfit(clip.times[:count], facing[:count], 1)[1])
    way = clip.root[-1] - clip.root[0]
    beside = float(heading_angle(way) - first + np.pi) % (2.0 * np.pi) - np.pi
    straight = np.linalg.norm(way[:2]) > FAR and np.ptp(facing) < np.pi / 4.0
    return first + beside if straight and abs(beside) < ALONG else first


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
