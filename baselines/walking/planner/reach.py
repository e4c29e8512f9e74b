"""Which commands are within the reach of a robot."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from poise.baselines.balance.references.legs import foot_signs
from poise.baselines.balance.stepping.planning.config import StepLimits, SwingTask
from poise.baselines.balance.stepping.planning.swing_speed import highest, highest_lift, swing_time
from poise.configs.errors import ConfigError
from poise.envs.physics.legs import turn_range
from poise.envs.robots.robot import Robot

from .arms import ROLES, has_arms, largest_swing
from .blocks import Gait
from .command import GaitCommand

APART = 0.01  # [m] between soles side by side
ROUNDING = 1e-9  # [m] of a width that a user reads and gives back

Pair = tuple[float, float]  # least and most
#: pairs of a `Reach`
COMMANDED = ("ahead", "left", "turn", "width", "clearance", "step_length", "arm_swing")


@dataclass(frozen=True)
class Reach:
    """Ranges of a gait's commands on a robot, each for itself: pairs of the least and the most.

    Attributes:
        ahead, left: in steps of the gait's own time and width [m/s].
        turn: in place [rad/s].
        width, step_length: see `GaitCommand` [m].
        clearance: in the longest swing that the planner takes [m].
        arm_swing: [rad]; 0 at most for a robot that does not say which joints swing its arms.
        own_width, own_clearance: where none is commanded [m].
        step_time, period: from lift-off to touchdown, and from one touchdown to the next, where no
            time or length is commanded [s].
    """

    ahead: Pair
    left: Pair
    turn: Pair
    width: Pair
    clearance: Pair
    step_length: Pair
    arm_swing: Pair
    own_width: float
    own_clearance: float
    step_time: float
    period: float


def reach_of(robot: Robot, gait: Gait, limits: StepLimits, swing: SwingTask) -> Reach:
    """The reach of a robot with a gait; arguments as of `check_command`."""
    time, period = steps_of(GaitCommand(), gait)
    back, far = (_longest_step(sign, time, robot, limits) for sign in (-1.0, 1.0))
    aside = _widest_step(gait.width, time, robot, limits) / period
    return Reach(
        ahead=(-back / period, far / period),
        left=(-aside, aside),
        turn=_turn_range(0.0, gait.width, time, gait.transfer_time, robot, limits),
        width=_width_range(robot, limits),
        clearance=(0.0, _highest_clearance(robot, swing, limits.time_max / robot.omega)),
        step_length=(0.0, limits.ahead * robot.height_com),
        arm_swing=(0.0, largest_swing(robot) if has_arms(robot) else 0.0),
        own_width=gait.width,
        own_clearance=swing.clearance * robot.height_com,
        step_time=time,
        period=period,
    )


def touching_width(robot: Robot) -> float:
    """The distance of the soles' middles across the heading with 1 cm between the soles [m]."""
    feet = zip(robot.soles, foot_signs(robot), strict=True)
    return float(sum((-sign * sole.polygon[:, 1]).max() for sole, sign in feet)) + APART


def check_command(
    command: GaitCommand, robot: Robot, gait: Gait, limits: StepLimits, swing: SwingTask
) -> None:
    """Raise ConfigError with the limits of `robot` for a command out of its reach.

    `gait` and `limits` are those of its steps, lengths of `limits` in h.
    """
    _check_steps(command, robot, gait, limits)
    _check_turn(command, robot, gait, limits)
    _check_width(command, robot, limits)
    _check_clearance(command, robot, gait, limits, swing)
    _check_arms(command, robot)


def steps_of(command: GaitCommand, gait: Gait) -> tuple[float, float]:
    """T and T + T_d [s] of the steps that are commanded."""
    wanted = command.step_time or gait.step_time
    if command.step_length is not None:
        wanted = command.step_length / command.speed - gait.transfer_time
    wanted = max(wanted, gait.time_min)
    return wanted, wanted + gait.transfer_time


def _check_steps(command: GaitCommand, robot: Robot, gait: Gait, limits: StepLimits) -> None:
    """Steps are no longer than the planner lets them be, and no quicker than a foot may be."""
    swing, period = steps_of(command, gait)
    most = _longest_step(command.ahead, swing, robot, limits)
    if abs(command.ahead) * period > most:
        raise _out_of_reach("ahead", f"{command.ahead:g} m/s, steps of "
                            f"{abs(command.ahead) * period:.3g} m in {period:.3g} s,", robot,
                            f"at most {most:.3g} m in it, {most / period:.3g} m/s")  # fmt: skip
    aside = _widest_step(command.width or gait.width, swing, robot, limits)
    if abs(command.left) * period > aside:
        raise _out_of_reach("left", f"{command.left:g} m/s, {abs(command.left) * period:.3g} m "
                            f"to the side in a step of {period:.3g} s,", robot,
                            f"at most {aside:.3g} m in it, {aside / period:.3g} m/s")  # fmt: skip
    if command.step_length is not None:
        least = command.speed * (gait.time_min + gait.transfer_time)
        if command.step_length < least - ROUNDING:
            raise _out_of_reach("step_length", f"{command.step_length:g} m at {command.speed:g} "
                                "m/s", robot, f"at least {least:.3g} m there: its legs "
                                f"need {gait.time_min:.3g} s for a step")  # fmt: skip


