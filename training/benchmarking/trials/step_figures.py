"""The steps of a walk: their measures, and how far these are from what was commanded."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from poise.baselines.walking.command import GaitCommand

from .gait_record import WalkArrays

#: parameter of a command → its measure, see `steps_of`; the `duration` of a step is from touchdown
#: to touchdown, without T_d
COMMANDED = {"step_time": "duration", "width": "apart", "clearance": "step_clearance",
             "step_length": "way"}  # fmt: skip
Commanded = Callable[[float], GaitCommand]  # the command at a time [s]


def steps_of(
    record: WalkArrays,
    rows: np.ndarray,
    feet: np.ndarray,
    yaws: Sequence[float],
    command_at: Commanded,
) -> dict[str, np.ndarray]:
    """Measures (k,) of the steps that end with the touchdown of a foot at a row, at a heading.

    `step_length` and `step_width` of the sole that lands from the other one, along the heading and
    across it [m]; `swing_time` from lift-off to touchdown [s]; `step_clearance` of the sole's
    middle at its highest above where it lands [m]. `way` and `apart` are from sole to sole when the
    other one lifts off, along the velocity that is commanded and across the heading [m]: feet that
    land fast go on for a centimetre.
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
    """The way from the other sole to this one, ahead and to the left [m]."""
    x, y = r.feet[row, foot] - r.feet[row, 1 - foot]
    return np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x


def step_error(
    measures: dict[str, np.ndarray], times: Sequence[float], command_at: Commanded
) -> float | None:
    """The largest deviation among the step parameters that are commanded, as a fraction: of the
    mean of measure/command − 1 over the steps; None where none is commanded."""
    found = []
    for parameter, measure in COMMANDED.items():
        wanted = [getattr(command_at(time), parameter) for time in times]
        ratios = [m / w for m, w in zip(measures[measure], wanted, strict=True) if w is not None]
        if ratios:
            found.append(abs(float(np.mean(ratios)) - 1.0))
    return max(found, default=None)
