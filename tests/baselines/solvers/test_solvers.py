"""The solver interface: what every solver promises, whatever its method."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from poise.baselines.solvers import QP, SOLVERS, Solution, Status, make_solver, residuals
from poise.baselines.solvers.osqp import polish
from poise.configs.errors import ConfigError
from tests.support.qp_problems import random_qp, solved_qp
from tests.support.refused import invalid

#: Name of a solver, and the accuracy of x and lam to expect where they are of size 1.
ACCURACY = {"active-set": 1e-10, "daqp": 1e-8, "osqp": 1e-2}
every_solver = pytest.mark.parametrize("name", SOLVERS)


def box(rng: np.random.Generator, n: int = 4) -> QP:
    """Nearest point in a box."""
    return QP(np.eye(n), rng.normal(size=n) * 2, np.eye(n), np.full(n, -1.0), np.full(n, 1.0))


@every_solver
def test_known_solutions(name):
    """A sequence of unrelated problems: each gets its own solution, to the solver's accuracy."""
    solver = make_solver(name)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        qp, x, lam = solved_qp(rng, n=10, m=25, active=int(rng.integers(0, 9)), condition=100)
        solution = solver.solve(qp)
        assert solution.solved and solution.status is Status.SOLVED
        np.testing.assert_allclose(solution.x, x, rtol=0, atol=ACCURACY[name])
        np.testing.assert_allclose(solution.lam, lam, rtol=0, atol=20 * ACCURACY[name])
        assert solution.iterations >= 1 or not lam.any()
        assert solution.solve_time > 0


@every_solver
def test_moving_problem(name):
    """A problem that changes little by little, as from tick to tick, is solved at every step."""
    solver = make_solver(name)
    rng = np.random.default_rng(0)
    qp, _, _ = solved_qp(rng, condition=100)
    drift = rng.normal(size=21)
    for step in range(30):
        moved = QP(qp.H, qp.g + 0.5 * step * drift, qp.C, qp.l, qp.u)
        exact = make_solver("active-set").solve(moved)
        np.testing.assert_allclose(solver.solve(moved).x, exact.x, atol=ACCURACY[name])


@every_solver
def test_shape_bounds_and_equalities_may_change(name):
    """Nothing of one problem leaks into the next when its size, pattern or sides change."""
    solver = make_solver(name)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        n, m = (6, 12) if seed % 3 else (int(rng.integers(1, 8)), int(rng.integers(0, 15)))
        qp = box(rng, n)
        C = np.vstack([qp.C, rng.normal(size=(m, n))])
        lower, upper = np.append(qp.l, np.full(m, -3.0)), np.append(qp.u, np.full(m, 3.0))
        lower[rng.random(n + m) < 0.3] = -np.inf
        upper[rng.random(n + m) < 0.3] = np.inf
        if n > 1:
            lower[n - 1] = upper[n - 1] = 0.3 * (seed % 2)
        qp = QP(qp.H, qp.g, C, lower, upper)
        exact = make_solver("active-set").solve(qp)
        solution = solver.solve(qp)
        assert solution.solved, seed
        np.testing.assert_allclose(solution.x, exact.x, atol=ACCURACY[name])


@every_solver
def test_failures_are_told_and_leave_no_trace(name):
    """Infeasible and invalid problems give a status and NaN; the next problem is solved."""
    solver = make_solver(name)
    qp, x, _ = solved_qp(np.random.default_rng(0), n=5, m=10, active=3, condition=10)
    twice = np.vstack([qp.C, qp.C[:1]])
    bad = {
        "contradiction": QP(
            qp.H, qp.g, twice, np.append(qp.l, qp.u[0] + 1), np.append(qp.u, qp.u[0] + 2)
        ),
        "crossed": QP(qp.H, qp.g, qp.C, qp.u + 1, qp.u),
        "no such number": QP(qp.H, qp.g, qp.C, np.full(10, np.inf), np.full(10, np.inf)),
        "indefinite": QP(qp.H - 2e3 * np.eye(5), qp.g, qp.C, qp.l, qp.u),
        "NaN in H": QP(qp.H * np.nan, qp.g, qp.C, qp.l, qp.u),
        "NaN in g": QP(qp.H, qp.g * np.nan, qp.C, qp.l, qp.u),
        "NaN in C": QP(qp.H, qp.g, qp.C * np.nan, qp.l, qp.u),
        "NaN in l": QP(qp.H, qp.g, qp.C, qp.l * np.nan, qp.u),
        "NaN in u": QP(qp.H, qp.g, qp.C, qp.l, qp.u * np.nan),
    }
    for case, problem in bad.items():
        solution = solver.solve(problem)
        infeasible = case in ("contradiction", "crossed", "no such number")
        assert solution.status is (Status.INFEASIBLE if infeasible else Status.INVALID), case
        assert not solution.solved and np.isnan(solution.x).all() and np.isnan(solution.lam).all()
        np.testing.assert_allclose(solver.solve(qp).x, x, atol=ACCURACY[name], err_msg=case)


