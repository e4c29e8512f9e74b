"""A leg as two rods, thigh and shank, and a knee between them: formulas without state.

In the plane of the leg, x forward and z up from the ankle, θ of the shank and φ of the thigh from
the vertical, + forward [Zhao, fig. 5]:

    x = L2 sin θ + L1 sin φ,   z = L2 cos θ + L1 cos φ,   β = θ − φ ≥ 0 the knee's flexion.

The distance r of the hip from the ankle depends on β alone: r² = L1² + L2² + 2 L1 L2 cos β.
L1 is the thigh's length, L2 the shank's [m].
"""

import numpy as np

from poise.envs.compiled.jit import compiled


@compiled
def length_at(thigh: float, shank: float, flexion: float) -> float:
    """r [m] of a flexion β [rad]."""
    square = thigh * thigh + shank * shank + 2.0 * thigh * shank * np.cos(flexion)
    return np.sqrt(max(square, 0.0))


@compiled
def flexion_at(thigh: float, shank: float, length: float) -> float:
    """β [rad] ≥ 0 of a length r [m]; 0 beyond what the rods reach."""
    cosine = (length * length - thigh * thigh - shank * shank) / (2.0 * thigh * shank)
    return np.arccos(min(max(cosine, -1.0), 1.0))


@compiled
def length_motion(
    thigh: float, shank: float, flexion: float, rate: float, accel: float
) -> tuple[float, float, float]:
    """r, ṙ, r̈ [m, s] of β, β̇, β̈: r ṙ = −L1 L2 sin β β̇, and its derivative."""
    product = thigh * shank
    sine, cosine = np.sin(flexion), np.cos(flexion)
    r = length_at(thigh, shank, flexion)
    speed = -product * sine * rate / r
    change = -product * (cosine * rate * rate + sine * accel)
    return r, speed, (change - speed * speed) / r


@compiled
def flexion_motion(
    thigh: float, shank: float, length: float, speed: float, accel: float
) -> tuple[float, float, float]:
    """β, β̇, β̈ [rad, s] of r, ṙ, r̈, the inverse of `length_motion`.

    At a straight leg the rates are unbounded; there sin β counts as that of 2°.
    """
    flexion = flexion_at(thigh, shank, length)
    product = thigh * shank
    sine = max(np.sin(flexion), 0.035)
    rate = -length * speed / (product * sine)
    turn = product * np.cos(flexion) * rate * rate
    return flexion, rate, -(speed * speed + length * accel + turn) / (product * sine)


@compiled
def height_over(
    length: float, speed: float, accel: float, way: float, way_rate: float, way_accel: float
) -> tuple[float, float, float]:
    """z, ż, z̈ [m, s] of the hip over the ankle, z² = r² − d².

    Args:
        length, speed, accel: r, ṙ, r̈.
        way, way_rate, way_accel: d², d ḋ and ḋ² + d d̈ of the horizontal distance d.
    """
    z = np.sqrt(max(length * length - way, 0.25 * length * length))
    rise = (length * speed - way_rate) / z
    return z, rise, (speed * speed + length * accel - way_accel - rise * rise) / z


@compiled
def rod_angles(
    thigh: float, shank: float, flexion: float, x: float, z: float
) -> tuple[float, float]:
    """θ of the shank and φ of the thigh [rad] with the hip along (x, z) from the ankle.

    The hip's line leans by α = atan2(x, z); θ = α + γ, φ = θ − β, with the angle γ at the ankle,
    tan γ = L1 sin β/(L2 + L1 cos β).
    """
    lean = np.arctan2(x, z)
    at_ankle = np.arctan2(thigh * np.sin(flexion), shank + thigh * np.cos(flexion))
    return lean + at_ankle, lean + at_ankle - flexion
