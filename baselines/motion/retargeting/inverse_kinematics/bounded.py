"""Joint limits as bounds of a nonlinear least-squares problem, and a prior beside the goals."""

import numpy as np
from mujoco import minimize

from .goals import IkOptions, Misses
from .prior import PosePrior

FAR = 4.0 * np.pi  # [rad] from the start: the bound of joints without limits


class Objective:
    """½‖e‖² + ½ w ‖W (x − x̄)‖², W the whitening of the prior, x all joints as in qpos."""

    def __init__(self, misses: Misses, prior: PosePrior | None, weight: float):
        self.misses, self.prior = misses, prior
        if prior is not None:
            self.rows = np.sqrt(weight) * prior.whitening
            self.columns = self.rows[:, misses.chain.qpos - 7]

    def vector(self, q: np.ndarray) -> np.ndarray:
        """(r,) the residuals with the chain's joints at `q` (n,)."""
        chain = self.misses.chain
        chain.move(q)
        if self.prior is None:
            return self.misses.vector()
        unusual = self.rows @ (chain.data.qpos[7:] - self.prior.mean)
        return np.concatenate([self.misses.vector(), unusual])

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """(r, n) their derivatives there."""
        self.misses.chain.move(q)
        rows = self.misses.jacobian()
        return rows if self.prior is None else np.concatenate([rows, self.columns])

    def value(self, q: np.ndarray) -> float:
        """What is made least."""
        return 0.5 * float(self.vector(q) @ self.vector(q))


def solve_bounded(
    objective: Objective, start: np.ndarray, options: IkOptions
) -> tuple[np.ndarray, int]:
    """The positions (n,) at a local minimum within the limits, and the steps taken.

    Levenberg and Marquardt's method with a QP of bounds per step, by `mujoco.minimize`, in the
    variables q/√m: a joint with a small mobility m moves less.
    """
    chain, root = objective.misses.chain, np.sqrt(objective.misses.chain.mobility)
    low = np.where(np.isfinite(chain.low), chain.low, start - FAR)
    high = np.where(np.isfinite(chain.high), chain.high, start + FAR)

    def residuals(columns: np.ndarray) -> np.ndarray:
        return np.stack([objective.vector(root * column) for column in columns.T], axis=1)

    def jacobian(y: np.ndarray, _: np.ndarray) -> np.ndarray:
        return objective.jacobian(root * y[:, 0]) * root

    best, trace = minimize.least_squares(
        start / root, residuals, [low / root, high / root] if options.limits else None, jacobian,
        gtol=1e-10, max_iter=options.iterations, verbose=0,
    )  # fmt: skip
    q = root * best.ravel()
    return (chain.clipped(q) if options.limits else q), len(trace)
