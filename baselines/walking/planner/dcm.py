"""The capture point of a walk: where it is at lift-off, and the foothold that puts it there.

On one foot the CoP p rests on the stance sole for T, then it goes at a constant speed to the new
sole in T_d. With ξ̇ = ω (ξ − p) and D = (e^(ωT_d) − 1)/(ω T_d) the capture point is at b from the
new sole when the old one leaves the ground, if that new sole lands at

    n = p + ((ξ(T) − p) e^(ωT_d) − b) / D.

A gait that repeats itself, of velocity v and width W, has [Englsberger11, Koolen12]

    b_x = v_x (T + T_d) D / (e^(ω(T + T_d)) − 1),
    b_y = v_y (T + T_d) D / (e^(ω(T + T_d)) − 1) ± W D / (e^(ω(T + T_d)) + 1),

+ where the left foot swings next.
"""

import numpy as np

from poise.envs.compiled.jit import compiled


@compiled
def transfer_factor(omega: float, transfer_time: float) -> float:
    """D = (e^(ωT_d) − 1)/(ω T_d), and its limit 1 for T_d = 0; times in s, `omega` in 1/s."""
    x = omega * transfer_time
    return np.expm1(x) / x if x > 1e-9 else 1.0


@compiled
def gait_offset(
    omega: float, step_time: float, transfer_time: float, vx: float, vy: float, outward: float
) -> tuple[float, float]:
    """b [m], of the velocity v [m/s] along the heading; `outward` [m] is the width W towards the
    side of the foot that swings next, + left."""
    period = step_time + transfer_time
    growth, factor = np.exp(omega * period), transfer_factor(omega, transfer_time)
    stride = period * factor / (growth - 1.0)
    return stride * vx, stride * vy + outward * factor / (growth + 1.0)


@compiled
def touchdown_target(step: float, offset: float, factor: float, omega: float, t: float) -> float:
    """ξ(T) − p along one axis [m] from which a `step` n − p leads to the `offset` b:
    (D (n − p) + b) e^(−ωT_d), D the `factor` and T_d = `t`."""
    return (factor * step + offset) * np.exp(-omega * t)


@compiled
def step_to_offset(end: float, offset: float, factor: float, omega: float, t: float) -> float:
    """n − p along one axis [m] that leads from ξ(T) − p = `end` to the `offset` b, see above."""
    return (end * np.exp(omega * t) - offset) / factor


@compiled
def constant_cop(now: float, end: float, omega: float, t: float) -> float:
    """The CoP along one axis that brings the capture point from `now` to `end` within `t` [s]:
    (ξ(t) − ξ e^(ωt)) / (1 − e^(ωt))."""
    growth = np.exp(omega * t)
    return (end - now * growth) / (1.0 - growth)


@compiled
def transfer_point(
    cop: float, speed: float, goal: float, end: float, omega: float, left: float
) -> float:
    """ξ along one axis `left` [s] before the end of a transfer that ends with it at `end` [m].

    The CoP, at `cop` now, arrives at `goal` at a constant `speed` [m/s]:
    ξ = p + ṗ/ω + (ξ_end − goal − ṗ/ω) e^(−ω left).
    """
    return cop + speed / omega + (end - goal - speed / omega) * np.exp(-omega * left)
