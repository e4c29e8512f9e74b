"""Joins as curves from one end to another, of the fifth order and bent by three knots, and their
feasibility."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from poise.baselines.motion.graphs.joining.states import quintic_rise

from .check import Feasibility

KNOTS = (0.25, 0.5, 0.75)
ORDER = 5
CALM = 1e-9  # [m/s², rad/s²] below which an acceleration is the rounding of a posture that is held
_PADDED = np.concatenate([np.zeros(ORDER + 1), KNOTS, np.ones(ORDER + 1)])
_POLYNOMIAL = np.polynomial.polynomial


class Boundary(NamedTuple):
    """n coordinates at one end of a curve, with their rates and accelerations."""

    place: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray


class Curve(NamedTuple):
    """n coordinates over a duration D: Σ cₚ sᵖ + Σ zⱼ Nⱼ(s), s = t/D.

    Without bends it is the one curve of the fifth order between two boundaries, which has the
    least jerk. Nⱼ are the three B-splines of the fifth order on the knots ¼, ½, ¾ that are 0 at
    both ends with two derivatives, so bends change neither end.

    Attributes:
        coefficients: (6, n) c, lowest power first.
        bends: (3, n) z.
        duration: D [s].
    """

    coefficients: np.ndarray
    bends: np.ndarray
    duration: float

    @classmethod
    def between(cls, a: Boundary, b: Boundary, duration: float) -> Curve:
        """The curve without bends."""
        D, gap = duration, b.place - a.place
        bends = D**2 * a.acceleration, D**2 * b.acceleration
        coefficients = quintic_rise(gap, D * a.rate, D * b.rate, *bends)
        coefficients[0] = a.place
        return cls(coefficients, np.zeros((len(KNOTS), len(gap))), duration)

    def at(self, s: np.ndarray, derivative: int = 0) -> np.ndarray:
        """(m, n) values, or derivatives by time, at shares s (m,) of the duration."""
        c = _POLYNOMIAL.polyder(self.coefficients, derivative, axis=0)
        smooth = _POLYNOMIAL.polyval(np.asarray(s), c).T
        bent = bend_shapes(s, derivative) @ self.bends
        return np.asarray((smooth + bent) / self.duration**derivative)

    def energy(self, masses: np.ndarray) -> float:
        """K = ∫ Σ mᵢ ẍᵢ² dt: what `joining.coefficient` has in closed form for cubics."""
        s, weights = _quadrature(8)
        return float(weights @ (self.at(s, 2) ** 2 @ masses) * self.duration)


class End(NamedTuple):
    """One side of a join: joints of its frames (m, nj) and the state next to the join."""

    frames: np.ndarray
    q: np.ndarray
    boundary: Boundary
    region: np.ndarray  # (k, 2) where the motors can bear the weight
    own: Feasibility  # of the motion about the join, whether it is used or not

    @property
    def is_calm(self) -> bool:
        """Whether it has no acceleration, so that `calm` is no other end."""
        return bool(np.abs(self.boundary.acceleration).max() < CALM)

    @property
    def calm(self) -> End:
        """The same place and rate without acceleration."""
        none = np.zeros_like(self.boundary.acceleration)
        return self._replace(boundary=self.boundary._replace(acceleration=none))


@dataclass(frozen=True, eq=False)
class JoinPart:
    """One way from state to state that is possible.

    Attributes:
        qpos: (n − 1, nq) of the frames between both ends.
        curve: that they follow.
        coefficient: K, the energy of its bending [m²/s³].
        feasibility: of its samples, whose times count from its begin.
    """

    qpos: np.ndarray
    curve: Curve
    coefficient: float
    feasibility: Feasibility

    @property
    def duration(self) -> float:
        """D [s]."""
        return self.curve.duration

    @property
    def bent(self) -> bool:
        """Whether knots had to leave the curve of the fifth order."""
        return bool(np.any(self.curve.bends))

    @property
    def calm(self) -> bool:
        """Whether it begins and ends without the clips' accelerations."""
        return not np.any(self.curve.coefficients[2])


class WhyNot(NamedTuple):
    """Why a duration is not possible, and how far it is from that, see `Feasibility.lacking`."""

    reason: str
    lacking: float = np.inf


def bend_shapes(s: np.ndarray, derivative: int = 0) -> np.ndarray:
    """(m, 3) Nⱼ, or their derivatives by s."""
    inner = np.eye(len(_PADDED) - ORDER - 1)[:, 3:6]
    return np.asarray(BSpline(_PADDED, inner, ORDER)(s, derivative))


def jerk_matrix() -> np.ndarray:
    """(3, 3) ∫ Nᵢ''' Nⱼ''' ds: bends z add zᵀ R z to the jerk, since without them it is least."""
    s, weights = _quadrature(6)
    third = bend_shapes(s, 3)
    return np.asarray(third.T @ (weights[:, None] * third))


def _quadrature(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights on [0, 1], exact for polynomials of order 2 `count` − 1 between knots."""
    points, weights = np.polynomial.legendre.leggauss(count)
    edges = np.array([0.0, *KNOTS, 1.0])
    spans = np.diff(edges)[:, None]
    s = edges[:-1, None] + 0.5 * spans * (points + 1.0)
    return s.ravel(), (0.5 * spans * weights).ravel()
