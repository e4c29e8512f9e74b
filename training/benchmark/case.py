"""A trial of the benchmark: a push, and in what the world differs from the standard case."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

from poise.training.trials.trial import OUTCOMES, PUSH_COLUMNS, Outcome, Trial, row

Part = Literal["envelope", "margin", "factors", "mix"]


@dataclass(frozen=True)
class Case(Trial):
    """What a controller meets. The defaults are the standard case.

    Attributes:
        part: of the suite.
        factor: which factor this trial varies; "standard" for the case they are compared with.
        level: its value, as text.
        friction: of floor and soles; None: the robot's own.
        delay: of the sensors [s].
        mass_error: by which the masses differ from those that the controller knows.
        pushes: how often the push is given, with `interval` [s] from start to start.
    """

    part: Part = "envelope"
    factor: str | None = None
    level: str | None = None
    friction: float | None = None
    delay: float = 0.0
    mass_error: float = 0.0
    pushes: int = 1
    interval: float = 1.0

    @property
    def options(self) -> dict[str, Any]:
        """For the environment's `reset`."""
        push = self.push
        if push is None:
            return {"push": []}
        starts = [push.start + k * self.interval for k in range(self.pushes)]
        return {"push": [replace(push, start=start) for start in starts]}


@dataclass(frozen=True)
class Result:
    """What became of a case.

    Attributes:
        outcome: as of `poise evaluate`.
        sway: body sway [rad], see `training/statistics/eurobench.py`; None where there is none.
        sway_recovery: recovery time by the sway's speed [s].
        error: what the controller raised, on one line; the trial then counts as not recovered.
    """

    outcome: Outcome
    sway: float | None = None
    sway_recovery: float | None = None
    error: str | None = None


def failed(error: Exception) -> Result:
    """The result of a trial in which the controller raised."""
    nothing = dict.fromkeys(OUTCOMES)
    nothing |= {"recovered": False, "fallen": False, "stepped": False, "steps": 0}
    nothing |= {"saturation": 0.0, "solver_failures": 0}
    text = " ".join(f"{type(error).__name__}: {error}".split())
    return Result(Outcome(**nothing), error=text)  # type: ignore[arg-type]


FACTOR_COLUMNS = ("friction", "delay", "mass_error", "pushes", "interval")
CASE_COLUMNS = ("part", "factor", "level")
RESULT_COLUMNS = ("sway", "sway_recovery", "error")
COLUMNS = (
    *("trial", "controller", "seed", "stage"), *CASE_COLUMNS, *PUSH_COLUMNS, *FACTOR_COLUMNS,
    "limit_fraction", *OUTCOMES, *RESULT_COLUMNS,
)  # fmt: skip


def case_row(case: Case, controller: str, result: Result) -> dict[str, Any]:
    """A line of trials.csv."""
    line = row(case, controller, result.outcome)
    del line["later"]  # `pushes` and `interval` say how a case goes on
    line |= {name: getattr(case, name) for name in (*CASE_COLUMNS, *FACTOR_COLUMNS)}
    return line | {name: getattr(result, name) for name in RESULT_COLUMNS}
