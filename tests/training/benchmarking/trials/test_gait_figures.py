"""training/benchmarking/trials/gait_figures.py: the figures of walks that are known exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.walking.schedule import TimedCommand
from poise.training.benchmarking.trials.gait_figures import RecordedWalk, touchdowns
from poise.training.benchmarking.trials.gait_record import WalkArrays

PERIOD, STEP, DOWN = 0.02, 0.4, 0.1  # [s] of the rows, of a step, of it with both feet down
HALF_WIDTH, SWAY, CLEARANCE = 0.1, 0.03, 0.06  # [m]


def step_of(time: np.ndarray) -> np.ndarray:
    """(n,) the step that a time is of."""
    return np.floor((time + 1e-9) / STEP)


def recorded(
    ahead: float = 0.5, left: float = 0.0, turn: float = 0.0, seconds: float = 20.0
) -> WalkArrays:
    """A walk at exactly these velocities, whose CoM sways from foot to foot.

    The first sole is the right one; it lands at 0.4 s, the other one at 0.8 s, and so on.
    """
    time = PERIOD * np.arange(round(seconds / PERIOD) + 1)
    yaw = 0.3 + turn * time
    axes = np.exp(1j * yaw)  # forward, as a complex number; i times it is left
    speed = (ahead + 1j * left) * axes
    middle = np.cumsum(speed) * PERIOD - speed * PERIOD
    com = middle + 1j * axes * SWAY * np.cos(np.pi * time / STEP)
    down, feet = np.ones((len(time), 2), dtype=bool), np.zeros((len(time), 2), dtype=complex)
    heights = np.zeros((len(time), 2))
    for i, t in enumerate(time):
        step, phase = divmod(t + 1e-9, STEP)
        swinging = int(step) % 2  # the right one first
        down[i, swinging] = phase < DOWN or (step == 0 and t < DOWN)
        heights[i, swinging] = 0.0 if down[i, swinging] else CLEARANCE
        for foot, side in ((0, -1.0), (1, 1.0)):
            landings = [k for k in range(int(step) + 1) if k % 2 != foot or k == 0]
            row = round(landings[-1] * STEP / PERIOD)
            feet[i, foot] = middle[row] + 1j * axes[row] * side * HALF_WIDTH
    knees = np.where(down, 1.0, 9.0)
    knees[:, 1] *= 0.5
    return WalkArrays(
        time=time, com=_plane(com), yaw=yaw, down=down, feet=_plane(feet), knees=knees,
        heights=heights, spin=np.where(step_of(time) % 2 == 0, 0.3, -0.3),
        energy=40.0 * time, work=25.0 * time,
    )  # fmt: skip


def _plane(points: np.ndarray) -> np.ndarray:
    return np.stack([points.real, points.imag], axis=-1)


def walk(
    ahead: float = 0.5, left: float = 0.0, turn: float = 0.0, told: TimedCommand | None = None
) -> RecordedWalk:
    """The walk at these velocities, told to do the same or something else."""
    return RecordedWalk(recorded(ahead, left, turn), (told or TimedCommand(ahead, left, turn),))


def test_touchdowns_are_found_and_rocking_feet_are_not() -> None:
    """Each at its time, left and right in turn; 0.06 s off the ground do not count."""
    record = recorded(seconds=4.0)
    found = touchdowns(record)
    np.testing.assert_allclose(record.time[found.row], STEP * np.arange(1, 11))
    np.testing.assert_array_equal(found.foot, [0, 1] * 5)
    down = record.down.copy()
    down[:, :] = True
    down[10:13, 0] = False
    assert len(touchdowns(replace(record, down=down)).row) == 0


@pytest.mark.parametrize(
    ("ahead", "left", "turn"), [(0.5, 0.0, 0.0), (-0.3, 0.1, 0.0), (0.4, 0.0, 0.3)]
)
def test_velocities_of_strides(ahead: float, left: float, turn: float) -> None:
    """They are those of the walk, whatever the sway; a chord is a little shorter than its arc.

    Of a turn, the CoM at the touchdowns is `SWAY` nearer to its centre, or further away.
    """
    figures = walk(ahead, left, turn).figures()
    assert figures["speed_ahead"] == pytest.approx(ahead, abs=0.003)
    assert figures["speed_left"] == pytest.approx(left, abs=0.003)
    assert figures["turn_rate"] == pytest.approx(turn, abs=1e-9)
    assert figures["speed_error"] == pytest.approx(0.0, abs=0.003 + SWAY * turn)
    assert figures["turn_error_rms"] == pytest.approx(0.0, abs=1e-9)


def test_errors_are_those_from_the_command() -> None:
    """Too slow by 0.1 m/s and off to the left by 0.05 m/s, all the time; and turning."""
    figures = walk(0.5, 0.05, 0.1, TimedCommand(0.6)).figures()
    for name in ("speed_error", "speed_error_rms"):
        assert figures[name] == pytest.approx(np.hypot(0.1, 0.05), abs=0.004)
    assert figures["turn_error_rms"] == pytest.approx(0.1, abs=1e-6)


def test_lengths_times_and_costs() -> None:
    """Steps as they were put; power over speed; the knee of the leg that stands, alone."""
    figures = walk().figures()
    assert figures["step_time"] == pytest.approx(STEP)
    assert figures["step_length"] == pytest.approx(0.5 * STEP, abs=1e-9)
    assert figures["step_width"] == pytest.approx(2.0 * HALF_WIDTH, abs=1e-9)
    assert figures["swing_time"] == pytest.approx(STEP - DOWN)
    assert figures["step_clearance"] == pytest.approx(CLEARANCE) and figures["step_error"] is None
    assert figures["yaw_momentum"] == pytest.approx(0.3)
    assert figures["energy_per_metre"] == pytest.approx(40.0 / 0.5, rel=1e-6)
    assert figures["work_per_metre"] == pytest.approx(25.0 / 0.5, rel=1e-6)
    assert figures["knee_mean"] == pytest.approx(0.75, abs=0.01) and figures["knee_peak"] == 1.0
    assert figures["foot_slide"] == 0.0 and figures["circle_error"] is None
    assert walk(0.05).figures()["energy_per_metre"] is None  # slower than 0.1 m/s


@pytest.mark.parametrize(
    ("told", "error"),
    [
        ({"step_time": STEP - DOWN}, 0.0),
        ({"step_time": 0.25}, 0.2),
        ({"step_length": 0.25}, 0.2),
        ({"width": 0.16}, 0.25),
        ({"clearance": 0.05, "width": 0.2}, 0.2),
    ],
)
def test_the_error_of_steps_is_the_largest_of_what_was_told(told: dict, error: float) -> None:
    """0.3 s in the air, 0.2 m long and wide, 0.06 m high, beside what was commanded."""
    figures = RecordedWalk(recorded(), (TimedCommand(0.5, **told),), transfer_time=DOWN).figures()
    assert figures["step_error"] == pytest.approx(error, abs=1e-6)


def test_a_sole_that_goes_on_after_it_has_landed_stands_further() -> None:
    """The error is of where it stands when the other foot leaves, 0.1 s after it has landed."""
    record = recorded()
    feet = record.feet.copy()
    for row, foot in list(zip(*touchdowns_of(record), strict=True))[:-1]:  # where the record ends
        feet[row, foot] -= 0.02 * np.array([np.cos(0.3), np.sin(0.3)])  # at touchdown alone
    figures = RecordedWalk(
        replace(record, feet=feet), (TimedCommand(0.5, step_length=0.2),)
    ).figures()
    assert figures["step_length"] == pytest.approx(0.18, abs=0.001)
    assert figures["step_error"] == pytest.approx(0.0, abs=1e-9)


def touchdowns_of(record: WalkArrays) -> tuple[np.ndarray, np.ndarray]:
    """Rows and feet of all touchdowns."""
    found = touchdowns(record)
    return found.row, found.foot


def test_steps_are_those_that_end_settled_strides() -> None:
    """A last step that is longer counts; on a curve lengths are along the heading at each step."""
    record = recorded()
    told = RecordedWalk(record, (TimedCommand(0.5),))
    feet, row, foot = record.feet.copy(), told.landed.row[-1], told.landed.foot[-1]
    feet[row, foot] += 0.7 * np.array([np.cos(0.3), np.sin(0.3)])
    longer = RecordedWalk(replace(record, feet=feet), (TimedCommand(0.5),)).figures()["step_length"]
    assert longer == pytest.approx(0.5 * STEP + 0.7 / np.count_nonzero(told.settled), abs=1e-9)
    curve = walk(0.4, 0.0, 0.3).figures()
    assert curve["step_length"] == pytest.approx(0.4 * STEP, abs=0.02)
    assert curve["step_width"] == pytest.approx(2.0 * HALF_WIDTH, abs=0.02)


def test_a_sole_that_slides_on_one_foot() -> None:
    """The largest way while the other foot is in the air, in the strides that are settled."""
    record = recorded()
    feet = record.feet.copy()
    alone = np.flatnonzero(record.down[:, 1] & ~record.down[:, 0])
    feet[alone[3:], 1, 0] += 0.05  # at 0.2 s, when it begins to walk
    feet[alone[record.time[alone] > 8.22], 1, 0] += 0.02
    slid = RecordedWalk(replace(record, feet=feet), (TimedCommand(0.5),)).figures()["foot_slide"]
    assert slid == pytest.approx(0.02)


def test_a_fall_is_no_part_of_a_walk() -> None:
    """Nor is what comes before the first settled stride, and after the last one."""
    record = recorded()
    around = (record.time < 4.0) | (record.time >= 14.4)
    knees, feet = record.knees.copy(), record.feet.copy()
    knees[around] += 50.0
    feet[around, 1, 0] += np.linspace(0.0, 3.0, np.count_nonzero(around))
    fell = RecordedWalk(
        replace(record, knees=knees, feet=feet), (TimedCommand(0.5),), fall_time=15.4
    )
    figures = fell.figures()
    assert figures["knee_peak"] == 1.0 and figures["knee_mean"] == pytest.approx(0.75, abs=0.01)
    assert figures["foot_slide"] == 0.0
    none = RecordedWalk(record, (TimedCommand(0.5),), fall_time=4.0).figures()
    assert none["knee_peak"] is None and none["foot_slide"] is None


def test_only_settled_strides_count() -> None:
    """Those that begin 4 s after a change of the command, and end a second before a fall."""
    record = recorded()
    commands = (TimedCommand(0.9), TimedCommand(0.5, start=8.0))
    told = RecordedWalk(record, commands)
    ends = record.time[told.landed.row[2:]]
    begins = record.time[told.landed.row[:-2]]
    np.testing.assert_array_equal(
        told.settled, ((begins >= 4.0) & (ends < 8.0 - 1e-9)) | (begins >= 12.0)
    )
    np.testing.assert_array_equal(told.wanted[:, 0], np.where(ends < 8.0 - 1e-9, 0.9, 0.5))
    fell = RecordedWalk(record, commands, fall_time=15.0)
    np.testing.assert_array_equal(fell.settled, told.settled & (ends <= 14.0))


def test_as_commanded_is_within_5_cm_a_second_and_5_degrees_a_second() -> None:
    """Speeds and turns on both sides of the limit; too few steps, and a robot that has stopped."""
    assert walk(0.5).as_commanded()
    for told, held in ((0.54, True), (0.46, True), (0.56, False), (0.44, False)):
        assert walk(0.5, told=TimedCommand(told)).as_commanded() == held
    assert not walk(0.5, told=TimedCommand(0.5, left=0.06)).as_commanded()
    for turn, held in ((0.22, True), (0.38, True), (0.2, False), (0.4, False)):  # 5 °/s: 0.087
        assert walk(0.4, 0.0, 0.3, TimedCommand(0.4, turn=turn)).as_commanded() == held
    still = recorded()
    down = still.down.copy()
    down[still.time > 18.5] = True
    assert not RecordedWalk(replace(still, down=down), (TimedCommand(0.5),)).as_commanded()
    assert not RecordedWalk(recorded(seconds=1.5), (TimedCommand(0.5),)).as_commanded()


def changed_at(time: float, ahead: float, later: float, turned: float = 0.0) -> RecordedWalk:
    """A walk that is commanded 0.5 m/s, goes at `ahead` and, from `time` on, at `later` m/s, in a
    direction turned by so many degrees."""
    record = recorded()
    yaw = record.yaw + np.where(record.time > time, np.radians(turned), 0.0)
    speed = np.where(record.time > time, later, ahead)[:, None]
    way = speed * PERIOD * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    return RecordedWalk(replace(record, yaw=yaw, com=np.cumsum(way, axis=0)), (TimedCommand(0.5),))


def test_a_walk_is_compared_with_its_own_strides_before_the_push() -> None:
    """A steady error is its own; one that grows by more than 0.05 m/s is not, one that shrinks is
    no loss. A heading is not commanded."""
    for before, later, held in (
        (0.5, 0.5, True), (0.35, 0.35, True), (0.65, 0.65, True), (0.35, 0.5, True),
        (0.35, 0.31, True), (0.35, 0.29, False), (0.5, 0.44, False), (0.35, 0.65, True),
        (0.65, 0.29, False),
    ):  # fmt: skip
        pushed = changed_at(9.0, before, later)
        own = pushed.own_error(8.0)
        assert own is not None and own.speed == pytest.approx(abs(before - 0.5), abs=1e-9)
        assert pushed.as_commanded(own) == held, (before, later)
    for degrees in (4.0, 30.0, -90.0):  # it walks on in the direction that it faces now
        pushed = changed_at(9.0, 0.5, 0.5, degrees)
        own = pushed.own_error(8.0)
        assert own is not None and pushed.as_commanded(own)


def test_own_strides_are_settled_and_follow_the_last_command() -> None:
    """None before 4 s, none of another command; the worst of them counts, a turn's error too."""
    assert walk(0.5).own_error(4.0) is None
    other = walk(0.5, told=TimedCommand(0.9))
    both = RecordedWalk(other.record, (TimedCommand(0.9), TimedCommand(0.5, start=8.0)))
    assert both.own_error(11.9) is None  # no settled stride of the last command yet
    own = both.own_error()
    assert own is not None and own.speed == pytest.approx(0.0, abs=1e-9)
    turning = walk(0.4, 0.0, 0.3, TimedCommand(0.4, turn=0.1))
    own = turning.own_error(9.0)
    assert own is not None and own.turn == pytest.approx(0.2, rel=1e-6)
    assert turning.as_commanded(own) and not turning.as_commanded()


