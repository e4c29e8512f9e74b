"""Postures between some of a clip's frames, by the name of an interpolation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import RotationSpline

from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.rotations import from_scipy, inverse, multiply, slerp, to_scipy
from poise.configs.errors import ConfigError, shown
from poise.envs.compiled.maths.interpolation import curve_through

from .states import exp, log, vector_rate

#: name → the curve of the root's places
KINDS = {"linear": "linear", "slerp": "linear", "hermite": "hermite",
         "catmull-rom": "catmull-rom", "cubic": "cubic"}  # fmt: skip


def between_keyframes(clip: Clip, frames: np.ndarray, kind: str) -> Clip:
    """The clip with only some of its frames as keyframes, the others filled in.

    linear       quaternions straight from one to the next and normalised: not of constant speed
    slerp        constant speed on the shorter way; C⁰
    hermite      q Exp(H(s)), H a cubic Hermite curve, at rest in every keyframe; C¹
    catmull-rom  the same, with the mean rate over both neighbours, at rest at both ends; C¹
    cubic        SciPy's `RotationSpline`, whose angular acceleration is continuous; C²

    Args:
        clip: whose root is filled in likewise, see `clips.interpolation`.
        frames: two or more numbers of frames, increasing; the clip is cut to what they span.
        kind: the name.

    Raises:
        ConfigError: no such kind; numbers that are no frames, or not in order.
    """
    if kind not in KINDS:
        raise ConfigError(f"no such kind: {shown(kind)}", field="interpolation", choices=KINDS)
    keys = np.asarray(frames)
    whole = keys.ndim == 1 and len(keys) >= 2 and keys.dtype.kind in "iu"
    if not whole or keys[0] < 0 or keys[-1] >= len(clip) or np.any(np.diff(keys) < 1):
        raise ConfigError(f"must be two or more of 0 to {len(clip) - 1}, in order, not "
                          f"{shown(frames)}", source=clip.name, field="frames")  # fmt: skip
    times, at = keys * clip.dt, np.arange(keys[0], keys[-1] + 1) * clip.dt
    root = curve_through(KINDS[kind], times, clip.root[keys])(at)
    rotations = _between(kind, times, clip.rotations[keys], at)
    return replace(clip, root=root, rotations=rotations)


def _between(kind: str, times: np.ndarray, keys: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Rotations (n, J, 4) at times (n,) between keys (k, J, 4) at times (k,)."""
    if kind == "cubic":
        columns = [RotationSpline(times, to_scipy(keys[:, j]))(at) for j in range(keys.shape[1])]
        return np.stack([from_scipy(column, (len(at),)) for column in columns], axis=1)
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    spans = np.diff(times)
    u = ((at - times[before]) / spans[before])[:, None]
    first, second = keys[before], keys[before + 1]
    if kind == "slerp":
        return slerp(first, second, u)
    if kind == "linear":
        return _nlerp(first, second, u[..., None])
    gaps = log(multiply(inverse(keys[:-1]), keys[1:]))  # (k − 1, J, 3)
    rates = np.zeros((*keys.shape[:2], 3))
    if kind == "catmull-rom":
        rates[1:-1] = _mean_rates(keys, times)
    starts = spans[:, None, None] * rates[:-1]
    ends = spans[:, None, None] * vector_rate(gaps, rates[1:])
    curve = _cubic(gaps[before], starts[before], ends[before], u[..., None])
    return multiply(first, exp(curve))


def _cubic(gap: np.ndarray, start: np.ndarray, end: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The Hermite curve from 0 to `gap` with slopes `start` and `end`, at s from 0 to 1."""
    return s * (start + s * (3.0 * gap - 2.0 * start - end + s * (start + end - 2.0 * gap)))


def _mean_rates(keys: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(k − 2, J, 3) angular velocities of inner keys, in their axes: the neighbours' as seen from
    them, Log(q⁻¹ q₊) − Log(q⁻¹ q₋), over the time between these."""
    back = inverse(keys[1:-1])
    ahead, behind = log(multiply(back, keys[2:])), log(multiply(back, keys[:-2]))
    return (ahead - behind) / (times[2:] - times[:-2])[:, None, None]


def _nlerp(a: np.ndarray, b: np.ndarray, u: np.ndarray) -> np.ndarray:
    near = np.where((a * b).sum(axis=-1, keepdims=True) < 0.0, -b, b)
    mixed = (1.0 - u) * a + u * near
    return mixed / np.linalg.norm(mixed, axis=-1, keepdims=True)
