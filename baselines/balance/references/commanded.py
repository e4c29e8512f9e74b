"""Walks that a planner of steps performs: what it is told over time, and what trunk and arms do."""

from __future__ import annotations

import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease
from poise.envs.robots.robot import Robot

from .legs import PlantedLegs

#: columns of commands: [s], [m/s] twice, [rad/s], [s] from lift-off to touchdown
START, AHEAD, LEFT, TURN, STEP_TIME, COLUMNS = 0, 1, 2, 3, 4, 5
MOST = 200  # rows
SHIFT, END = 0.7, 1.5  # [s] in which the weight shifts to the first foot; and to stand at the end
RAMP, TURN_RAMP = 0.03, 0.08  # [g], [ω²] by which a planner gets to what it is told


def check_commands(commands: np.ndarray, source: str) -> None:
    """Raise ConfigError unless commands are 1 to 200 finite rows (n, 5) whose times rise from 0."""
    shaped = commands.ndim == 2 and 1 <= len(commands) <= MOST and commands.shape[1] == COLUMNS
    if not shaped or not np.isfinite(commands).all():
        raise ConfigError(f"must be 1 to {MOST} rows of {COLUMNS} numbers", source=source,
                          field="commands")  # fmt: skip
    if commands[0, START] != 0.0 or (np.diff(commands[:, START]) <= 0.0).any():
        raise ConfigError("times must rise from 0", source=source, field="commands")


def whole_walk(
    robot: Robot, qpos: np.ndarray, dt: float, commands: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The joints (n, nj) [rad] of a walk from standing to standing, and its commands (m, 5).

    Legs are those of standing: the planner moves them. The robot gets to the first command before
    the clip `qpos` (F, nq) begins, which is the second row, and the last row is zero, at its end.
    """
    before, after = (SHIFT + _ramp(robot, row) for row in commands[[0, -1]])
    first, last = (max(round(time / dt), 1) for time in (before, after + END))
    joints, rest = qpos[:, 7:].copy(), robot.standing_qpos[7:]
    legs = PlantedLegs(robot).legs
    joints[:, legs] = rest[legs]
    way = ease(np.arange(first) / first)[:, None]
    back = ease(np.arange(1, last + 1) / last)[:, None]
    joints = np.concatenate([
        rest + way * (joints[0] - rest), joints, joints[-1] + back * (rest - joints[-1])
    ])  # fmt: skip
    told = commands.copy()
    told[:, START] += first * dt
    begin, end = commands[:1].copy(), np.zeros((1, COLUMNS))
    begin[0, START], end[0, START] = min(SHIFT, 0.5 * first * dt), (first + len(qpos) - 1) * dt
    return joints, np.concatenate([begin, told, end])


def _ramp(robot: Robot, row: np.ndarray) -> float:
    """Time from standing to a command [s]."""
    speed = float(np.hypot(row[AHEAD], row[LEFT])) / (RAMP * robot.units.gravity)
    return max(speed, abs(float(row[TURN])) / (TURN_RAMP * robot.omega**2))


def faster(commands: np.ndarray, factor: float) -> np.ndarray:
    """Commands `factor` times as fast."""
    return np.asarray(commands * [1 / factor, factor, factor, factor, 1 / factor])


def told(commands: np.ndarray) -> list[dict[str, float]]:
    """Commands as `reset` takes them."""
    names = ("start", "ahead", "left", "turn", "step_time")
    return [{name: float(value) for name, value in zip(names, row, strict=True) if value > 0.0
             or name != "step_time"} for row in commands]  # fmt: skip
