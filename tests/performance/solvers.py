"""Times the QP solvers on the same random problems: `python -m tests.performance.solvers`.

n = 21, m = 64, 8 active rows, condition number 1e3: the shape of the reduced momentum QP. The
problems drift from one to the next, as from tick to tick, so that warm starts can show what they
are worth. Times through the interface include its checks in Python. The error of x (median and
worst) is against the active-set method. Ratios, not microseconds, are comparable between machines.
"""

from __future__ import annotations

import time

import numpy as np

from poise.baselines.solvers import QP, make_solver
from poise.baselines.solvers.dual_active_set import iscratch_size, scratch_size, solve_dual
from tests.support.qp_problems import solved_qp

SEQUENCES, STEPS, DRIFT = 20, 20, 0.002
SOLVERS = {
    "active-set": ("active-set", {}),
    "daqp": ("daqp", {}),
    "daqp, cold": ("daqp", {"warm_start": False}),
    "osqp": ("osqp", {}),
    "osqp, 1e-3 unpolished": ("osqp", {"eps_abs": 1e-3, "eps_rel": 1e-3, "polishing": False}),
}


def problems() -> list[list[QP]]:
    """Sequences of problems whose linear terms and bounds drift a little at every step."""
    sequences = []
    for seed in range(SEQUENCES):
        rng = np.random.default_rng(seed)
        qp, _, _ = solved_qp(rng, n=21, m=64, active=8)
        g_rate, bound_rate = rng.normal(size=21) * np.abs(qp.g).mean(), rng.normal(size=64)
        sequence = []
        for step in range(STEPS):
            shift = DRIFT * step * bound_rate
            g = qp.g + DRIFT * step * g_rate
            sequence.append(QP(qp.H, g, qp.C, qp.l + shift, qp.u + shift))
        sequences.append(sequence)
    return sequences


def time_compiled(sequences: list[list[QP]]) -> float:
    """Median time [s] of the bare compiled function, as another compiled function would call it."""
    x, lam = np.zeros(21), np.zeros(64)
    scratch = np.empty(scratch_size(21, 64))
    iscratch = np.empty(iscratch_size(21, 64), dtype=np.int64)
    times = []
    for sequence in sequences:
        for qp in sequence:
            start = time.perf_counter()
            solve_dual(qp.H, qp.g, qp.C, qp.l, qp.u, x, lam, scratch, iscratch, 500, False)
            times.append(time.perf_counter() - start)
    return float(np.median(times))


def main() -> None:
    sequences = problems()
    time_compiled(sequences[:1])  # compiles
    exact = make_solver("active-set")
    reference = time_compiled(sequences)
    print(f"{'solver':24}{'median':>10}{'ratio':>8}{'iterations':>12}{'unsolved':>10}  error of x")
    print(f"{'active-set, bare call':24}{reference * 1e6:7.1f} µs{1:8.2f}")
    for label, (name, options) in SOLVERS.items():
        solver = make_solver(name, **options)
        solver.solve(sequences[0][0])
        solutions, errors = [], []
        for sequence in sequences:
            solver.reset()
            for qp in sequence:
                solution = solver.solve(qp)
                solutions.append(solution)
                if solution.solved:
                    errors.append(np.abs(solution.x - exact.solve(qp).x).max())
        median = np.median([solution.solve_time for solution in solutions])
        iterations = np.median([solution.iterations for solution in solutions])
        unsolved = sum(not solution.solved for solution in solutions)
        print(
            f"{label:24}{median * 1e6:7.1f} µs{median / reference:8.2f}"
            f"{iterations:12.0f}{unsolved:10}  {np.median(errors):.1e} {max(errors):.1e}"
        )


if __name__ == "__main__":
    main()
