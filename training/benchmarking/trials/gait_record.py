"""The record of a walk, from which its figures are computed when the trial is over."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from poise.baselines.walking.planner.command import GaitCommand
from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.legs import find_legs


@dataclass(frozen=True)
class WalkArrays:
    """A robot that walks, at the end of each of n policy steps."""

    time: np.ndarray  # (n,) [s]
    com: np.ndarray  # (n, 2) [m]
    yaw: np.ndarray  # (n,) of the heading, continuous [rad]
    down: np.ndarray  # (n, 2) whether a foot touches the ground
    feet: np.ndarray  # (n, 2, 2) soles along the ground [m]
    heights: np.ndarray  # (n, 2) of the soles [m]
    spin: np.ndarray  # (n,) angular momentum about the vertical through the CoM [N·m·s]
    knees: np.ndarray  # (n, 2) |τ|/m of each leg's knee [N·m/kg]; NaN where none is known
    energy: np.ndarray  # (n,) ∫ Σ |τ q̇| dt [J]
    work: np.ndarray  # (n,) ∫ Σ max(τ q̇, 0) dt [J]


class WalkRecord:
    """Record the data of a walk's figures; pass it to `run_trial`."""

    def __init__(self) -> None:
        self._rows: list[tuple[object, ...]] = []  # one for each field of `WalkArrays`
        self._knees: list[int | None] = []  # the motor of each leg's knee

    def __call__(self, env: BalanceEnv) -> None:
        if not self._rows:
            self._knees = knee_motors(env)
        state, metrics = env.simulation.state, env.episode.metrics
        torque = np.abs(env.simulation.views.ctrl) / env.robot.mass
        knees = [np.nan if motor is None else torque[motor] for motor in self._knees]
        self._rows.append((
            env.simulation.time, state.com[:2].copy(), state.heading_yaw,
            state.contacts > 0.5, state.sole_points[:, :2].copy(),
            state.sole_points[:, 2].copy(), float(state.angular_momentum[2]), np.array(knees),
            float(metrics.energy), float(metrics.positive_work),
        ))  # fmt: skip

    def arrays(self) -> WalkArrays:
        """What was kept."""
        arrays = WalkArrays(*map(np.array, zip(*self._rows, strict=True)))
        return replace(arrays, yaw=np.unwrap(arrays.yaw))


def knee_motors(env: BalanceEnv) -> list[int | None]:
    """Return the motor of each leg's knee in the order of the soles, None without a knee."""
    dofs = env.simulation.arrays.motor_dofs.tolist()
    knees = [leg.knee for leg in find_legs(env.robot)]
    known = [None if knee is None else env.model.joint(knee).dofadr[0] for knee in knees]
    return [dofs.index(dof) if dof in dofs else None for dof in known]


#: parameter of a command → its measure, see `step_measures`; the `duration` of a step is from
#: touchdown to touchdown, without T_d
COMMANDED = {"step_time": "duration", "width": "apart", "clearance": "step_clearance",
             "step_length": "way"}  # fmt: skip
Commanded = Callable[[float], GaitCommand]  # the command at a time [s]


def step_measures(
    record: WalkArrays,
    rows: np.ndarray,
    feet: np.ndarray,
    yaws: Sequence[float],
    command_at: Commanded,
) -> dict[str, np.ndarray]:
    """Return measures (k,) of the steps that end with the touchdown of a foot at a row, at a
    heading.

    `step_length` and `step_width` of the sole that lands from the other one, along the heading and
    across it [m]; `swing_time` from lift-off to touchdown [s]; `step_clearance` of the sole's
    middle at its highest above where it lands [m]. `way` and `apart` are from sole to sole when the
    other one lifts off, along the velocity that is commanded and across the heading [m]: feet that
    land fast slide on for a centimetre.
    """
    measures = [
        _step(record, row, foot, yaw, command_at(record.time[row]))
        for row, foot, yaw in zip(rows, feet, yaws, strict=True)
    ]
    names = ("step_length", "step_width", "swing_time", "step_clearance", "way", "apart")
    columns = np.array(measures).reshape(-1, len(names)).T
    return dict(zip(names, columns, strict=True))


def _step(
    r: WalkArrays, row: int, foot: int, yaw: float, command: GaitCommand
) -> tuple[float, ...]:
    ahead, left = _apart(r, row, foot, yaw)
    away = np.flatnonzero(~r.down[row:, 1 - foot])
    stood = max(row + (int(away[0]) if len(away) else len(r.time) - row) - 1, row)
    stood_ahead, stood_left = _apart(r, stood, foot, yaw)
    lifted = int(np.flatnonzero(r.down[:row, foot])[-1]) + 1
    highest = r.heights[lifted : row + 1, foot].max() - r.heights[row, foot]
    speed = command.speed or 1.0
    way = (command.ahead * stood_ahead + command.left * stood_left) / speed
    return ahead, abs(left), r.time[row] - r.time[lifted], highest, way, abs(stood_left)


def _apart(r: WalkArrays, row: int, foot: int, yaw: float) -> tuple[float, float]:
    """Return the way from the other sole to this one, ahead and to the left [m]."""
    x, y = r.feet[row, foot] - r.feet[row, 1 - foot]
    return np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x


def step_error(
    measures: dict[str, np.ndarray], times: Sequence[float], command_at: Commanded
) -> float | None:
    """Return the largest deviation among the step parameters that are commanded, as a fraction: of
    the mean of measure/command − 1 over the steps; None where none is commanded."""
    found = []
    for parameter, measure in COMMANDED.items():
        wanted = [getattr(command_at(time), parameter) for time in times]
        ratios = [m / w for m, w in zip(measures[measure], wanted, strict=True) if w is not None]
        if ratios:
            found.append(abs(float(np.mean(ratios)) - 1.0))
    return max(found, default=None)
