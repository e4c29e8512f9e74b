"""Stances of a walk: the knee's torque, the ground's force, the CoM's height."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from poise.baselines.walking.models.legs import leg_arrays
from poise.envs.balance.base import BalanceEnv
from poise.envs.compiled.maths.runs import runs_of
from poise.envs.robots.robot import Robot
from poise.training.benchmarking.trials.gait_record import knee_motors

from .knee_moment import POINTS

SHORTEST = 0.1  # [s] that a foot is down: a stance


class Row(NamedTuple):
    """The end of a policy step."""

    time: float  # [s]
    down: np.ndarray  # (2,) whether a foot touches the ground
    knees: np.ndarray  # (2,) τ/m [N·m/kg], extension positive
    force: float  # vertical force of the ground, in m g
    height: float  # of the CoM over the soles' middle [m]


@dataclass(frozen=True)
class Stances:
    """The stances of a walk."""

    knees: np.ndarray  #: (n, 51) τ/m [N·m/kg] over each stance, extension positive
    peaks: np.ndarray  #: (n,) the largest vertical force of the ground in each, in m g
    #: half of the way of the CoM up and down in a step, mean [m]; None if there is no step
    height_amplitude: float | None


class StanceRecord:
    """Keeps what the stances need; hand it to `run_trial`."""

    def __init__(self, robot: Robot) -> None:
        self._signs = -leg_arrays(robot).knee_sign  # extension is what brings the flexion down
        self._motors: list[int] = []
        self._rows: list[Row] = []

    def __call__(self, env: BalanceEnv) -> None:
        """Keep a row."""
        if not self._rows:
            self._motors = [motor for motor in knee_motors(env) if motor is not None]
        state, robot = env.simulation.state, env.robot
        torques = self._signs * env.simulation.views.ctrl[self._motors] / robot.mass
        force = state.arrays.contact_wrench[2] / (robot.mass * robot.units.gravity)
        down, height = state.contacts > 0.5, float(state.com[2] - state.origin[2])
        self._rows.append(Row(env.simulation.time, down, torques, float(force), height))

    def stances(self, since: float) -> Stances:
        """Return the whole stances that begin `since` [s] or later."""
        time, down, knees, force, height = (np.array(c) for c in zip(*self._rows, strict=True))
        spans = [
            (foot, first, last)
            for foot in range(down.shape[1])
            for first, last in _spans(down[:, foot], time, since)
        ]
        curves = [_resampled(knees[first:last, foot]) for foot, first, last in spans]
        peaks = [force[first:last].max() for _, first, last in spans]
        ways = [np.ptp(height[first:last]) for _, first, last in spans]
        return Stances(
            np.array(curves).reshape(-1, POINTS), np.array(peaks),
            0.5 * float(np.mean(ways)) if ways else None,
        )  # fmt: skip


def _spans(down: np.ndarray, time: np.ndarray, since: float) -> list[tuple[int, int]]:
    """First row and row after the last one of whole stances of one foot."""
    whole = [(a, b) for a, b in runs_of(down).tolist() if a > 0 and b < len(down)]
    return [(a, b) for a, b in whole if time[a] >= since and time[b] - time[a] >= SHORTEST]


def _resampled(values: np.ndarray) -> np.ndarray:
    """Return (51,) values over a stance whose time is normalised."""
    return np.interp(np.linspace(0.0, 1.0, POINTS), np.linspace(0.0, 1.0, len(values)), values)