def test_the_distance_from_a_circle() -> None:
    """Nothing on the circle; a walk with another radius is off it by the difference."""
    told = (TimedCommand(0.5, turn=0.25),)
    for speed, off in ((0.5, 0.0), (0.6, 0.4)):  # 2.4 m instead of 2 m
        found = RecordedWalk(recorded(speed, 0.0, 0.25, 40.0), told).figures()["circle_error"]
        assert found == pytest.approx(off, abs=0.03)
    crab = (TimedCommand(0.3, left=0.4, turn=0.25),)  # the same circle, not along the heading
    found = RecordedWalk(recorded(0.3, 0.4, 0.25, 40.0), crab).figures()["circle_error"]
    assert found == pytest.approx(0.0, abs=0.03)


def test_the_phase_of_a_push() -> None:
    """0 where the left foot lands, ½ where the right one does, linear in between."""
    told = walk()
    assert told.phase_at(4.0, left=1) == pytest.approx(0.0)  # the 10th touchdown
    assert told.phase_at(4.1, left=1) == pytest.approx(0.125)
    assert told.phase_at(4.1, left=0) == pytest.approx(0.625)
    assert told.phase_at(4.39, left=1) == pytest.approx(0.4875)
    assert told.phase_at(1.0, left=1) is None
    stood = told.record.down.copy()
    stood[told.record.time > 10.1] = True  # after the 25th touchdown
    late = RecordedWalk(replace(told.record, down=stood), told.commands).phase_at(18.0, left=1)
    assert late == pytest.approx(1.0) and late < 1.0  # no further than where the next foot lands


def test_who_lands_on_both_feet_at_once_has_no_phase() -> None:
    """Not one that is no number: steps of no time have no pace."""
    record = recorded()
    hops = np.repeat(record.down[:, :1], 2, axis=1)
    told = RecordedWalk(replace(record, down=hops), (TimedCommand(0.5),))
    assert len(told.landed.row) > 10
    assert told.phase_at(record.time[told.landed.row[-1]], left=1) is None
