"""Solvers on the set that `poise qp-set` exports: `python -m tests.performance.qp_set`.

Every problem is solved cold, by one solver after the other: its numbers are new to the solver, as
at every tick, and a warm start from another tick would be 80 ms old. Data are converted to each
solver's own form before the clock starts; the clock is the thread's CPU time, so other jobs on the
machine do not count. Torque errors are against a solution refined in extended precision, as a
fraction of the torque limits, for the problems that a solver calls solved. Solvers that are not
installed (proxsuite, piqp, clarabel, quadprog) are left out.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from poise.baselines.solvers import QP, Solution, Status, make_solver, residuals
from poise.training.deploy.qp_set.export import write_qp_set
from poise.training.running.provenance import machine, versions
from tests.performance.qp_solvers import SOLVERS, Answer, available

LIBRARIES = ("osqp", "daqp", "proxsuite", "piqp", "clarabel", "quadprog", "numpy", "numba")
CLOSE = 0.01  # of the torque limits


class Problem(NamedTuple):
    """One file of the set, with its refined solution."""

    qp: QP
    x: np.ndarray
    T: np.ndarray  # (nu, n) torques over limits per x


def main(args: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--folders", type=Path, nargs="*", help="sets that are already written")
    parser.add_argument("--every", type=int, default=1, help="solve every n-th problem only")
    options = parser.parse_args(sys.argv[1:] if args is None else args)
    print(machine()["processor"], versions(LIBRARIES))
    with tempfile.TemporaryDirectory() as room:
        folders = options.folders
        if not folders:
            folders = [Path(room) / form for form in ("reduced", "full")]
            for folder in folders:
                write_qp_set(folder, count=options.count, form=folder.name)
        for folder in folders:
            compare(load(folder, options.every))


def load(folder: Path, every: int) -> list[Problem]:
    problems = []
    for path in sorted(folder.glob("*.npz"))[::every]:
        data = np.load(path, allow_pickle=True)
        qp = two_sided({key: data[key] for key in ("P", "q", "G", "h", "A", "b", "lb", "ub")})
        T = data["torque_matrix"] / data["torque_limit"][:, None]
        problems.append(Problem(qp, refined(qp), T))
    return problems


def two_sided(p: dict[str, Any]) -> QP:
    """l ≤ Cx ≤ u from a file's arrays: equalities, G with its opposite rows joined, bounds."""
    n = len(p["q"])
    rows: dict[bytes, list] = {}
    for row, bound in zip(p["G"], p["h"], strict=True):
        opposite = rows.get((-row + 0.0).tobytes())
        if opposite is not None and opposite[1] == -np.inf:
            opposite[1] = -bound
        else:
            rows[(row + 0.0).tobytes()] = [row, -np.inf, bound]
    C, l, u = (list(part) for part in zip(*rows.values(), strict=True))  # noqa: E741
    if p["A"].shape:
        C, l, u = [*p["A"], *C], [*p["b"], *l], [*p["b"], *u]  # noqa: E741
    if p["lb"].shape:
        bounded = np.flatnonzero(np.isfinite(p["lb"]) | np.isfinite(p["ub"]))
        C += list(np.eye(n)[bounded])
        l, u = [*l, *p["lb"][bounded]], [*u, *p["ub"][bounded]]  # noqa: E741
    return QP(p["P"], p["q"], np.array(C), np.array(l), np.array(u))


def refined(qp: QP) -> np.ndarray:
    """x from the active set, by iterative refinement with residuals in extended precision."""
    solution = make_solver("active-set").solve(qp)
    assert solution.solved
    active = (solution.lam != 0.0) | (qp.l == qp.u)
    C = qp.C[active]
    bound = np.where(solution.lam > 0.0, qp.u, qp.l)[active]
    K = np.block([[qp.H, C.T], [C, np.zeros((len(C), len(C)))]])
    rhs, K_long = np.concatenate([-qp.g, bound]).astype(np.longdouble), K.astype(np.longdouble)
    z = np.zeros(len(K), dtype=np.longdouble)
    inverse = np.linalg.pinv(K, rcond=1e-15)
    for _ in range(5):
        z += inverse @ (rhs - K_long @ z).astype(float)
    x, lam = z[: len(qp.g)].astype(float), np.zeros(len(qp.l))
    lam[active] = z[len(qp.g) :].astype(float)
    best = [solution, Solution(x, lam, Status.SOLVED, 0, 0.0)]
    return min(best, key=lambda s: relative(qp, s)).x


def relative(qp: QP, solution: Solution) -> float:
    """The worse of the primal and the relative dual residual; infinite for a wrong sign."""
    wrong = (solution.lam > 0.0) & np.isinf(qp.u) | (solution.lam < 0.0) & np.isinf(qp.l)
    found = residuals(qp, solution)
    return np.inf if wrong.any() else max(found.primal, found.dual / np.abs(qp.g).max())


def compare(problems: list[Problem]) -> None:
    """Print a table: one line per solver."""
    n, m = problems[0].qp.C.shape[::-1]
    solvers = {name: make() for name, make in SOLVERS.items() if available(name)}
    record: dict[str, list[tuple[float, Answer | None]]] = {name: [] for name in solvers}
    for index, problem in enumerate([problems[0], *problems]):
        for name, solver in solvers.items():
            data = solver.prepare(problem.qp)
            start = time.thread_time()
            answer = solver.solve(data)
            spent = time.thread_time() - start
            if index > 0:  # the first one warms up
                record[name].append((spent, answer))
    print(f"\n{len(problems)} problems, n = {n}, rows {m}, "
          f"equalities {int((problems[0].qp.l == problems[0].qp.u).sum())}")  # fmt: skip
    print("| solver | time, median | p99 | called solved | torque error ≤ 1 % "
          "| primal residual, median | p99 | dual residual, median | p99 "
          "| torque error [%], median | p99 |")  # fmt: skip
    print("| --- |" + " --- |" * 10)
    for name, answers in record.items():
        print(line(name, answers, problems))


def line(name: str, answers: list[tuple[float, Answer | None]], problems: list[Problem]) -> str:
    times = 1e6 * np.array([spent for spent, _ in answers])
    primal, dual, errors = [], [], []
    for (_, answer), problem in zip(answers, problems, strict=True):
        if answer is None:
            continue
        found = residuals(problem.qp, Solution(*answer, Status.SOLVED, 0, 0.0))
        primal.append(found.primal)
        dual.append(found.dual / np.abs(problem.qp.g).max())
        errors.append(100.0 * np.abs(problem.T @ (answer.x - problem.x)).max())
    total = len(problems)
    close = sum(error <= 100.0 * CLOSE for error in errors) / total
    cells = [f"{np.median(times):.0f} µs", f"{np.percentile(times, 99):.0f} µs",
             f"{100 * len(errors) / total:.1f} %", f"{100 * close:.1f} %"]  # fmt: skip
    for values in (primal, dual, errors):
        for q in (50, 99):
            cells.append(f"{np.percentile(values, q):.0e}" if values else "–")
    return f"| {name} | " + " | ".join(cells) + " |"


if __name__ == "__main__":
    main()
