"""Frames of a clip as graphs see them, and those that are nearest to a posture: start and goal."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.baselines.motion.clips.rotations import about_z, multiply
from poise.baselines.motion.graphs.joining.coefficient import moved_shares
from poise.baselines.motion.graphs.joining.states import minus
from poise.configs.errors import ConfigError

from .paths import Place

SAMPLING = 1.0 / 15.0  # [s] between frames that are compared
NEAR = 8.0  # [deg] that a frame may be away from a posture


class Frames(NamedTuple):
    """Frames of a clip as the coefficient sees them, each facing x over the origin.

    Attributes:
        name: of the clip.
        times: (n,) [s].
        heights: (n, 3) of the root, 0 but for z [m].
        rotations: (n, J, 4).
        rates: (n, 3 + 3J) [m/s, rad/s].
        planted: (n, 2), or None where the feet are not known.
        masses: (3 + 3J,) for the coefficient.
        duration: of the clip [s].
        joints: their names.
        home: (n,) whether a clip with steps can be left or entered; None: always.
    """

    name: str
    times: np.ndarray
    heights: np.ndarray
    rotations: np.ndarray
    rates: np.ndarray
    planted: np.ndarray | None
    masses: np.ndarray
    duration: float
    joints: tuple[str, ...]
    home: np.ndarray | None = None


def frames_of(clip: Clip, sampling: float = SAMPLING, planted: bool | None = None) -> Frames:
    """A clip's frames about `sampling` [s] apart, the first and the last among them.

    `planted` says that both feet always stand, or do not; None measures it where feet are known. A
    clip that knows its contacts has them.

    Raises ConfigError if the skeleton's hips are not known by name.
    """
    stride = max(round(sampling / clip.dt), 1)
    chosen = np.unique(np.append(np.arange(0, len(clip), stride), len(clip) - 1))
    turn = np.array([about_z(-angle) for angle in clip.facing()])[chosen]
    rotations, rates = clip.rotations[chosen].copy(), all_rates(clip)[chosen]
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    cos, sin = np.cos(2 * np.arctan2(turn[:, 3], turn[:, 0])), 2 * turn[:, 0] * turn[:, 3]
    x, y = rates[:, 0].copy(), rates[:, 1].copy()
    rates[:, 0], rates[:, 1] = cos * x - sin * y, sin * x + cos * y
    heights = clip.root[chosen] * np.array([0.0, 0.0, 1.0])
    home = None if clip.support is None else clip.support.home[chosen]
    return Frames(clip.name, clip.times[chosen], heights, rotations, rates,
                  _planted(clip, chosen, planted), moved_shares(clip.skeleton), clip.duration,
                  clip.skeleton.names, home)  # fmt: skip


def all_rates(clip: Clip) -> np.ndarray:
    """(F, 3 + 3J) rates in all frames, as `state_at` has them."""
    steps = minus(clip.root[1:], clip.rotations[1:], clip.root[:-1], clip.rotations[:-1]) / clip.dt
    rates = np.empty((len(clip), steps.shape[1]))
    rates[1:-1] = 0.5 * (steps[1:] + steps[:-1])
    bends = (steps[1] - steps[0], steps[-1] - steps[-2]) if len(steps) > 1 else (0.0, 0.0)
    rates[0], rates[-1] = steps[0] - 0.5 * bends[0], steps[-1] + 0.5 * bends[1]
    return rates


def _planted(clip: Clip, chosen: np.ndarray, planted: bool | None) -> np.ndarray | None:
    if clip.support is not None:
        return clip.support.planted[chosen]
    if planted is not None:
        return np.full((len(chosen), 2), planted)
    try:
        return measure_contacts(clip).planted[chosen]
    except ConfigError:  # feet that are not known by name
        return None


def distances(frames: Frames, height: np.ndarray, rotations: np.ndarray) -> np.ndarray:
    """(n,) weighted root mean square [rad, m] of what leads from a posture to each frame."""
    gap = minus(frames.heights, frames.rotations, height, rotations)
    return np.asarray(np.sqrt(gap**2 @ frames.masses / frames.masses.sum()))


def nearest_places(
    frames: Mapping[str, Frames],
    posture: tuple[np.ndarray, np.ndarray],
    near: float = NEAR,
    price: float = 1.0,
) -> dict[Place, float]:
    """The nearest frame of every clip that comes within `near` [deg], with `price` times radians.

    Args:
        frames: of the clips.
        posture: height (3,) [m] and rotations (J, 4), facing x.

    Raises:
        ConfigError: none is near enough; the text names the nearest.
    """
    away: dict[Place, float] = {}
    for name, each in frames.items():
        gaps = distances(each, *posture)
        if each.home is not None:
            gaps = np.where(each.home, gaps, np.inf)
        best = int(np.argmin(gaps))
        away[name, float(each.times[best])] = float(gaps[best])
    found = {place: price * gap for place, gap in away.items() if np.degrees(gap) <= near}
    if not found:
        (name, time), gap = min(away.items(), key=lambda item: item[1])
        raise ConfigError(f"no clip comes within {near:g}° of it: the nearest is {name!r} at "
                          f"{time:.2f} s, {np.degrees(gap):.1f}° away")  # fmt: skip
    return found