def shared_reach(reaches: Sequence[Reach | None]) -> Reach | None:
    """What all of them reach, with the steps of the first; None where one is None or none is."""
    known = [each for each in reaches if each is not None]
    if not known or len(known) < len(reaches):
        return None
    pairs: dict[str, list[Pair]] = {
        name: [getattr(each, name) for each in known] for name in COMMANDED
    }
    shared: dict[str, Any] = {
        name: (max(low for low, _ in each), min(high for _, high in each))
        for name, each in pairs.items()
    }
    return replace(known[0], **shared)


def _longest_step(ahead: float, swing: float, robot: Robot, limits: StepLimits) -> float:
    """The longest step [m] with the sign of `ahead` and a swing of so many seconds."""
    h = robot.height_com
    far = (limits.ahead if ahead >= 0.0 else limits.behind) * h
    return min(far, 0.5 * limits.speed * h * robot.omega * swing)


def _widest_step(width: float, swing: float, robot: Robot, limits: StepLimits) -> float:
    """The longest way of the CoM to the side in a step with a swing of so many seconds [m].

    For soles that are W apart in the mean, a way s to the side is W + s between them after one step
    and W − s after the next, so that a foot swings by 2 s.
    """
    h = robot.height_com
    far = limits.width_max * h - width
    return max(min(far, 0.5 * limits.side_speed * h * robot.omega * swing), 0.0)


def _turn_range(
    ahead: float, width: float, swing: float, transfer: float, robot: Robot, limits: StepLimits
) -> Pair:
    """The fastest turns to the right and to the left at a speed `ahead` [m/s], both in [rad/s].

    A foot stands for T + 2 T_d, in which the trunk turns over it by what its hip lets it. In a step
    of T + T_d the foot on the outside of the turn goes W/2 times the turn farther than the CoM.
    """
    period, stands = swing + transfer, swing + 2.0 * transfer
    right, left = turn_range(robot)  # of the foot that stands: the trunk's turn is the other way
    outside = _longest_step(ahead, swing, robot, limits) - abs(ahead) * period
    farthest = max(2.0 * outside / (width * period), 0.0)
    return max(-left / stands, -farthest), min(-right / stands, farthest)


def _width_range(robot: Robot, limits: StepLimits) -> Pair:
    return touching_width(robot), limits.width_max * robot.height_com


def _highest_clearance(robot: Robot, swing: SwingTask, time: float) -> float:
    """The highest clearance of a swing of `time` [s], to 1 mm and not above what it can [m]."""

    def possible(height: float) -> bool:
        return swing_time(robot, swing, height) <= time

    most = highest_lift(robot)
    return most if possible(most) else highest(possible, most)


def _check_turn(command: GaitCommand, robot: Robot, gait: Gait, limits: StepLimits) -> None:
    """No faster than hips turn while a foot stands, and than its outer foot steps."""
    swing, period = steps_of(command, gait)
    width = command.width or gait.width
    low, high = _turn_range(command.ahead, width, swing, gait.transfer_time, robot, limits)
    if not low - ROUNDING <= command.turn <= high + ROUNDING:
        raise _out_of_reach("turn", f"{command.turn:.3g} rad/s in steps of {period:.3g} s", robot,
                            f"{low:.3g} to {high:.3g} rad/s there ({np.degrees(low):.3g} to "
                            f"{np.degrees(high):.3g} °/s), where its hips and its outer foot "
                            "reach")  # fmt: skip


def _check_width(command: GaitCommand, robot: Robot, limits: StepLimits) -> None:
    low, high = _width_range(robot, limits)
    if command.width is not None and not low - ROUNDING <= command.width <= high + ROUNDING:
        raise _out_of_reach("width", f"{command.width:g} m", robot,
                            f"{low:.3g} to {high:.3g} m, where soles do not overlap and legs "
                            "reach")  # fmt: skip


def _check_clearance(
    command: GaitCommand, robot: Robot, gait: Gait, limits: StepLimits, swing: SwingTask
) -> None:
    if command.clearance is None:
        return
    high = highest_lift(robot)
    if command.clearance > high:
        raise _out_of_reach("clearance", f"{command.clearance:g} m", robot,
                            f"at most {high:.3g} m, where its legs' joints end")  # fmt: skip
    time, _ = steps_of(command, gait)
    needed = swing_time(robot, swing, command.clearance)
    if needed > time:
        raise _out_of_reach("clearance", f"{command.clearance:g} m in {time:.3g} s", robot,
                            f"it in {needed:.3g} s or more, see step_time")  # fmt: skip


def _check_arms(command: GaitCommand, robot: Robot) -> None:
    if not command.arm_swing:
        return
    if not has_arms(robot):
        raise ConfigError(f"robot {robot.name!r} lacks the roles {' and '.join(ROLES)}, which say "
                          "what joints swing its arms", field="command.arm_swing")  # fmt: skip
    most = largest_swing(robot)
    if command.arm_swing > most:
        raise _out_of_reach("arm_swing", f"{command.arm_swing:g} rad", robot,
                            f"at most {most:.3g} rad, where its joints end")  # fmt: skip


def _out_of_reach(name: str, what: str, robot: Robot, limits: str) -> ConfigError:
    return ConfigError(f"{what} is out of range: {robot.name!r} supports {limits}",
                       field=f"command.{name}")  # fmt: skip
