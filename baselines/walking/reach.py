"""Which commands are within the reach of a robot."""

from poise.baselines.motions.feet import foot_signs
from poise.baselines.stepping.config import StepLimits, SwingTask
from poise.baselines.stepping.swing_speed import highest_lift, swing_time
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .arms import ROLES, has_arms, largest_swing
from .blocks import Gait
from .command import GaitCommand

APART = 0.01  # [m] between soles side by side


def least_width(robot: Robot) -> float:
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
    h, (swing, period) = robot.height_com, steps_of(command, gait)
    far = (limits.ahead if command.ahead >= 0.0 else limits.behind) * h
    most = min(far, 0.5 * limits.speed * h * robot.omega * swing)
    if abs(command.ahead) * period > most:
        raise _out_of_reach("ahead", f"{command.ahead:g} m/s is steps of "
                            f"{abs(command.ahead) * period:.3g} m in {period:.3g} s", robot,
                            f"at most {most:.3g} m in it, {most / period:.3g} m/s")  # fmt: skip
    if command.step_length is not None:
        least = command.speed * (gait.time_min + gait.transfer_time)
        if command.step_length < least - 1e-9:
            raise _out_of_reach("step_length", f"{command.step_length:g} m at {command.speed:g} "
                                "m/s", robot, f"at least {least:.3g} m there: its legs "
                                f"need {gait.time_min:.3g} s for a step")  # fmt: skip


def _check_width(command: GaitCommand, robot: Robot, limits: StepLimits) -> None:
    low, high = least_width(robot), limits.width_max * robot.height_com
    if command.width is not None and not low <= command.width <= high:
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
                            f"that in {needed:.3g} s, see step_time")  # fmt: skip


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
    return ConfigError(f"{what} is out of reach: {robot.name!r} can {limits}",
                       field=f"command.{name}")  # fmt: skip
