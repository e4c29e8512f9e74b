"""Steps of the four classical methods, from one posture of a chain to a better one.

With mobilities M = diag(m), J = ∂e/∂q, each gives a displacement Δq (n,); joint limits are met by
clipping what comes of it. CCD clips joint by joint. [Wang91], [Buss04]
"""

from collections.abc import Callable

import numpy as np

from .goals import IkOptions, Misses

RANK = 1e-9  # of the largest singular value: smaller ones are rounding


def transpose_step(misses: Misses, options: IkOptions) -> np.ndarray:
    """Δq = −α M Jᵀ e with α = eᵀ J M Jᵀ e / ‖J M Jᵀ e‖²: the gradient, as far as is best for a
    linear e."""
    e, jacobian = misses.vector(), misses.jacobian()
    downhill = -misses.chain.mobility * (jacobian.T @ e)
    moved = jacobian @ downhill
    return downhill * -float(e @ moved) / max(float(moved @ moved), 1e-300)


def gauss_newton_step(misses: Misses, options: IkOptions) -> np.ndarray:
    """Δq = −√M (J √M)⁺ e: of those that undo a linear e the one with the least Σ Δq²/m."""
    root = np.sqrt(misses.chain.mobility)
    return root * np.linalg.lstsq(misses.jacobian() * root, -misses.vector(), rcond=RANK)[0]


def damped_step(misses: Misses, options: IkOptions) -> np.ndarray:
    """Δq = −M Jᵀ (J M Jᵀ + λ² I)⁻¹ e, which makes ‖J Δq + e‖² + λ² Σ Δq²/m least."""
    jacobian, mobility = misses.jacobian(), misses.chain.mobility
    square = (jacobian * mobility) @ jacobian.T
    damped = square + options.damping**2 * np.eye(len(square))
    return -mobility * (jacobian.T @ np.linalg.solve(damped, misses.vector()))


def ccd_step(misses: Misses, options: IkOptions) -> np.ndarray:
    """One sweep of cyclic coordinate descent from the ends to the base.

    Every joint in turn goes to where Σ w²(‖p − p*‖² + ½ℓ²‖R − R*‖²) is least over its own angle,
    which has a closed form, by its mobility of that, and no further than its limit. What a joint
    moves does not move the joints nearer to the base, so one pass of kinematics is enough.
    """
    chain, q = misses.chain, misses.chain.q.copy()
    anchors, axes = chain.lines()
    ends = [chain.end_pose(i, goal.point) for i, goal in enumerate(misses.goals)]
    for i in reversed(range(len(q))):
        moved = np.flatnonzero(chain.moves[i])
        slides = bool(chain.slides[i])
        best = (_best_slide if slides else _best_turn)(misses, ends, moved, anchors[i], axes[i])
        wanted = q[i] + chain.mobility[i] * best
        after = np.clip(wanted, chain.low[i], chain.high[i]) if options.limits else wanted
        way, q[i] = after - q[i], after
        for k in moved:
            ends[k] = _moved(ends[k], anchors[i], axes[i], way, slides)
    return q - chain.q


End = tuple[np.ndarray, np.ndarray]  # a place (3,) and axes (3, 3)


def _best_turn(
    misses: Misses, ends: list[End], moved: np.ndarray, anchor: np.ndarray, axis: np.ndarray
) -> float:
    """θ = atan2(Σ c n·(u × v), Σ c (u·v − (n·u)(n·v))) over pairs u → v, weighted by c."""
    sine = cosine = 0.0
    cross = _skew(axis)
    for k in moved:
        goal, (place, axes), wanted = misses.goals[k], ends[k], misses.turns[k]
        pairs = [(1.0, place - anchor, misses.places[k] - anchor)]
        if wanted is not None:
            share = 0.5 * misses.lever**2
            pairs += [(share, axes[:, j], wanted[:, j]) for j in range(3)]
        for share, u, v in pairs:
            sine += goal.weight**2 * share * float(v @ (cross @ u))
            cosine += goal.weight**2 * share * float(u @ v - (axis @ u) * (axis @ v))
    return float(np.arctan2(sine, cosine)) if abs(sine) + abs(cosine) > 1e-15 else 0.0


def _best_slide(
    misses: Misses, ends: list[End], moved: np.ndarray, anchor: np.ndarray, axis: np.ndarray
) -> float:
    """Σ w² n·(p* − p) / Σ w²."""
    weights = np.array([misses.goals[k].weight ** 2 for k in moved])
    gaps = np.array([misses.places[k] - ends[k][0] for k in moved])
    return float(weights @ (gaps @ axis) / weights.sum())


def _moved(end: End, anchor: np.ndarray, axis: np.ndarray, way: float, slides: bool) -> End:
    """An end after a joint went a way: along its axis, or about it by Rodrigues' formula."""
    place, axes = end
    if slides:
        return place + way * axis, axes
    cross = _skew(axis)
    turn = np.eye(3) + np.sin(way) * cross + (1.0 - np.cos(way)) * (cross @ cross)
    return anchor + turn @ (place - anchor), turn @ axes


def _skew(a: np.ndarray) -> np.ndarray:
    """[a]×, with [a]× b = a × b."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


#: method → its step
STEPS: dict[str, Callable[[Misses, IkOptions], np.ndarray]] = {
    "ccd": ccd_step,
    "jacobian-transpose": transpose_step,
    "gauss-newton": gauss_newton_step,
    "damped": damped_step,
}
