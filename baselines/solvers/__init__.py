"""Dense, small, strictly convex quadratic programs: one interface, three solvers."""

from .problem import QP, SOLVERS, Residuals, Solution, Solver, Status, make_solver, residuals

__all__ = [
    "QP",
    "SOLVERS",
    "Residuals",
    "Solution",
    "Solver",
    "Status",
    "make_solver",
    "residuals",
]
