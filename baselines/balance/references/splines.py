"""Smooth interpolation of keyframes, and its table for the compiled tick."""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import BSpline, PPoly, make_interp_spline

from poise.envs.compiled.jit import compiled


def rest_spline(times: np.ndarray, values: np.ndarray) -> BSpline:
    """Cubic C² spline through `values` (n, m) at `times` (n,), n ≥ 2, at rest at both ends.

    A cubic spline through n points can meet two end conditions; one more knot near each end
    makes room for four: zero velocity and zero acceleration at both, so that holding the ends,
    or repeating the whole when first and last value agree, is C² as well.
    """
    if len(times) == 2:
        inner = times[0] + np.diff(times) * np.array([1.0, 2.0]) / 3.0
    else:
        middles = 0.5 * (times[[0, -2]] + times[[1, -1]])
        inner = np.sort(np.concatenate([times[1:-1], middles]))
    knots = np.concatenate([[times[0]] * 4, inner, [times[-1]] * 4])
    zero = np.zeros(values.shape[1:])
    rest = [(1, zero), (2, zero)]
    return make_interp_spline(times, values, k=3, t=knots, bc_type=(rest, rest))


def piecewise(splines: Sequence[BSpline | PPoly]) -> tuple[np.ndarray, np.ndarray]:
    """Knots (k+1,) and coefficients (k, 4, m) of cubic curves over one span, side by side.

    On [knots[i], knots[i+1]) the value is Σ_p coeffs[i, p] (t − knots[i])^p.
    """
    knots = np.unique(np.concatenate([s.t if isinstance(s, BSpline) else s.x for s in splines]))
    keep = np.concatenate([[True], np.diff(knots) > 1e-9 * (knots[-1] - knots[0])])
    knots = knots[keep]
    left, middle = knots[:-1], 0.5 * (knots[:-1] + knots[1:])
    return knots, np.concatenate(
        [
            np.stack([s(left), s(left, 1), s(left, 2) / 2.0, s(middle, 3) / 6.0], axis=1)
            for s in splines
        ],
        axis=2,
    )


@compiled
def evaluate(
    knots: np.ndarray,
    coeffs: np.ndarray,
    loop: bool,
    t: float,
    out_pos: np.ndarray,
    out_vel: np.ndarray,
    out_acc: np.ndarray,
):
    """Position, velocity and acceleration at time t [s], into three arrays of one length.

    `knots`, `coeffs` as `piecewise` gives them; the first len(out_pos) columns are evaluated.
    Outside the span the ends are held, or the whole repeats when `loop` is true.
    """
    last = knots.shape[0] - 1
    time = t
    if loop:
        time = knots[0] + (t - knots[0]) % (knots[last] - knots[0])
    moving = 1.0 if knots[0] <= time <= knots[last] else 0.0
    time = min(max(time, knots[0]), knots[last])
    i = min(max(np.searchsorted(knots, time, side="right") - 1, 0), last - 1)
    x = time - knots[i]
    for j in range(out_pos.shape[0]):
        a, b, c, d = coeffs[i, 0, j], coeffs[i, 1, j], coeffs[i, 2, j], coeffs[i, 3, j]
        out_pos[j] = a + x * (b + x * (c + x * d))
        out_vel[j] = moving * (b + x * (2.0 * c + x * 3.0 * d))
        out_acc[j] = moving * (2.0 * c + x * 6.0 * d)
