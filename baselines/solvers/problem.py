"""A quadratic program, its solution, the solution's residuals, and the solvers by name."""

import dataclasses
import time
from dataclasses import dataclass
from enum import StrEnum
from importlib import import_module
from typing import NamedTuple, Protocol

import numpy as np

from poise.configs.errors import ConfigError, PoiseError, shown
from poise.configs.schema import build

#: Name → module, class of the solver, class of its options. Imported when first used.
SOLVERS = {
    "active-set": ("active_set", "ActiveSetSolver", "ActiveSetOptions"),
    "daqp": ("daqp", "DAQPSolver", "DAQPOptions"),
    "osqp": ("osqp", "OSQPSolver", "OSQPOptions"),
}


@dataclass(frozen=True, eq=False)
class QP:
    """min ½ xᵀHx + gᵀx  subject to  l ≤ Cx ≤ u.

    H (n, n) symmetric positive definite, g (n,), C (m, n), l and u (m,). A side may be infinite;
    l == u is an equality. The arrays are kept, not copied.

    Raises:
        ValueError: the shapes do not agree.
    """

    H: np.ndarray
    g: np.ndarray
    C: np.ndarray
    l: np.ndarray  # noqa: E741
    u: np.ndarray

    def __post_init__(self) -> None:
        n, m = len(self.g), len(self.l)
        shapes = {"H": (n, n), "g": (n,), "C": (m, n), "l": (m,), "u": (m,)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} must be {shape}, not {getattr(self, name).shape}")


class Status(StrEnum):
    """The way in which a solver ended."""

    SOLVED = "solved"
    INACCURATE = "inaccurate"  # near a solution, but not within the tolerances
    INFEASIBLE = "infeasible"
    ITERATION_LIMIT = "iteration limit"
    INVALID = "invalid"  # H is not positive definite, or NaN or infinity among the numbers


@dataclass(frozen=True, eq=False)
class Solution:
    """x (n,) and lam (m,) with Hx + g + Cᵀlam = 0, lam > 0 at an upper, < 0 at a lower bound.

    Only when `solved` are they a solution. `solve_time` [s] is what the call took.
    """

    x: np.ndarray
    lam: np.ndarray
    status: Status
    iterations: int
    solve_time: float

    @property
    def solved(self) -> bool:
        return self.status is Status.SOLVED


class Residuals(NamedTuple):
    """The distance of a solution from the conditions of optimality; all are zero at the optimum."""

    primal: float  # largest violation of a row
    dual: float  # ‖Hx + g + Cᵀlam‖∞
    gap: float  # |xᵀHx + gᵀx + Σ lam⁺u + Σ lam⁻l|, infinite if lam holds at an infinite bound


def residuals(qp: QP, solution: Solution) -> Residuals:
    """Residuals of the Karush–Kuhn–Tucker conditions, in the units of the problem."""
    x, lam = solution.x, solution.lam
    Cx = qp.C @ x
    violation = np.concatenate([qp.l - Cx, Cx - qp.u, [0.0]])
    Hx = qp.H @ x
    bound = np.where(lam > 0.0, qp.u, np.where(lam < 0.0, qp.l, 0.0))
    return Residuals(
        primal=float(violation.max()),
        dual=float(np.abs(Hx + qp.g + qp.C.T @ lam).max()),
        gap=float(abs(x @ Hx + qp.g @ x + lam @ bound)),
    )


class Solver(Protocol):
    """Solves one QP after another; may start from what the last one left until it is reset."""

    def solve(self, qp: QP) -> Solution:
        """The solution, or a status that says why there is none. Does not raise for bad numbers."""

    def reset(self) -> None:
        """Forget earlier problems: the next solution depends on its own problem only."""


def failed(qp: QP, status: Status, start: float, iterations: int = 0) -> Solution:
    """No solution: x and lam are NaN. `start` is the `time.perf_counter` of the beginning."""
    x, lam = np.full(len(qp.g), np.nan), np.full(len(qp.l), np.nan)
    return Solution(x, lam, status, iterations, time.perf_counter() - start)


def uncopyable(name: str) -> PoiseError:
    """Return the error for a library's solver, which cannot be copied between its problems."""
    return PoiseError(
        f"solver {name!r} cannot be copied within an episode, for its library does not tell what "
        "it remembers: copy after the reset"
    )


def refusal(qp: QP) -> Status | None:
    """Return the status that numbers or bounds have without a solver; None where one is needed."""
    if not all(np.isfinite(a).all() for a in (qp.H, qp.g, qp.C)):
        return Status.INVALID
    if np.isnan(qp.l).any() or np.isnan(qp.u).any():
        return Status.INVALID
    if (qp.l > qp.u).any() or (qp.l == np.inf).any() or (qp.u == -np.inf).any():
        return Status.INFEASIBLE
    return None


def make_solver(name: str, **options: object) -> Solver:
    """A solver by its name; `options` are the fields of its options class.

    A whole float is taken for an int, 0 and 1 for a bool: configurations hold plain numbers.

    Raises:
        ConfigError: an unknown name or option, or a value that is not valid.
    """
    if name not in SOLVERS:
        raise ConfigError(f"unknown solver {shown(name)}", field="solver", choices=SOLVERS)
    module_name, solver_class, options_class = SOLVERS[name]
    module = import_module(f".{module_name}", __package__)
    cls = getattr(module, options_class)
    defaults = {option.name: option.default for option in dataclasses.fields(cls)}
    plain = {key: _like(defaults.get(key), value) for key, value in options.items()}
    return getattr(module, solver_class)(build(cls, plain, f"solver {name}"))


def _like(default: object, value: object) -> object:
    """The number in the type of the default, where that loses nothing."""
    if isinstance(default, bool) and not isinstance(value, bool) and value in (0, 1):
        return bool(value)
    if type(default) is int and isinstance(value, float) and value.is_integer():
        return int(value)
    return value
