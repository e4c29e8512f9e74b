"""Start and goal states: the frames of clips that are nearest to a posture."""

from collections.abc import Mapping

import numpy as np

from poise.baselines.motion.graphs.joining.states import minus
from poise.configs.errors import ConfigError

from .adjacency import Frames
from .paths import Place

NEAR = 8.0  # [deg] that a frame may be away from a posture


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
