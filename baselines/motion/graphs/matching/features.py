"""What frames are compared by, seen from where the body stands and faces [Notes, lectures 5, 6]."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.baselines.motion.clips.skeleton import SIDES

AHEAD = (0.5, 1.0)  # [s] after which place and heading are features
SWAY = 0.3  # [s] standard deviation of the filter that takes the hips' sway out of the heading
LIMBS = tuple(f"{role}_{side}" for role in ("wrist", "ankle") for side in SIDES)


class Group(NamedTuple):
    """Features of one kind: how many, and how much they count by default."""

    name: str
    size: int
    weight: float


#: the groups before those of the future, in the order of the columns
GROUPS = (
    Group("velocity", 3, 1.0),  # of the root [m/s]
    Group("turning", 1, 1.0),  # of the heading [rad/s]
    Group("limbs", 3 * len(LIMBS), 0.75),  # places of wrists and ankles from below the root [m]
    Group("limb_velocities", 3 * len(LIMBS), 1.0),  # [m/s]
    Group("contacts", len(SIDES), 0.5),  # whether a foot is planted
)
FUTURE = (Group("place", 2, 2.0), Group("direction", 2, 1.5))  # of every time ahead


def feature_groups(ahead: tuple[float, ...] = AHEAD) -> tuple[Group, ...]:
    """All groups in the order of the columns; those of the future are called ``place@0.5``."""
    return GROUPS + tuple(Group(f"{group.name}@{time:g}", group.size, group.weight)
                          for time in ahead for group in FUTURE)  # fmt: skip


def clip_features(clip: Clip, ahead: tuple[float, ...] = AHEAD) -> np.ndarray:
    """(F, n) features of every frame in its own facing frame, in the order of `feature_groups`.

    The facing frame stands below the root, x along `steady_heading`. The heading ahead is the unit
    vector (cos, sin) of how far it has turned by then. Ahead of its end a clip goes on as it ends.

    Raises:
        ConfigError: hips, wrists or ankles that are not known by name.
    """
    heading, places = steady_heading(clip), clip.places()
    joints = [clip.skeleton.joint(role, clip.name) for role in LIMBS]
    limbs, root = places[:, joints], places[:, 0]
    below = root * np.array([1.0, 1.0, 0.0])
    columns = [
        seen_from(heading, _rate(root, clip.dt)),
        _rate(heading[:, None], clip.dt),
        seen_from(heading[:, None], limbs - below[:, None]).reshape(len(clip), -1),
        seen_from(heading[:, None], _rate(limbs, clip.dt)).reshape(len(clip), -1),
        measure_contacts(clip).planted.astype(float),
    ]
    for time in ahead:
        then = np.minimum(np.arange(len(clip)) + round(time / clip.dt), len(clip) - 1)
        turned = heading[then] - heading
        columns.append(seen_from(heading, below[then] - below)[:, :2])
        columns.append(np.stack([np.cos(turned), np.sin(turned)], axis=1))
    return np.concatenate(columns, axis=1)


def steady_heading(clip: Clip) -> np.ndarray:
    """(F,) where the hips face [rad], unwrapped, without their sway from step to step.

    Hips turn by ± 0.1 to 0.2 rad in a fast walk. Seen from there the same walk leads to the left
    and to the right in turn, and a command straight ahead is nearest to one moment of a stride.
    """
    heading = np.unwrap(clip.facing())
    return np.asarray(gaussian_filter1d(heading, SWAY / clip.dt, mode="nearest"))


def seen_from(heading: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (…, 3) of the world along the axes of facing frames with headings (…) [rad]."""
    cos, sin = np.cos(heading), np.sin(heading)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack(np.broadcast_arrays(cos * x + sin * y, cos * y - sin * x, z), axis=-1)


def _rate(values: np.ndarray, dt: float) -> np.ndarray:
    return np.gradient(values, dt, axis=0)
