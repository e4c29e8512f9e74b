"""The record of a trial at every policy step, from which its loss is explained."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from poise.baselines.balance.stepping.controller import SteppingController
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.walking.simbicon import Simbicon
from poise.envs.balance.base import BalanceEnv

UNSEEN = (PolicyFile, Simbicon)  #: they step without a readable plan


@dataclass(frozen=True, eq=False)
class TrialCourse:
    """The course of a trial: n rows, one after the reset and one after every policy step."""

    time: np.ndarray  #: (n,) [s]
    load: np.ndarray  #: (n, nu) |τ| of the motors over their limits
    capture_point: np.ndarray  #: (n, 2) [m]
    supports: list[np.ndarray]  #: n polygons (k, 2) of the support [m]
    contacts: np.ndarray  #: (n, nc) whether each sole touches the ground
    soles: np.ndarray  #: (n, nc, 2) their places [m]
    foothold: np.ndarray  #: (n, 2) where the foot that swings is to land [m]; NaN: none swings
    swinging: np.ndarray  #: (n,) that foot; −1: none
    failures: np.ndarray  #: (n,) control ticks so far at which the controller's solver failed


def swing_of(env: BalanceEnv) -> int | None:
    """Return the swing foot in the plan of an environment's controller, −1 without one.

    None where no plan is readable: torque policies, networks, external classes, policies whose
    servos take over. For controllers of this package that plan no steps it is always −1.
    """
    if not isinstance(env, ResidualBalanceEnv) or isinstance(env, ResidualWholeEnv):
        return None
    inner = getattr(env.controller, "unwrapped", env.controller)
    if isinstance(inner, SteppingController):
        return int(inner.stepping().foot)
    ours = type(inner).__module__.startswith("poise.") and not isinstance(inner, UNSEEN)
    return -1 if ours else None


class CourseRecord:
    """Record the course of a trial; pass it to `run_trial`, or call it after every step.

    A call takes microseconds, a policy step about a millisecond.
    """

    def __init__(self) -> None:
        self._rows: list[dict[str, Any]] = []  # of the fields of `TrialCourse`
        self._steps: SteppingController | None = None

    def __call__(self, env: BalanceEnv) -> None:
        s = env.simulation.state_arrays
        if not self._rows:
            inner = env.controller if isinstance(env, ResidualBalanceEnv) else None
            inner = getattr(inner, "unwrapped", inner)  # an external one may be a plain object
            self._steps = inner if isinstance(inner, SteppingController) else None
            self._limit = np.array(env.robot.torque_limit)
        foot, foothold = -1, (np.nan, np.nan)
        if self._steps is not None:
            step = self._steps.stepping()
            if (foot := step.foot) >= 0:
                foothold = tuple(step.foothold)
        self._rows.append({
            "time": env.simulation.time, "load": np.abs(env.simulation.views.ctrl) / self._limit,
            "capture_point": s.capture_point.copy(),
            "supports": s.support[: s.support_size].copy(), "contacts": s.contacts > 0.5,
            "soles": s.sole_point[:, :2].copy(), "foothold": foothold, "swinging": foot,
            "failures": float(env.episode.metrics.failures),
        })  # fmt: skip

    def course(self) -> TrialCourse:
        """Return the record as arrays."""
        columns = {
            name: [row[name] for row in self._rows] for name in TrialCourse.__dataclass_fields__
        }
        supports = columns.pop("supports")
        arrays = {name: np.array(column) for name, column in columns.items()}
        return TrialCourse(supports=supports, **arrays)
