"""The second-order pendulum as [Zhao] prints it: equations (6) and (7).

    θ(t) = A1 e^{λt} + A2 e^{−λt},   φ(t) = B1 e^{λt} + B2 e^{−λt} + C1 t + C2       (6)

It is the solution of θ̈ = λ² θ, φ̈ = K θ, with B = K A/λ²: so much follows of the equations (4)
and (5), which the print has lost. The A and C are those of the angles and rates now. λ and K lead
to the angles θ₀, φ₀ of the wanted foothold at T, the least squares (7), which two unknowns solve
exactly where they can:

    θ cosh λT + θ̇ sinh λT/λ = θ₀,   K = (φ₀ − φ − φ̇ T)/I,   I = (θ₀ − θ − θ̇ T)/λ².

λ is real, so that there is none for some θ₀: then the nearest within the range is taken. I, the
double integral of θ, is 0 for a shank that goes as far ahead as it was behind: K is limited.
With C1 ≠ 0 no free knee moves like this (`double.py` has the law that is consistent).
"""

import numpy as np

from poise.envs.compiled.jit import compiled

MOST = 6.0  # λT at most, and √|K| T
HALVINGS = 40


@compiled
def shank_after(theta: float, rate: float, growth: float, time: float) -> float:
    """θ [rad] after `time` [s] of θ̈ = λ² θ, λ = `growth` [1/s]."""
    x = growth * time
    if x < 1e-6:
        return theta + rate * time
    return theta * np.cosh(x) + rate * np.sinh(x) / growth


@compiled
def shank_growth(theta: float, rate: float, end: float, time: float) -> float:
    """λ [1/s] ≥ 0 that leads to `end` [rad] at `time` [s], or as near as λ ≤ 6/time may."""
    low, high = 0.0, MOST / time
    at_low = shank_after(theta, rate, low, time) - end
    at_high = shank_after(theta, rate, high, time) - end
    if at_low * at_high > 0.0:
        return low if abs(at_low) < abs(at_high) else high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if at_low * (shank_after(theta, rate, middle, time) - end) > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@compiled
def thigh_coupling(
    theta: float, rate: float, growth: float, phi: float, phi_rate: float, end: float, time: float
) -> float:
    """K [1/s²] that leads φ to `end` [rad] at `time` [s] with φ̈ = K θ, within ±(6/time)²."""
    if growth * time < 1e-3:
        double = time * time * (0.5 * theta + rate * time / 6.0)
    else:
        after = shank_after(theta, rate, growth, time)
        double = (after - theta - rate * time) / (growth * growth)
    way, most = end - phi - phi_rate * time, (MOST / time) ** 2
    if abs(way) >= most * abs(double):
        return np.sign(way) * (most if double >= 0.0 else -most)
    return way / double
