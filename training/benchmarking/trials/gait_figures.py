"""The figures of a walk: its speed against the command, its steps, what it costs."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.schedule import TimedCommand
from poise.envs.compiled.maths.runs import runs_of

from .gait_record import WalkArrays, step_error, step_measures

SWING_TIME = 0.08  # [s] off the ground, below which a foot has only rocked or bounced
SETTLING = 4.0  # [s] after a change of the command, from which strides are compared with it
SPEED_TOLERANCE, TURN_TOLERANCE = 0.05, np.radians(5.0)  # [m/s], [rad/s] beyond its own error
FALLING = 1.0  # [s] before a fall, in which strides are part of the fall
STOPPED = 1.0  # [s] without a touchdown, after which a robot does not walk any more
SLOW = 0.1  # [m/s] below which the cost of transport is undefined
WINDOW = 4  # steps, two strides, by which the end of a walk is judged


class TrackingError(NamedTuple):
    """The distance of a walk's velocity from its command."""

    speed: float  # of ahead and left together [m/s]
    turn: float  # of the turn rate [rad/s]


NO_ERROR = TrackingError(0.0, 0.0)


class Touchdowns(NamedTuple):
    """The touchdowns of a walk, in the order of time."""

    row: np.ndarray  # (k,) of the record
    foot: np.ndarray  # (k,) which one landed


def touchdowns(record: WalkArrays) -> Touchdowns:
    """Return touchdowns after a swing of 0.08 s or more."""
    found: list[tuple[int, int]] = []
    for foot in range(record.down.shape[1]):
        for lifted, landed in runs_of(~record.down[:, foot]).tolist():
            if lifted == 0 or landed == len(record.time):  # it has not lifted off, or not landed
                continue
            if record.time[landed] - record.time[lifted] >= SWING_TIME - 1e-9:
                found.append((landed, foot))
    rows = np.array(sorted(found), dtype=int).reshape(-1, 2)
    return Touchdowns(rows[:, 0], rows[:, 1])


