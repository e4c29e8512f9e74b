"""A reference motion in time: joints, centre of mass and root of one robot; or the commands of a
step planner over time while the robot performs it."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.maths.easing import ease
from poise.envs.robots.robot import Robot

from .footfalls import COLUMNS as COLUMNS_OF_STEPS
from .footfalls import landings
from .footing import Footing
from .legs import PlantedLegs
from .splines import evaluate

STILL = 1e-6  # [rad, m] by which a posture that is held may change
MOST_COMMANDS = 200  # rows
SHIFT, END = 0.7, 1.5  # [s] in which the weight shifts to the first foot; and to stand at the end
RAMP, TURN_RAMP = 0.015, 0.08  # [g], [ω²] by which a planner approaches the command


class WalkCommand(NamedTuple):
    """A row of a motion's commands; of `WalkCommand(*commands.T)` the fields are the columns."""

    start: float | np.ndarray  #: [s]
    ahead: float | np.ndarray  #: [m/s]
    left: float | np.ndarray  #: [m/s]
    turn: float | np.ndarray  #: [rad/s]
    step_time: float | np.ndarray  #: from lift-off to touchdown [s]


COLUMNS = len(WalkCommand._fields)


class MotionSample(NamedTuple):
    """A reference motion at one time; nj = nv − 6 joints in dof order.

    The CoM is relative to the mean of the sole points, in the heading frame, so com_offset[2]
    is its height. root is the rotation vector φ from the standing root orientation, in the
    heading frame: R = R_heading exp(φ) R_standing.
    """

    q_ref: np.ndarray  # (nj,) [rad]
    v_ref: np.ndarray
    a_ref: np.ndarray
    com_offset: np.ndarray  # (3,) [m]
    com_vel: np.ndarray
    com_acc: np.ndarray
    root: np.ndarray  # (3,) [rad]
    root_vel: np.ndarray
    root_acc: np.ndarray


@dataclass(frozen=True, eq=False)
class ReferenceMotion(Copyable):
    """A motion of one robot, C² in time, as a table of cubic polynomials.

    Columns of `coeffs` (k, 4, nj+6): joint positions, CoM offset (3), root rotation φ (3); see
    `splines.piecewise` for the layout and `splines.evaluate` for the compiled evaluation. With
    `commands` (n, 5), whose rows are `WalkCommand`s, it is what trunk and arms do while the
    robot walks as commanded. `walked` (n, 4) are the footfalls of the clip that is walked so, see
    `footfalls`.
    """

    name: str
    knots: np.ndarray  # (k+1,) [s]
    coeffs: np.ndarray  # (k, 4, nj+6)
    loop: bool
    footing: Footing | None = None  # None: both soles stay planted
    commands: np.ndarray | None = None  # None: it does not walk
    walked: np.ndarray | None = None  # None: not known, or its own soles step
    free_arms: bool = False  # trunk and arms of a walk balance the robot first

    @property
    def footfalls(self) -> np.ndarray:
        """(n, 4) when each foot lands, and where from the other one; see `footfalls`."""
        if self.footing is not None:
            return landings(self.footing)
        return np.empty((0, COLUMNS_OF_STEPS)) if self.walked is None else self.walked

    @property
    def duration(self) -> float:
        """Time of the last keyframe [s]."""
        return float(self.knots[-1])

    @property
    def moves(self) -> bool:
        """False for a posture that is held."""
        return bool(np.ptp(self.coeffs[:, 0], axis=0).max() >= STILL)

    def at_speed(self, factor: float) -> "ReferenceMotion":
        """The motion `factor` > 0 times as fast: q(factor t)."""
        powers = float(factor) ** np.arange(self.coeffs.shape[1])
        coeffs = self.coeffs * powers[:, None]
        footing = None if self.footing is None else self.footing.at_speed(factor)
        commands = None if self.commands is None else faster(self.commands, factor)
        walked = None if self.walked is None else self.walked / [factor, 1.0, 1.0, 1.0]
        knots = self.knots / factor
        return replace(self, knots=knots, coeffs=coeffs, footing=footing, commands=commands,
                       walked=walked)  # fmt: skip

    def sample(self, t: float) -> MotionSample:
        """The reference at time t [s]."""
        out = np.zeros((3, self.coeffs.shape[2]))
        evaluate(self.knots, self.coeffs, self.loop, t, out[0], out[1], out[2])
        joints, com, root = out[:, :-6], out[:, -6:-3], out[:, -3:]
        return MotionSample(*joints, *com, *root)


def check_commands(commands: np.ndarray, source: str) -> None:
    """Raise ConfigError unless commands are 1 to 200 finite rows (n, 5) whose times rise from 0."""
    shaped = commands.ndim == 2 and commands.shape[1] == COLUMNS
    if not shaped or not 1 <= len(commands) <= MOST_COMMANDS or not np.isfinite(commands).all():
        raise ConfigError(f"must be 1 to {MOST_COMMANDS} rows of {COLUMNS} numbers", source=source,
                          field="commands")  # fmt: skip
    start = np.asarray(WalkCommand(*commands.T).start)
    if start[0] != 0.0 or (np.diff(start) <= 0.0).any():
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
    walked = commands.copy()
    np.asarray(WalkCommand(*walked.T).start)[:] += first * dt
    begin = WalkCommand(*commands[0])._replace(start=min(SHIFT, 0.5 * first * dt))
    end = WalkCommand((first + len(qpos) - 1) * dt, 0.0, 0.0, 0.0, 0.0)
    return joints, np.concatenate([[begin], walked, [end]])


def _ramp(robot: Robot, row: np.ndarray) -> float:
    """Time from standing to a command [s]."""
    command = WalkCommand(*row.tolist())
    speed = float(np.hypot(command.ahead, command.left)) / (RAMP * robot.units.gravity)
    return max(speed, abs(float(command.turn)) / (TURN_RAMP * robot.omega**2))


def faster(commands: np.ndarray, factor: float) -> np.ndarray:
    """Commands `factor` times as fast."""
    return np.asarray(commands * [1 / factor, factor, factor, factor, 1 / factor])


def command_options(commands: np.ndarray) -> list[dict[str, float]]:
    """Return commands as the option `command` of `reset` takes them."""
    names = ("start", "ahead", "left", "turn", "step_time")
    return [{name: float(value) for name, value in zip(names, row, strict=True) if value > 0.0
             or name != "step_time"} for row in commands]  # fmt: skip
