"""Postures of a skeleton, their differences, and their rates at a time of a clip."""

from typing import NamedTuple

import numpy as np

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.rotations import exp, inverse, log, multiply, rotate


class State(NamedTuple):
    """A posture and how it changes. Tangents have the root first, then three of each joint.

    Attributes:
        root: (3,) place of the root [m].
        rotations: (J, 4) of the joints, scalar first.
        rate: (3 + 3J,) [m/s, rad/s]; of a joint the angular velocity in its own axes.
        acceleration: (3 + 3J,) the rate's [m/s², rad/s²].
    """

    root: np.ndarray
    rotations: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray


def minus(
    root: np.ndarray, rotations: np.ndarray, from_root: np.ndarray, from_rotations: np.ndarray
) -> np.ndarray:
    """(…, 3 + 3J) tangent that leads from a posture to another one: x − x₀ and Log(q₀⁻¹ q)."""
    turns = log(multiply(inverse(from_rotations), rotations))
    moved = np.asarray(root) - from_root
    return np.concatenate([moved, turns.reshape(*turns.shape[:-2], -1)], axis=-1)


def plus(
    root: np.ndarray, rotations: np.ndarray, tangent: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Posture (…, 3), (…, J, 4) at the end of tangents (…, 3 + 3J): x + v and q Exp(v)."""
    turns = tangent[..., 3:].reshape(*tangent.shape[:-1], -1, 3)
    return root + tangent[..., :3], multiply(rotations, exp(turns))


def quintic_rise(
    gap: np.ndarray, start: np.ndarray, end: np.ndarray, bend_a: np.ndarray, bend_b: np.ndarray
) -> np.ndarray:
    """(6, n) coefficients in s, lowest power first, of the curve of the fifth order from 0 at s = 0
    to `gap` (n,) at s = 1, with these first and second derivatives at both."""
    c3 = 10.0 * gap - 6.0 * start - 4.0 * end - 1.5 * bend_a + 0.5 * bend_b
    c4 = -15.0 * gap + 8.0 * start + 7.0 * end + 1.5 * bend_a - bend_b
    c5 = 6.0 * gap - 3.0 * (start + end) + 0.5 * (bend_b - bend_a)
    return np.array([np.zeros_like(gap), start, 0.5 * bend_a, c3, c4, c5])


def vector_rate(turn: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """ḣ (…, 3) for which Exp(h) has angular velocities (…, 3) in body axes: J_r(h)⁻¹ ω.

    J_r⁻¹ = I + ½ [h]× + (1/θ² − (1 + cos θ)/(2 θ sin θ)) [h]×², for angles below π.
    """
    angle = np.linalg.norm(turn, axis=-1, keepdims=True)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    half = 0.5 * safe
    factor = np.where(small, 1.0 / 12.0, (1.0 - half / np.tan(half)) / safe**2)
    once = np.cross(turn, rate)
    return rate + 0.5 * once + factor * np.cross(turn, once)


def state_at(clip: Clip, frame: int) -> State:
    """The state of a clip in a frame: differences over neighbours, one-sided at its ends.

    A clip of fewer than 3 frames has no acceleration.
    """
    steps = minus(clip.root[1:], clip.rotations[1:], clip.root[:-1], clip.rotations[:-1]) / clip.dt
    before, after = max(frame - 1, 0), min(frame, len(steps) - 1)
    if len(steps) > 1 and before == after:  # at an end: the next difference tells the bend
        inner = 1 if frame == 0 else before - 1
        bend = (steps[max(before, inner)] - steps[min(before, inner)]) / clip.dt
        rate = steps[before] + (0.5 if frame else -0.5) * clip.dt * bend
    else:
        bend = (steps[after] - steps[before]) / clip.dt
        rate = 0.5 * (steps[before] + steps[after])
    return State(clip.root[frame], clip.rotations[frame], rate, bend)


def turned_rate(turn: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Angular velocities (…, 3) of q(t) as q Exp(o) has them in its own axes: Exp(−o) ω."""
    return rotate(inverse(exp(turn)), rate)
