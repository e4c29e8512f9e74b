"""Footfalls of a motion: when each foot lands, and where from the foot beside it."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from .footing import Footing


class Footfalls(NamedTuple):
    """The columns of footfalls (n, 4) by name: `Footfalls(*rows.T)`."""

    time: np.ndarray  #: [s]
    foot: np.ndarray  #: its index
    ahead: np.ndarray  #: in the axes of the other foot's sole [m]
    left: np.ndarray  #: [m]


COLUMNS = len(Footfalls._fields)


def footfalls(
    times: np.ndarray, places: np.ndarray, turns: np.ndarray, planted: np.ndarray
) -> np.ndarray:
    """(n, 4) the footfalls of F frames, of the columns of `Footfalls`, in order.

    Args:
        times: (F,) [s], rising.
        places: (F, 2, 3) of the soles' points [m].
        turns: (F, 2, 3) rotation vectors of the soles from standing, which faces along x [rad].
        planted: (F, 2) which soles are on the ground. One that is in the first frame has not
            landed.
    """
    lands = np.argwhere(planted[1:] & ~planted[:-1]) + [1, 0]
    return np.array(
        [(times[k], foot, *step_vector(places[k], turns[k], int(foot))) for k, foot in lands]
    ).reshape(-1, COLUMNS)


def step_vector(places: np.ndarray, turns: np.ndarray, foot: int) -> np.ndarray:
    """(2,) where a foot is from the other one, along the other one's sole and to its left [m].

    `places` (2, 3) are of the soles' points [m], `turns` (2, 3) rotation vectors [rad].
    """
    axes = Rotation.from_rotvec(turns[1 - foot]).as_matrix()
    ahead = axes[:2, 0] / np.linalg.norm(axes[:2, 0])
    away = (places[foot] - places[1 - foot])[:2]
    return np.array([ahead @ away, ahead[0] * away[1] - ahead[1] * away[0]])


def landings(footing: Footing) -> np.ndarray:
    """(n, 4) the footfalls of a motion with steps, of the columns of `Footfalls`."""
    samples = [footing.sample(float(time)) for time in footing.switches]
    if not samples:
        return np.empty((0, COLUMNS))
    times = np.concatenate([[-np.inf], footing.switches])
    places, turns = (np.stack([getattr(sample, name)[:, 0] for sample in [samples[0], *samples]])
                     for name in ("places", "turns"))  # fmt: skip
    return footfalls(times, places, turns, footing.planted > 0)
