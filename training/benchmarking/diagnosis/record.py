"""What is kept of a trial at every policy step, so that its loss can be explained."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.balance.stepping.controller import SteppingController
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.episode import FAILURES


@dataclass(frozen=True, eq=False)
class Course:
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


class CourseRecord:
    """Keeps the course of a trial; hand it to `run_trial`, or call it after every step.

    A call copies some sixty numbers: microseconds, beside a policy step of a millisecond.
    """

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []
        self._supports: list[np.ndarray] = []
        self._arrays: list[tuple[np.ndarray, ...]] = []
        self._steps: SteppingController | None = None

    def __call__(self, env: BalanceEnv) -> None:
        s = env.simulation.state_arrays
        if not self._rows:
            inner = env.controller if isinstance(env, ResidualBalanceEnv) else None
            inner = getattr(inner, "unwrapped", inner)  # one from outside may be a bare object
            self._steps = inner if isinstance(inner, SteppingController) else None
            self._limit = np.array(env.robot.torque_limit)
        foot, x, y = -1, np.nan, np.nan
        if self._steps is not None:
            step = self._steps.stepping()
            if (foot := step.foot) >= 0:
                x, y = step.foothold
        failures = env.episode.metrics[FAILURES]
        self._rows.append((env.simulation.time, foot, x, y, failures))
        self._supports.append(s.support[: s.support_size[0]].copy())
        self._arrays.append((env.simulation.views.ctrl.copy(), s.capture_point.copy(),
                             s.contacts.copy(), s.sole_point[:, :2].copy()))  # fmt: skip

    def course(self) -> Course:
        """What was kept, as arrays."""
        rows = np.array(self._rows)
        ctrl, capture_point, contacts, soles = map(np.array, zip(*self._arrays, strict=True))
        return Course(
            time=rows[:, 0],
            load=np.abs(ctrl) / self._limit,
            capture_point=capture_point,
            supports=self._supports,
            contacts=contacts > 0.5,
            soles=soles,
            foothold=rows[:, 2:4],
            swinging=rows[:, 1].astype(int),
            failures=rows[:, 4],
        )