class RecordedWalk:
    """A recorded walk and its commands.

    Velocities are means over a stride, two steps from touchdown to touchdown, of the CoM along the
    mean heading of that stride.

    `transfer_time` is T_d, of the gait that is to follow a commanded step time [s].

    Attributes:
        landed: its touchdowns.
        velocity: (k − 2, 3) of the stride that ends with touchdown 2, 3, …: ahead, left [m/s], turn
            [rad/s].
        wanted: (k − 2, 3) the command at its end.
        settled: (k − 2,) whether the command was the same all the time, and for 4 s before, and it
            ends a second or more before a fall.
    """

    def __init__(
        self, record: WalkArrays, commands: Sequence[TimedCommand], fall_time: float | None = None,
        transfer_time: float = 0.0,
    ):  # fmt: skip
        self.record, self.commands, self._transfer_time = record, commands, transfer_time
        until = np.inf if fall_time is None else fall_time - FALLING
        self.landed = touchdowns(record)
        rows = self.landed.row
        spans = list(zip(rows[:-2], rows[2:], strict=True))
        self.velocity = np.array([self.mean_velocity(*span) for span in spans]).reshape(-1, 3)
        wanted = [self.command_at(record.time[row]).array()[:3] for row in rows[2:]]
        self.wanted = np.array(wanted).reshape(-1, 3)
        begun = [self._changed(record.time[row]) for row in rows[2:]]
        self.settled = record.time[rows[:-2]] >= np.array(begun) + SETTLING
        self.settled &= record.time[rows[2:]] <= until
        self._known = np.zeros(len(record.time), dtype=bool)  # rows of settled strides
        for first, last in np.array(spans, dtype=int).reshape(-1, 2)[self.settled]:
            self._known[first:last] = True

    def mean_velocity(self, first: int, last: int) -> np.ndarray:
        """(3,) ahead, left [m/s] and turn [rad/s] from row to row."""
        r = self.record
        time, yaw = r.time[last] - r.time[first], self.mean_yaw(first, last)
        x, y = (r.com[last] - r.com[first]) / time
        cos, sin = np.cos(yaw), np.sin(yaw)
        return np.array([
            cos * x + sin * y, cos * y - sin * x, (r.yaw[last] - r.yaw[first]) / time
        ])  # fmt: skip

    def mean_yaw(self, first: int, last: int) -> float:
        """Return the mean heading from row to row [rad]."""
        return float(np.mean(self.record.yaw[first:last]))

    def command_at(self, time: float) -> GaitCommand:
        """Return the command that holds at a time [s]."""
        past = [each for each in self.commands if each.start <= time + 1e-9]
        return past[-1] if past else GaitCommand()

    def _changed(self, time: float) -> float:
        """Return the start of the command that holds at a time [s]."""
        return max((each.start for each in self.commands if each.start <= time + 1e-9), default=0.0)

    def own_error(self, until: float | None = None) -> TrackingError | None:
        """Return the tracking error of the walk itself: the largest over its settled strides i that
        end before `until` [s] and follow the last command,

            e_v = max_i |v_i − v*|,   e_ω = max_i |ω_i − ω*|

        v_i and v* the mean velocity of stride i along its mean heading, and the command, ω_i and ω*
        the turn rates. None without such a stride.
        """
        last = self.command_at(self.record.time[-1]).array()[:3]
        own = self.settled & np.all(self.wanted == last, axis=1)
        if until is not None:
            own &= self.record.time[self.landed.row[2:]] <= until
        errors = self.velocity[own] - last
        if not len(errors):
            return None
        speed = float(np.linalg.norm(errors[:, :2], axis=1).max())
        return TrackingError(speed, float(np.abs(errors[:, 2]).max()))

    def last_error(self) -> TrackingError | None:
        """Return the distance of the mean velocity over the last two strides from the command,
        along their mean heading.

        None without four steps between touchdowns, the last one in the last second: the walk has
        stopped.
        """
        rows, r = self.landed.row, self.record
        if len(rows) <= WINDOW or r.time[-1] - r.time[rows[-1]] > STOPPED:
            return None
        wanted = self.command_at(r.time[-1]).array()[:3]
        off = self.mean_velocity(rows[-1 - WINDOW], rows[-1]) - wanted
        return TrackingError(float(np.hypot(*off[:2])), abs(float(off[2])))

    def as_commanded(self, own: TrackingError = NO_ERROR) -> bool:
        """Return whether the last two strides are as near to the command as the controller's own
        strides:

            |v − v*| ≤ e_v + 0.05 m/s,   |ω − ω*| ≤ e_ω + 5 °/s

        v and ω as of `last_error`. `own` is (e_v, e_ω) of `own_error`, the strides before a push or
        those of the same walk without it. A steady error of a controller's own is therefore not
        charged to the push. Without `own` the walk is compared with the command alone. A heading is
        not commanded, so none is asked for.
        """
        last = self.last_error()
        return last is not None and near(last, own)

    def figures(self) -> dict[str, float | None]:
        """Return the figures of an `Outcome`, of the strides and steps that are settled."""
        velocity, error = self.velocity[self.settled], (self.velocity - self.wanted)[self.settled]
        off, turn = np.linalg.norm(error[:, :2], axis=1), error[:, 2]
        return {
            "speed_ahead": _mean(velocity[:, 0]),
            "speed_left": _mean(velocity[:, 1]),
            "turn_rate": _mean(velocity[:, 2]),
            "speed_error": _mean(off),
            "speed_error_rms": _root_mean_square(off),
            "turn_error_rms": _root_mean_square(turn),
            **self._steps(),
            **self._costs(),
            **self._knees(),
            "circle_error": self._circle_error(),
            "foot_slide": self._slide(),
            "yaw_momentum": _root_mean_square(self.record.spin[self._known]),
        }

    def _steps(self) -> dict[str, float | None]:
        """Return means of the steps that end settled strides, and their error."""
        rows, times = self.landed.row, self.record.time
        ends = np.flatnonzero(self.settled) + 2
        yaws = [self.mean_yaw(rows[k - 2], rows[k]) for k in ends]
        measures = step_measures(
            self.record, rows[ends], self.landed.foot[ends], yaws, self.command_at
        )
        names = ("step_length", "step_width", "swing_time", "step_clearance")
        periods = times[rows[ends]] - times[rows[ends - 1]]
        return {
            **{name: _mean(measures[name]) for name in names},
            "step_time": _mean(periods),
            "step_error": step_error(
                {**measures, "duration": periods - self._transfer_time},
                times[rows[ends]],
                self.command_at,
            ),
        }

    def _costs(self) -> dict[str, float | None]:
        """∫ Σ |τ q̇| dt over the way [J/m] from the first settled stride to the last, and of the
        positive work alone; None below 0.1 m/s."""
        r, rows = self.record, self.landed.row
        ends = np.flatnonzero(self.settled) + 2
        names = ("energy_per_metre", "work_per_metre")
        if not len(ends):
            return dict.fromkeys(names)
        first, last = ends[0] - 2, ends[-1]
        points = r.com[rows[first : last + 1 : 2]]
        way = float(np.sum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
        last = first + 2 * (len(points) - 1)
        spent = [each[rows[last]] - each[rows[first]] for each in (r.energy, r.work)]
        if way < SLOW * (r.time[rows[last]] - r.time[rows[first]]):
            return dict.fromkeys(names)
        return {name: float(each) / way for name, each in zip(names, spent, strict=True)}

    def _knees(self) -> dict[str, float | None]:
        """Return the mean and largest |τ|/m [N·m/kg] of the stance leg's knee on one foot."""
        r = self.record
        single = self._known & (r.down.sum(axis=1) == 1)
        load = r.knees[single, np.argmax(r.down[single], axis=1)]
        known = load[np.isfinite(load)]
        return {
            "knee_mean": _mean(known),
            "knee_peak": float(known.max()) if len(known) else None,
        }

    def _slide(self) -> float | None:
        """Return the largest displacement of a stance sole in single support [m]."""
        r, worst = self.record, 0.0
        for foot in range(r.down.shape[1]):
            alone = self._known & r.down[:, foot] & (r.down.sum(axis=1) == 1)
            for first, last in runs_of(alone):
                ways = r.feet[first:last, foot] - r.feet[first, foot]
                worst = max(worst, float(np.linalg.norm(ways, axis=1).max()))
        return worst if self._known.any() else None

    def _circle_error(self) -> float | None:
        """Return the largest distance of the settled walk, averaged over strides, from the circle
        that is commanded, around the middle that it goes round [m]; None unless one command is a
        circle.

        The middle c solves |p|² = 2 p · c + k for the walk's points p by least squares.
        """
        turning = [each for each in self.commands if each.turn and np.hypot(each.ahead, each.left)]
        rows, ends = self.landed.row, np.flatnonzero(self.settled) + 2
        if len(self.commands) != 1 or not turning or len(ends) < 3:
            return None
        command = turning[0]
        radius = np.hypot(command.ahead, command.left) / abs(command.turn)
        points = np.array([self.record.com[rows[k - 2] : rows[k]].mean(axis=0) for k in ends])
        sides = np.column_stack([2.0 * points, np.ones(len(points))])
        middle = np.linalg.lstsq(sides, np.sum(points**2, axis=1), rcond=None)[0][:2]
        return float(np.max(np.abs(np.linalg.norm(points - middle, axis=1) - radius)))

    def phase_at(self, time: float, left: int) -> float | None:
        """Return the phase of the stride at a time [s]: 0 where the `left` foot lands, ½ the other
        one.

        Between touchdowns it advances at the pace of the last step. None before the third one, and
        where both feet land at once.
        """
        rows, feet, times = self.landed.row, self.landed.foot, self.record.time
        past = int(np.sum(times[rows] <= time))
        if past < 3:
            return None
        last, step = times[rows[past - 1]], times[rows[past - 1]] - times[rows[past - 2]]
        if step == 0.0:
            return None
        part = min((time - last) / step, 1.0 - 1e-9)
        return float(0.5 * part + (0.0 if feet[past - 1] == left else 0.5))


def near(last: TrackingError, own: TrackingError) -> bool:
    """Return whether the inequalities of `Walk.as_commanded` hold."""
    slow, turned = last.speed - own.speed, last.turn - own.turn
    return bool(slow <= SPEED_TOLERANCE and turned <= TURN_TOLERANCE)


def _mean(values: np.ndarray) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _root_mean_square(values: np.ndarray) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None
