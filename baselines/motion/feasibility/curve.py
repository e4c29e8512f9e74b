"""Curves from one state to another: of the fifth order, and bent by three knots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

KNOTS = (0.25, 0.5, 0.75)
ORDER = 5
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
        start, end = D * a.rate, D * b.rate
        bend_a, bend_b = D**2 * a.acceleration, D**2 * b.acceleration
        rows = [
            a.place, start, 0.5 * bend_a,
            10.0 * gap - 6.0 * start - 4.0 * end - 1.5 * bend_a + 0.5 * bend_b,
            -15.0 * gap + 8.0 * start + 7.0 * end + 1.5 * bend_a - bend_b,
            6.0 * gap - 3.0 * (start + end) + 0.5 * (bend_b - bend_a),
        ]  # fmt: skip
        return cls(np.array(rows), np.zeros((len(KNOTS), len(gap))), duration)

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


def bend_shapes(s: np.ndarray, derivative: int = 0) -> np.ndarray:
    """(m, 3) Nⱼ, or their derivatives by s."""
    shapes = []
    for j in range(len(KNOTS)):
        one = np.zeros(len(_PADDED) - ORDER - 1)
        one[3 + j] = 1.0
        shapes.append(BSpline(_PADDED, one, ORDER)(s, derivative))
    return np.array(shapes).T


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
