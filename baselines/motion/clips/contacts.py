"""What a clip's feet do: where they are planted, how much they skate, how deep they sink."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter

from .clip import Clip
from .skeleton import SIDES

SLOW = 0.15  # [m/s] a planted toe is slower
LOW = 0.08  # [m] a planted toe is nearer to the floor
STEADY = 0.2  # [s] shorter changes are noise
FLOOR = 2.0  # percentile of the lowest points that is the floor: noise goes below it
IN_PLACE = 0.12  # [m] a planted foot may wander in the capture


class Contacts(NamedTuple):
    """Feet of a clip, left and right.

    Attributes:
        planted: (F, 2) whether the foot stands.
        skating: mean horizontal speed of planted toes [m/s]; 0 without any.
        skating_largest: largest of these speeds.
        floor: height of the floor [m].
        penetration: how far the lowest point goes below the floor [m].
        wander: (2,) largest distance of the toe from its median place [m].
    """

    planted: np.ndarray
    skating: float
    skating_largest: float
    floor: float
    penetration: float
    wander: np.ndarray

    @property
    def in_place(self) -> bool:
        """True if both feet stay where they are."""
        return bool(self.wander.max() < IN_PLACE)


def measure_contacts(clip: Clip) -> Contacts:
    """Planted feet: toes that are slower than 0.15 m/s and less than 8 cm above their lowest place.

    Times of less than 0.2 s count as what is around them. A skeleton without toes has its
    ankles for them. Raises ConfigError for a skeleton whose feet are not known by name.
    """
    skeleton = clip.skeleton
    places, turns = skeleton.global_pose(clip.root, clip.rotations)
    toes = np.stack([places[:, _toe(clip, side)] for side in SIDES], axis=1)
    lowest = np.concatenate([toes, skeleton.ends(places, turns)], axis=1)[..., 2].min(axis=1)
    speeds = np.linalg.norm(np.gradient(toes, clip.dt, axis=0), axis=2)
    heights = toes[..., 2] - np.percentile(toes[..., 2], FLOOR, axis=0)
    width = 2 * int(0.5 * STEADY / clip.dt) + 1
    planted = median_filter(((speeds < SLOW) & (heights < LOW)).astype(np.uint8), (width, 1)) > 0
    skating = np.linalg.norm(np.gradient(toes[..., :2], clip.dt, axis=0), axis=2)[planted]
    floor = float(np.percentile(lowest, FLOOR))
    return Contacts(
        planted,
        float(skating.mean()) if skating.size else 0.0,
        float(skating.max(initial=0.0)),
        floor,
        float(max(floor - lowest.min(), 0.0)),
        np.linalg.norm(toes - np.median(toes, axis=0), axis=2).max(axis=0),
    )


def _toe(clip: Clip, side: str) -> int:
    toe = f"toe_{side}"
    return clip.skeleton.joint(toe if toe in clip.skeleton.roles else f"ankle_{side}", clip.name)
