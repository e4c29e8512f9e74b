"""Solvers on the QPs of real push recoveries: `python -m tests.performance.momentum_qp`.

Torque errors are against the active-set method, as a fraction of the motors' limits; the optimality
residuals of a solution are relative to the size of its terms.
"""

from __future__ import annotations

import numpy as np

from poise.baselines.solvers import make_solver, residuals
from tests.performance.recoveries import record


def loose(tolerance: float) -> dict:
    """Options of `momentum-qp-osqp`, but for the tolerance."""
    return {"eps_abs": tolerance, "eps_rel": tolerance, "scaling": 0, "polishing": False}


SOLVERS = {
    "active-set": ("active-set", {}),
    "daqp": ("daqp", {}),
    "osqp": ("osqp", {}),
    "osqp, 1e-2": ("osqp", loose(1e-2)),
    "osqp, 1e-3": ("osqp", loose(1e-3)),
    "osqp, 1e-4": ("osqp", loose(1e-4)),
}


def main() -> None:
    env, recoveries = record()
    ticks = [tick for recovery in recoveries for tick in recovery]
    limits = env.controller.parameters.torque_limit
    print(f"{len(ticks)} problems of {len(recoveries)} pushes, n = {len(ticks[0].problem.g)}, "
          f"m = {len(ticks[0].problem.l)}")  # fmt: skip
    levers = []  # T of τ = τ₀ + T x
    for tick in ticks:
        env.controller.problem(tick.state, tick.targets)
        levers.append(env.controller.workspace.T.copy())
    reference: list[np.ndarray | None] = []
    base = 0.0
    print("| solver | median time | ratio | unsolved | dual residual, median | "
          "torque error, median | p99 |")  # fmt: skip
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, (kind, options) in SOLVERS.items():
        solver = make_solver(kind, **options)
        times, duals, errors, unsolved = [], [], [], 0
        index = 0
        for recovery in recoveries:
            solver.reset()
            for tick in recovery:
                solution = solver.solve(tick.problem)
                times.append(solution.solve_time)
                if name == "active-set":
                    reference.append(solution.x if solution.solved else None)
                if not solution.solved:
                    unsolved += 1
                else:
                    scale = np.abs(tick.problem.g).max()
                    duals.append(residuals(tick.problem, solution).dual / scale)
                    truth = reference[index]
                    if truth is not None:
                        error = np.abs(levers[index] @ (solution.x - truth)) / limits
                        errors.append(error.max())
                index += 1
        median = float(np.median(times))
        base = base or median
        print(f"| {name} | {1e6 * median:.0f} µs | {median / base:.1f} | {unsolved} | "
              f"{np.median(duals):.0e} | {np.median(errors):.1e} | "
              f"{np.percentile(errors, 99):.1e} |")  # fmt: skip


if __name__ == "__main__":
    main()
