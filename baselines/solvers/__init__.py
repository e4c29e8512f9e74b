"""Dense, small, strictly convex quadratic programs: one interface, three solvers."""

from .problem import QP, Residuals, Solution, Solver, Status, residuals
from .registry import SOLVERS, make_solver

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
