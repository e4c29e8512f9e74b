"""EUROBENCH's indicators of balance after a push, for simulated subjects.

Body sway and recovery time are those of the protocol "Perturbed balance assessment" [BenchBalance],
the stability margin and the normalisation by size those of "Reaction to impulsive disturbance"
[Monteleone23]; both are part of the EUROBENCH protocols, github.com/eurobench/eurobench_protocol.
Choices that the protocols leave open are documented here.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # loads its parts lazily: workers need none of them
from numpy.typing import ArrayLike

CUTOFF = 10.0  # [Hz] of the second-order Butterworth low-pass
QUIET_SWAY = 0.015  # [rad/s] below which the body has recovered
FALLS = 0.3  # fraction of falls at which a level is lost
RUNS = 10  # of a level, at least

# The protocol's human of medium size.
HUMAN_MASS = 81.4  # [kg]
HUMAN_DEPTH = 0.111  # half the base, to the front [m]
HUMAN_WIDTH = 0.333 / 2  # half the base, to the side [m]


def _human_com_height() -> float:
    """[m], from masses [kg] and heights [m] of the segments in the protocol's own code."""
    single = [(4.2, 1.679), (1.1, 1.545), (24.9, 1.308), (2.4, 1.099), (11.8, 0.983)]
    arms = [(2.0, 1.462 - 0.177), (1.4, 1.462 - 0.435), (0.5, 1.462 - 0.67)]
    pairs = [*arms, (9.8, 0.75), (3.8, 0.33), (1.0, 0.028)]
    moments = sum(m * h for m, h in single) + 2 * sum(m * h for m, h in pairs)
    return moments / (sum(m for m, _ in single) + 2 * sum(m for m, _ in pairs))


HUMAN_COM_HEIGHT = _human_com_height()


@dataclass(frozen=True)
class Size:
    """The sizes of a robot that the normalisation needs."""

    mass: float  #: [kg]
    com_height: float  #: of the standing posture [m]
    reach: float  #: half the base of support in the direction of the push [m]


def sway_angle(com: ArrayLike, ankles: ArrayLike, direction: ArrayLike) -> np.ndarray:
    """Return the angle (n,) [rad] of the line from the ankles to the CoM, from the vertical.

        θ = atan2((c − a)·d, (c − a)·e_z)

    in the vertical plane of the push: the protocol's sagittal or frontal plane, for any direction.

    Args:
        com: (n, 3) c [m].
        ankles: (n, 3) a, the middle between the two ankles [m].
        direction: (2,) d, horizontal direction of the push.
    """
    line = np.asarray(com, dtype=float) - np.asarray(ankles, dtype=float)
    d = np.asarray(direction, dtype=float)
    return np.arctan2(line[:, :2] @ (d / np.linalg.norm(d)), line[:, 2])


def body_sway(angle: ArrayLike, start: int) -> float:
    """Return the largest |θ − θ_rest| [rad] from index `start`, where the push begins and θ_rest is
    read."""
    angle = np.asarray(angle, dtype=float)
    return float(np.max(np.abs(angle[start:] - angle[start])))


def sway_velocity(angle: ArrayLike, rate: float) -> np.ndarray:
    """θ̇ (n,) [rad/s] of the low-passed angle: Butterworth, second order, 10 Hz.

    The filter runs forwards and backwards, so that it does not delay; then central differences.

    Args:
        angle: (n,) samples [rad].
        rate: samples per second; more than 20.
    """
    angle = np.asarray(angle, dtype=float)
    b, a = scipy.signal.butter(2, CUTOFF, fs=rate)
    return np.gradient(scipy.signal.filtfilt(b, a, angle), 1.0 / rate)


def recovery_time(angle: ArrayLike, start: int, rate: float) -> float | None:
    """Return the seconds from the push until |θ̇| falls below 0.015 rad/s for good; None if it does
    not.

    The protocol takes the first moment below; after a push that is where the sway turns, so the
    last moment above counts here. A quiet second must follow.
    """
    fast = np.flatnonzero(np.abs(sway_velocity(angle, rate)[start:]) >= QUIET_SWAY)
    left = len(np.asarray(angle)) - start
    end = int(fast[-1]) + 1 if fast.size else 0
    return end / rate if left - end >= rate else None


def stability_margin(levels: ArrayLike, fallen: ArrayLike) -> float | None:
    """Return the largest level below which, and at which, fewer than 30 % of ≥ 10 runs fall.

    The protocol asks for the largest level that the agent withstands. A level beyond one that is
    lost does not count: levels are gone through upwards to the first that is lost.

    Args:
        levels: (n,) amplitude of each run; equal values make one level.
        fallen: (n,) whether it fell.

    Returns the level, 0 if the lowest is lost, None if no level has ten runs.
    """
    levels, fallen = np.asarray(levels, dtype=float), np.asarray(fallen, dtype=bool)
    tried = [v for v in np.unique(levels) if np.count_nonzero(levels == v) >= RUNS]
    margin = 0.0
    for level in tried:
        if np.mean(fallen[levels == level]) >= FALLS:
            break
        margin = float(level)
    return margin if tried else None


def force_factor(size: Size, reach_of_human: float) -> float:
    """K_F = (m/m_h)(d/d_h)(h_h/h): a force over it is that on a human of medium size.

    Static tipping of a body of mass m, CoM height h and half base d by F at h: F = m g d/h.
    """
    return float(
        size.mass / HUMAN_MASS * size.reach / reach_of_human * HUMAN_COM_HEIGHT / size.com_height
    )


def energy_factor(size: Size, reach_of_human: float) -> float:
    """K_E = (m/m_h) (√(d² + h²) − h)/(√(d_h² + h_h²) − h_h), the energies that tip the bodies."""

    def rise(reach: float, height: float) -> float:
        return float(np.hypot(reach, height) - height)

    tip = rise(size.reach, size.com_height) / rise(reach_of_human, HUMAN_COM_HEIGHT)
    return float(size.mass / HUMAN_MASS * tip)


def human_reach(direction: float) -> float:
    """Return half the human's base [m] in a direction [deg], of the frontal or the lateral case."""
    return HUMAN_DEPTH if abs(np.cos(np.radians(direction))) > np.sqrt(0.5) else HUMAN_WIDTH
