"""The linear inverted pendulum c̈ = ω² (c − p) + F/m: its units, what it holds, where it gets to."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from poise.envs.compiled.jit import compiled

Profile = Literal["square", "half-sine"]


def pendulum_rate(gravity: float, height: float) -> float:
    """ω = √(g/z_c) [1/s]: `gravity` g [m/s²], `height` z_c of the centre of mass [m]."""
    return np.sqrt(gravity / height)


compiled_rate = compiled(pendulum_rate)  #: the same, for kernels


@dataclass(frozen=True)
class Units:
    """The units of gains and costs that are given without: m, g and h of one robot, standing.

    Lengths in h, times in 1/ω, forces in m g, moments in m g h.
    """

    mass: float  #: m [kg]
    gravity: float  #: g [m/s²]
    height: float  #: h, of the centre of mass above the ground [m]

    @property
    def omega(self) -> float:
        """ω = √(g/h) [1/s]."""
        return float(pendulum_rate(self.gravity, self.height))

    @property
    def force(self) -> float:
        """m g [N]."""
        return self.mass * self.gravity

    @property
    def moment(self) -> float:
        """m g h [N·m]."""
        return self.mass * self.gravity * self.height


def duration_factor(omega: float, duration: float, profile: Profile = "square") -> float:
    """Return how much more impulse a push may have than an instantaneous one, J(T)/J(0) ≥ 1.

    J(T)/J(0) = ∫F ds / ∫F e^(−ωs) ds over [0, T]:
    square    ωT / (1 − e^(−ωT))
    half-sine 2 (1 + (ωT/π)²) / (1 + e^(−ωT))
    """
    x = omega * duration
    if profile == "square":
        return float(x / -np.expm1(-x)) if x > 0.0 else 1.0
    return float(2.0 * (1.0 + (x / np.pi) ** 2) / (1.0 + np.exp(-x)))


def ankle_limit(omega: float, margin: float, duration: float, profile: Profile = "square") -> float:
    """Largest J/m [N·s/kg] that ankles alone hold: J/m = ω δ · J(T)/J(0).

    Linear inverted pendulum c̈ = ω²(c − p) + F/m with the centre of pressure p at the edge of
    the support, at distance δ = `margin` [m], from the first instant; the capture point
    ξ = c + ċ/ω starts at the centre and ends the push exactly on p. For a square push this is
    ω δ · ωT/(1 − e^(−ωT)). `omega` [1/s], `duration` T [s]. [Stephens07], [Koolen12]
    """
    return omega * margin * duration_factor(omega, duration, profile)


@compiled
def drifted_point(xi: np.ndarray, p: np.ndarray, omega: float, t: float) -> tuple[float, float]:
    """ξ(t) = p + (ξ − p) e^(ωt), points (≥ 2,): where ξ gets while the CoP stays at p."""
    growth = np.exp(omega * t)
    return p[0] + (xi[0] - p[0]) * growth, p[1] + (xi[1] - p[1]) * growth


def capture_distance(steps: float, reach: float, length: float, omega: float, time: float) -> float:
    """d_N = r + l a (1 − a^N)/(1 − a), a = e^(−ω T_s): how far the capture point may be from the
    stance foot to come to rest in N steps of length l and time T_s [Koolen12]."""
    a = np.exp(-omega * time)
    return float(reach + length * a * (1.0 - a**steps) / (1.0 - a))


@compiled
def pendulum(c: float, velocity: float, p: float, omega: float, t: float) -> tuple[float, float]:
    """Position and velocity along one axis after `t` of c̈ = ω² (c − p), p at rest."""
    cosh, sinh = np.cosh(omega * t), np.sinh(omega * t)
    return p + (c - p) * cosh + velocity / omega * sinh, (c - p) * omega * sinh + velocity * cosh


def lip_step(omega: float, step: float) -> tuple[np.ndarray, np.ndarray]:
    """A (2, 2), B (2,) of [c; ċ/ω] after `step` seconds of constant p, exact for c̈ = ω² (c − p)."""
    c, s = np.cosh(omega * step), np.sinh(omega * step)
    return np.array([[c, s], [s, c]]), np.array([1.0 - c, -s])
