"""The size of a push relative to a robot's ankle limit and to its baseline's J50."""

import shlex
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from poise.baselines.warmup import prepare
from poise.configs.errors import ConfigError
from poise.configs.files import packaged, resolve, write_atomic
from poise.configs.schema import build, read_yaml, to_yaml
from poise.envs.compiled.maths.pendulum import ankle_limit, duration_factor
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import LIMIT_DURATION, LimitTable
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot

BASELINE = "momentum-qp"  # whose J50 the packaged limits have


@dataclass(frozen=True)
class MeasuredLimits:
    """J50 per direction that a controller reached on a robot: a file of `configs/limits`."""

    robot: str
    fingerprint: str  # of the robot
    controller: str
    table: LimitTable


class PushLimits:
    """The ankle limit of a robot, and the measured limits of its baseline where there are any.

    Attributes:
        robot: the robot.
        table: J50 [N·s] of the baseline for 0.1 s square pushes, or None.
        controller: whose J50 the table has, or None.
        standing: the robot's state at rest.
        scale: what `fraction` is a fraction of: "baseline J50", "J50 of NAME" of another
            controller's table, or "ankle limit" without one.
    """

    def __init__(
        self, robot: Robot, table: LimitTable | None = None, controller: str | None = None
    ):
        prepare()  # several kernels at once, before this process compiles one after the other
        self.robot, self.table, self.controller = robot, table, controller
        others = controller is not None and controller != BASELINE
        known = f"J50 of {controller}" if others else "baseline J50"
        self.scale = "ankle limit" if table is None else known
        self.omega = robot.omega
        self.standing = Simulation(robot).state.copy()

    def margin(self, direction: float) -> float:
        """δ(θ) [m] of the standing posture, `direction` in degrees."""
        return self.standing.support_margin(direction)

    def around(self, spacing: float) -> np.ndarray:
        """Return directions (n,) [deg] from 0 to below 360, every `spacing` and at every corner.

        A corner is one of the standing support polygon, seen from the CoM: δ(θ) has its peaks
        there, which a line through evenly spaced directions would cut off.
        """
        rays = self.standing.support_polygon - self.standing.com[:2]
        angles = np.arctan2(rays[:, 1], rays[:, 0]) - self.standing.heading_yaw
        return np.union1d(np.arange(0.0, 360.0, spacing), np.degrees(angles) % 360.0)

    def j50(self) -> LimitTable:
        """Return the table; raise ConfigError where none was measured."""
        if self.table is None:
            raise ConfigError(f"no J50 of {self.robot.name!r} was measured", field="share",
                              choices=packaged("limits"))  # fmt: skip
        return self.table

    def ankle(self, direction: float, duration: float) -> float:
        """Return the ankle limit: the largest impulse J [N·s] of a square push."""
        return self.robot.mass * ankle_limit(self.omega, self.margin(direction), duration)

    def fraction(self, push: Push) -> float:
        """J over the limit in the push's direction, for its duration and profile."""
        if self.table is None:
            limit = self.ankle(push.direction, LIMIT_DURATION)
        else:
            limit = self.table(push.direction)
        longer = duration_factor(self.omega, push.duration, push.profile)
        return push.impulse / (limit * longer / duration_factor(self.omega, LIMIT_DURATION))


def load_limits(robot: Robot, name: str | Path | None = None) -> PushLimits:
    """Return the limits in a packaged file or a path; None: the file of the robot's name, if there
    is one.

    Raises:
        ConfigError: no such file, one that is not valid, or one measured for another robot.
    """
    if name is None:
        if robot.name not in packaged("limits"):
            return PushLimits(robot)
        name = robot.name
    path = resolve("limits", name)
    measured = build(MeasuredLimits, read_yaml(path), str(path))
    if measured.fingerprint != robot.fingerprint:
        ours = robot.name in packaged("robots") and robot.source == str(
            resolve("robots", robot.name)
        )
        typed = robot.name if ours else robot.source
        raise ConfigError(
            f"measured for another robot than {robot.name!r}: measure again with poise evaluate "
            f"momentum-qp --suite envelope --robot {shlex.quote(typed)} "
            f"--write-limits {shlex.quote(str(path))}",
            source=path,
            field="fingerprint",
        )
    return PushLimits(robot, measured.table, measured.controller)


def write_limits(path: Path, robot: Robot, controller: str, table: LimitTable) -> None:
    """Write a file that `load_limits` reads; raises PoiseError when the disk refuses."""
    measured = MeasuredLimits(robot.name, robot.fingerprint, controller, table)
    write_atomic(path, to_yaml(measured))
