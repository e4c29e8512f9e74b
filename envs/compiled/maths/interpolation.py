"""Curves through keyframes, by name [Notes, lecture 4]."""

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline, KroghInterpolator, PPoly

from poise.configs.errors import ConfigError, shown

#: name → how smooth it is
KINDS = {"linear": 0, "hermite": 1, "catmull-rom": 1, "cubic": 2, "polynomial": 2}
FINE = 0.02  # [s] between the knots of a polynomial's cubic pieces
MOST_OF_POLYNOMIAL = 16  # keyframes: beyond, rounding is worse than Runge's phenomenon


def curve_through(
    kind: str, times: np.ndarray, values: np.ndarray, rates: np.ndarray | None = None
) -> PPoly:
    """Cubic pieces through `values` (n, m) at increasing `times` (n,) [s], n ≥ 2.

    linear       straight from one to the next; C⁰
    hermite      with the given rates (n, m), or at rest in every keyframe; C¹
    catmull-rom  with the rates (y₊ − y₋)/(t₊ − t₋) of the neighbours, at rest at both ends; C¹
    cubic        the spline that is C², at rest at both ends
    polynomial   one of degree n − 1 through all, which overshoots near the ends where n is large
                 (Runge): in cubic pieces of at most 0.02 s with its values and rates

    Raises:
        ConfigError: no such kind, rates for another kind than hermite, a polynomial through more
            than 16 keyframes.
    """
    if kind not in KINDS:
        raise ConfigError(f"no such kind: {shown(kind)}", field="interpolation", choices=KINDS)
    if rates is not None and kind != "hermite":
        raise ConfigError(f"{kind!r} takes no rates", field="interpolation", choices=("hermite",))
    if kind == "linear":
        slopes = np.diff(values, axis=0) / np.diff(times)[:, None]
        return PPoly(np.stack([slopes, values[:-1]]), times)
    if kind == "cubic":
        return CubicSpline(times, values, bc_type="clamped")
    if kind == "polynomial":
        return _polynomial(times, values)
    slopes = np.zeros_like(values) if rates is None else rates
    if kind == "catmull-rom":
        slopes = slopes.copy()
        slopes[1:-1] = (values[2:] - values[:-2]) / (times[2:] - times[:-2])[:, None]
    return CubicHermiteSpline(times, values, slopes)


def _polynomial(times: np.ndarray, values: np.ndarray) -> PPoly:
    if len(times) > MOST_OF_POLYNOMIAL:
        raise ConfigError(f"a polynomial goes through at most {MOST_OF_POLYNOMIAL} keyframes, not "
                          f"{len(times)}", field="interpolation", choices=KINDS)  # fmt: skip
    counts = np.maximum(np.ceil(np.diff(times) / FINE).astype(int), 1)
    fine = [np.linspace(a, b, n, endpoint=False)
            for a, b, n in zip(times[:-1], times[1:], counts, strict=True)]  # fmt: skip
    knots = np.append(np.concatenate(fine), times[-1])
    whole = KroghInterpolator(times, values)
    return CubicHermiteSpline(knots, whole(knots), whole.derivative(knots))
