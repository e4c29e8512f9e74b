"""What a clip's feet do: where they are planted, how much they skate, how deep they sink."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from poise.envs.compiled.maths.runs import runs_of

from .clip import Clip
from .skeleton import SIDES

LEG = 0.8  # [m] legs for which these hold; they grow with the legs, speeds with their root
SLOW = 0.65  # [m/s] a planted toe, or heel, is slower
SHARE = 0.15  # or slower than so much of the speed that feet get to: low rates blur running
LOW = 0.05  # [m] and nearer to where it is when it stands
NOISE = 0.04  # [s] over which places are averaged before they are differentiated
STEADY = 0.12  # [s] shorter changes are noise
BELT, STAYS = 0.3, 0.25  # [m/s] least speed of a treadmill; of its way by which hips may move on it
FLOOR = 2.0  # percentile of the lowest points that is the floor: noise goes below it
IN_PLACE = 0.12  # [m] a planted foot may wander in the capture
HOP = 0.1  # [s] without a planted foot: what is shorter throughout is no jump


class Contacts(NamedTuple):
    """Feet of a clip, left and right.

    Attributes:
        planted: (F, 2) whether the foot stands.
        skating: mean horizontal speed of the slower of toe and heel of planted feet [m/s].
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
    """Planted feet: those whose toe or heel is slow and within 5 cm of its floor.

    Slow is below 0.65 m/s, or 0.15 of the 95th percentile of these speeds. The floor of a toe, or
    of an ankle, is the 2nd percentile of its heights. Bounds are for legs of 0.8 m. Times of less
    than 0.12 s count as what is around them. A clip on a treadmill is taken `over_ground`. A
    skeleton without toes has its ankles for them.

    Raises ConfigError for a skeleton whose feet are not known by name.
    """
    clip = over_ground(clip)
    skeleton, size = clip.skeleton, clip.skeleton.leg_length / LEG
    places, turns = skeleton.global_pose(clip.root, clip.rotations)
    points = places[:, _foot_points(clip)]  # (F, 2, 2, 3): toe and ankle of either foot
    toes = points[:, :, 0]
    lowest = np.concatenate([toes, skeleton.ends(places, turns)], axis=1)[..., 2].min(axis=1)
    speeds = np.linalg.norm(_velocities(points, clip.dt), axis=3)
    slow = max(SLOW * np.sqrt(size), SHARE * float(np.percentile(speeds, 95.0)))
    stands = (speeds < slow) & (_heights(points) < LOW * size)
    width = 2 * int(0.5 * STEADY / clip.dt) + 1
    planted = median_filter(stands.any(axis=2).astype(np.uint8), (width, 1), mode="nearest") > 0
    skating = np.linalg.norm(np.gradient(points[..., :2], clip.dt, axis=0), axis=3)
    skating = skating.min(axis=2)[planted]
    floor = float(np.percentile(lowest, FLOOR))
    return Contacts(
        planted,
        float(skating.mean()) if skating.size else 0.0,
        float(skating.max(initial=0.0)),
        floor,
        float(max(floor - lowest.min(), 0.0)),
        np.linalg.norm(toes - np.median(toes, axis=0), axis=2).max(axis=0),
    )


def longest_flight(planted: np.ndarray, dt: float) -> tuple[int, float]:
    """First frame and duration [s] of the longest time without a planted foot; 0 s without any."""
    in_air = np.asarray(~planted.any(axis=1))
    flights = [(after - first, first) for first, after in runs_of(in_air).tolist()]
    frames, first = max(flights, key=lambda flight: flight[0], default=(0, 0))
    return first, frames * dt


def grounded(planted: np.ndarray, dt: float) -> np.ndarray:
    """(F, 2) planted feet without flights, where none of these lasts 0.1 s, as in many dances.

    The feet that lifted off last stay down until the next one lands; at the begin those that land.
    Of more flights than half of the steps nothing is taken: that is a run.
    """
    flights = runs_of(np.asarray(~planted.any(axis=1))).tolist()
    steps = int(np.sum(np.diff(planted.astype(int), axis=0) > 0))
    if longest_flight(planted, dt)[1] >= HOP or len(flights) > 0.5 * steps:
        return planted
    down = planted.copy()
    for first, after in flights:
        down[first:after] = down[first - 1] if first else down[min(after, len(down) - 1)]
    return down


def over_ground(clip: Clip) -> Clip:
    """A clip that walks or runs where it is, as on a treadmill, goes on; others stay as they are.

    The ground's velocity is the median of that of the lowest toe or ankle. It is taken off where it
    is above 0.3 m/s and the hips move by less than a quarter of its way.
    """
    points = clip.places()[:, _foot_points(clip)].reshape(len(clip), -1, 3)
    heights, frames = _heights(points), np.arange(len(clip))
    lowest = _velocities(points, clip.dt)[frames, heights.argmin(axis=1), :2]
    belt = np.median(lowest, axis=0)
    speed, moved = float(np.linalg.norm(belt)), float(np.ptp(clip.root[:, :2], axis=0).max())
    if speed < BELT or moved > STAYS * speed * clip.duration:
        return clip
    return replace(clip, root=clip.root - clip.times[:, None] * np.append(belt, 0.0))


def _heights(points: np.ndarray) -> np.ndarray:
    """Heights (F, …) of points (F, …, 3) over where each stands [m]."""
    return np.asarray(points[..., 2] - np.percentile(points[..., 2], FLOOR, axis=0))


def _velocities(points: np.ndarray, dt: float) -> np.ndarray:
    """Velocities (F, …, 3) of points [m/s], without the noise of high rates."""
    smooth = uniform_filter1d(points, 2 * int(0.5 * NOISE / dt) + 1, axis=0, mode="nearest")
    return np.asarray(np.gradient(smooth, dt, axis=0))


def _foot_points(clip: Clip) -> np.ndarray:
    """(2, 2) toe and ankle, left and right; without a toe the ankle twice."""
    known, joint = clip.skeleton.roles, clip.skeleton.joint
    ankles = [f"ankle_{side}" for side in SIDES]
    toes = [toe if (toe := f"toe_{side}") in known else f"ankle_{side}" for side in SIDES]
    return np.array([[joint(role, clip.name) for role in pair]
                     for pair in zip(toes, ankles, strict=True)])  # fmt: skip