@every_solver
def test_iteration_limit_is_not_a_solution(name):
    """A solver that may not iterate enough says so and returns no x."""
    limit = {"active-set": 3, "daqp": 3, "osqp": 1}[name]
    qp, _, _ = solved_qp(np.random.default_rng(0))
    solution = make_solver(name, max_iter=limit).solve(qp)
    assert solution.status is Status.ITERATION_LIMIT and np.isnan(solution.x).all()


@every_solver
def test_same_bits_after_a_reset(name):
    """After `reset` a solver forgets: the same sequence gives the same bits."""
    solver = make_solver(name)
    problems = [solved_qp(np.random.default_rng(seed), n=8, m=20, active=4)[0] for seed in range(5)]
    first = [solver.solve(qp).x.tobytes() for qp in problems]
    solver.reset()
    assert [solver.solve(qp).x.tobytes() for qp in problems] == first
    fresh = make_solver(name)
    assert [fresh.solve(qp).x.tobytes() for qp in problems] == first


@every_solver
def test_problem_and_solution_are_the_callers(name):
    """A solver does not write to the problem, and a solution does not change later."""
    solver = make_solver(name)
    qp, _, _ = solved_qp(np.random.default_rng(0), n=8, m=20, active=4)
    before = [array.copy() for array in vars(qp).values()]
    solution = solver.solve(qp)
    x, lam = solution.x.copy(), solution.lam.copy()
    for array, copy in zip(vars(qp).values(), before, strict=True):
        assert array.tobytes() == copy.tobytes()
        array *= 1.5  # the caller reuses its memory
    solver.solve(solved_qp(np.random.default_rng(1), n=8, m=20, active=4)[0])
    assert (solution.x == x).all() and (solution.lam == lam).all()


@pytest.mark.parametrize(("name", "fewest"), [("daqp", 1), ("osqp", 10)])
def test_warm_start_saves_iterations(name, fewest):
    """The same problem again costs the fewest iterations that there can be; without, more."""
    qp, _, _ = solved_qp(np.random.default_rng(0))
    warm, cold = make_solver(name), make_solver(name, warm_start=False)
    first = warm.solve(qp).iterations
    assert cold.solve(qp).iterations == first > fewest
    assert warm.solve(qp).iterations == fewest < cold.solve(qp).iterations


def test_osqp_is_accurate_on_problems_of_mixed_units():
    """Rows and variables in very different units do not spoil what OSQP finds."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        qp, x, _ = solved_qp(rng, condition=10)
        unit = 10.0 ** rng.integers(-3, 4, 21)
        mixed = QP(unit[:, None] * qp.H * unit, unit * qp.g, qp.C * unit, qp.l, qp.u)
        solution = make_solver("osqp").solve(mixed)
        np.testing.assert_allclose(unit * solution.x, x, atol=ACCURACY["osqp"])


def test_osqp_inaccurate_is_solved_only_on_request():
    """ "Solved inaccurate" is a status of its own unless the option takes it for solved."""
    qp, _, _ = solved_qp(np.random.default_rng(0))
    tight = {"eps_abs": 1e-4, "eps_rel": 1e-4, "check_termination": 1, "polishing": False}
    needed = make_solver("osqp", **tight).solve(qp).iterations
    limits = range(2, needed)
    found = [make_solver("osqp", **tight, max_iter=limit).solve(qp).status for limit in limits]
    assert Status.SOLVED not in found and Status.INACCURATE in found
    limit = limits[found.index(Status.INACCURATE)]
    solution = make_solver("osqp", **tight, max_iter=limit, accept_inaccurate=True).solve(qp)
    assert solution.solved and np.isfinite(solution.x).all()


def test_osqp_polishing_makes_solutions_exact():
    """With the active rows found, polishing leaves rounding errors only; it never does harm."""
    errors: dict[bool, list[float]] = {True: [], False: []}
    for seed in range(30):
        qp, x, _ = solved_qp(np.random.default_rng(seed), n=10, m=25, active=5, condition=100)
        for polishing, found in errors.items():
            solution = make_solver("osqp", polishing=polishing).solve(qp)
            found.append(np.abs(solution.x - x).max())
    assert np.median(errors[True]) < 1e-12 and np.median(errors[False]) > 1e-6
    assert all(after <= 2 * before for after, before in zip(*errors.values(), strict=True))


def test_polishing_refuses_what_is_not_better():
    """If the rows taken for active are the wrong ones, x and lam stay what they were."""
    qp, x, lam = solved_qp(np.random.default_rng(0), n=6, m=12, active=4, condition=10)
    L = np.linalg.cholesky(qp.H)
    inactive = int(np.flatnonzero(lam == 0.0)[0])
    wrong = lam.copy()
    wrong[inactive] = 100.0
    kept_x, kept_lam = polish(qp, L, x, wrong)
    assert kept_x is x and kept_lam is wrong
    near_x, near_lam = x + 1e-6, lam * (1 + 1e-6)
    better_x, better_lam = polish(qp, L, near_x, near_lam)
    np.testing.assert_allclose(better_x, x, atol=1e-12)
    np.testing.assert_allclose(better_lam, lam, atol=1e-9)


def test_osqp_prints_nothing(capfd):
    """Also where no row is active, which OSQP's own polishing would announce."""
    rng = np.random.default_rng(0)
    qp, _, _ = solved_qp(rng, n=5, m=8, active=0)
    assert make_solver("osqp").solve(qp).solved
    assert capfd.readouterr() == ("", "")


def test_daqp_and_active_set_agree_on_hard_problems():
    """Two exact methods find the same x on degenerate problems."""
    for seed in range(40):
        rng = np.random.default_rng(seed)
        qp = random_qp(rng, "degenerate", n=10, m=30)
        x, y = (make_solver(name).solve(qp).x for name in ("active-set", "daqp"))
        np.testing.assert_allclose(x, y, atol=1e-6 * np.abs(x).max())


def test_residuals_of_a_solution_and_of_a_wrong_one():
    """All three residuals are zero at the solution; each shows the fault that it is for."""
    qp = QP(np.eye(2), np.array([-3.0, 0.0]), np.eye(2), np.array([-1.0, -np.inf]), np.ones(2))

    def of(x, lam):
        return residuals(qp, Solution(np.array(x), np.array(lam), Status.SOLVED, 1, 0.0))

    assert of([1.0, 0.0], [2.0, 0.0]) == (0.0, 0.0, 0.0)
    assert of([1.5, 0.0], [1.5, 0.0]).primal == 0.5
    assert of([-1.25, 0.0], [0.0, 0.0]).primal == 0.25
    assert of([1.0, 0.0], [1.5, 0.0]).dual == 0.5
    assert of([0.5, 0.0], [2.5, 0.0]) == (0.0, 0.0, 1.25)
    assert of([1.0, 0.0], [2.0, -0.1]).gap == np.inf  # holds at a bound that is not there


def test_residuals_agree_with_qpsolvers():
    """The same measures as qpsolvers takes, which judges one-sided problems."""
    qpsolvers = pytest.importorskip("qpsolvers")
    rng = np.random.default_rng(0)
    qp, x, lam = solved_qp(rng, n=6, m=9, active=3)
    x, lam = x + 0.01 * rng.normal(size=6), lam + 0.01
    problem = qpsolvers.Problem(qp.H, qp.g, np.vstack([qp.C, -qp.C]), np.concatenate([qp.u, -qp.l]))
    theirs = qpsolvers.Solution(problem, found=True, x=x)
    theirs.y, theirs.z_box = np.empty(0), np.empty(0)
    theirs.z = np.concatenate([np.maximum(lam, 0), np.maximum(-lam, 0)])
    ours = residuals(qp, Solution(x, lam, Status.SOLVED, 1, 0.0))
    assert ours.primal == pytest.approx(theirs.primal_residual())
    assert ours.dual == pytest.approx(theirs.dual_residual())
    assert ours.gap == pytest.approx(theirs.duality_gap())


def test_shapes_must_agree():
    """A problem whose arrays do not fit together cannot be made."""
    with pytest.raises(ValueError, match=r"C must be \(3, 2\), not \(2, 2\)"):
        QP(np.eye(2), np.ones(2), np.eye(2), np.zeros(3), np.ones(3))


def test_unknown_solver():
    """The error lists the solvers that there are."""
    with invalid("solver", "'cvx'", "active-set", "daqp", "osqp"):
        make_solver("cvx")


def options_of(name: str, **options: Any) -> Any:
    """The options that the solver works with."""
    solver: Any = make_solver(name, **options)
    return solver.options


@every_solver
def test_options(name):
    """Unknown options list the valid ones, values are checked, whole numbers may be floats."""
    with pytest.raises(ConfigError, match=f"solver {name}: tolerance: .*max_iter"):
        make_solver(name, tolerance=1)
    for wrong in (0, -5, 2.5, "many", True, None, float("nan")):
        with pytest.raises(ConfigError, match="max_iter"):
            make_solver(name, max_iter=wrong)
    assert options_of(name, max_iter=50.0).max_iter == 50


def test_flags_may_be_numbers():
    """0 and 1 stand for false and true, as in a mapping of plain numbers."""
    assert options_of("osqp", polishing=0.0).polishing is False
    assert options_of("daqp", warm_start=1).warm_start is True
    with pytest.raises(ConfigError, match="polishing"):
        make_solver("osqp", polishing=0.5)


def test_solvers_are_imported_when_used():
    """Importing the package loads neither OSQP nor DAQP."""
    code = "import sys, poise.baselines.solvers; sys.exit(bool({'osqp', 'daqp'} & {*sys.modules}))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
