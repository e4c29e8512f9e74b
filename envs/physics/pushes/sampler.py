"""Random pushes on a seeded schedule, described by data."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.pendulum import Profile, duration_factor
from poise.envs.robots.robot import Robot

from .options import SupportMargin, check_body, to_impulse
from .push import Kick, Push

Range = tuple[float, float]
OMIT = {"omit": "default"}  # from files: fields that came later
Limits = Callable[[float], float]  # direction [deg] → J50 [N·s] of a 0.1 s square push
Unit = Literal[
    "impulse",
    "force",
    "specific_impulse",
    "specific_force",
    "ankle_fraction",
    "controller_fraction",
    "delta_v",
]
PROFILES: tuple[Profile, ...] = ("square", "half-sine")
LIMIT_DURATION = 0.1  # [s] of the pushes that a limit table was measured with
NO_LIMITS = (
    "needs the controller's J50 by direction, which controller_fraction is a fraction of: copy "
    "`table` of `poise evaluate CONTROLLER --suite envelope --write-limits FILE`"
)


def push_bodies(robot: Robot) -> tuple[str, ...]:
    """The bodies to push, by the robot's description (else its root); raises ConfigError."""
    bodies = robot.description.push_bodies
    for body in bodies:
        check_body(body, robot, f"push_bodies of {robot.name}")
    return bodies or (robot.model.body(robot.root_body_id).name,)


@dataclass(frozen=True)
class LimitTable:
    """Impulse that a controller recovers from in half of the trials, J50, per direction.

    Measured with square pushes of 0.1 s; between two directions the limit is linear, around
    the circle.

    Attributes:
        directions: Directions in which J50 is known, heading frame [deg].
        impulses: J50 in each of these directions [N·s].
    """

    directions: tuple[float, ...]
    impulses: tuple[float, ...] = field(metadata={"min": 0.0})

    def __post_init__(self):
        turns = [direction % 360.0 for direction in self.directions]
        if not turns or len(turns) != len(self.impulses):
            raise ValueError("directions and impulses must have the same length, at least 1")
        if len(set(turns)) != len(turns):
            raise ValueError("directions must differ")

    def __call__(self, direction: float) -> float:
        """J50 [N·s] in a direction [deg]."""
        return float(np.interp(direction, self.directions, self.impulses, period=360.0))


@dataclass(frozen=True)
class PushSampler:
    """The distribution of random pushes; every range [lo, hi] is drawn from uniformly.

    `magnitude` has the unit named by `unit`:
    impulse [N·s], force [N] (peak), specific_impulse [N·s/kg], specific_force [N/kg] (peak),
    delta_v [m/s] (velocity kicks), ankle_fraction (of `ankle_limit`), controller_fraction (of the
    controller's own J50, which grows with duration and profile as the ankle limit does).

    Attributes:
        magnitude: Range of the size of a push, in `unit`.
        unit: Unit of the size of a push.
        bodies: Bodies of which one is drawn for each push; none: those that the robot's description
            names.
        duration: Range of how long a push lasts [s].
        direction: Range of the horizontal direction of a push, counter-clockwise from ahead [deg].
        elevation: Range of the angle of a push above the horizontal [deg].
        offset: Half side of the cube around the body's centre in which the point of a push is drawn
            [m].
        profile: Force over time: constant (square), as half a sine, or either (any).
        start: Range of when the first push begins, after the reset [s].
        count: Range of how many pushes there are in an episode.
        interval: Range of the time from the end of a push to the start of the next one [s].
        no_push: Probability of an episode without any push.
        limit_table: J50 by direction that `controller_fraction` is measured by.
        spread: Largest angle of a push from the one direction that an episode draws for all its
            pushes; None: each push draws its own [deg].
        either_side: Draw, for an episode, whether its directions are mirrored to the other side.
        others: Further distributions: an episode has the pushes of one of them or of this one, all
            equally likely.
        kicks: Probability that a kick of the root takes the place of a push.
        kick_speed: Range of the size of such a kick [m/s].
    """

    magnitude: Range = field(metadata={"min": 0.0})
    unit: Unit
    bodies: tuple[str, ...] = ()
    duration: Range = field(default=(LIMIT_DURATION, LIMIT_DURATION), metadata={"above": 0.0})
    direction: Range = field(default=(0.0, 360.0), metadata={"min": -360.0, "max": 360.0})
    elevation: Range = field(default=(0.0, 0.0), metadata={"min": -90.0, "max": 90.0})
    offset: float = field(default=0.0, metadata={"min": 0.0})
    profile: Profile | Literal["any"] = "square"
    start: Range = field(default=(0.5, 0.5), metadata={"min": 0.0})
    count: tuple[int, int] = field(default=(1, 1), metadata={"min": 1, "max": 1000})
    interval: Range = field(default=(1.0, 1.0), metadata={"min": 0.0})
    no_push: float = field(default=0.0, metadata={"min": 0.0, "max": 1.0})
    limit_table: LimitTable | None = None
    spread: float | None = field(default=None, metadata={"min": 0.0, "max": 180.0, **OMIT})
    either_side: bool = field(default=False, metadata=OMIT)
    others: "tuple[PushSampler, ...]" = field(default=(), metadata=OMIT)
    kicks: float = field(default=0.0, metadata={"min": 0.0, "max": 1.0, "omit": "default"})
    kick_speed: Range = field(default=(0.5, 1.0), metadata={"min": 0.0, "omit": "default"})

    def __post_init__(self):
        for name in (
            "magnitude", "duration", "direction", "elevation", "start", "count", "interval",
            "kick_speed",
        ):  # fmt: skip
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name}: the range [{low}, {high}] must not decrease")

    def check_limits(self) -> None:
        """Raise ConfigError for a controller_fraction without a `limit_table`."""
        for pushes in (self, *self.others):
            if pushes.unit == "controller_fraction" and pushes.limit_table is None:
                raise ConfigError(NO_LIMITS, field="limit_table")

    def sample(
        self,
        rng: np.random.Generator,
        robot: Robot,
        margin: SupportMargin | None = None,
        limits: Limits | None = None,
    ) -> tuple[Push | Kick, ...]:
        """The pushes of one episode, in time order; the same for the same generator state.

        `margin(direction)` → δ(θ) [m] serves ankle_fraction; `limits(direction)` → J50 [N·s]
        serves controller_fraction and defaults to `limit_table`. Other magnitudes leave the
        draws of direction, body and time as they were.

        Raises ConfigError for a body that the robot lacks, or a missing margin or limit.
        """
        if self.others:
            chosen = int(rng.integers(len(self.others) + 1))
            one = replace(self, others=()) if chosen == 0 else self.others[chosen - 1]
            return one.sample(rng, robot, margin, limits)
        for body in self.bodies:
            check_body(body, robot, None, "bodies")
        quiet = rng.random() < self.no_push
        count = int(rng.integers(self.count[0], self.count[1], endpoint=True))
        pushes = []
        start = rng.uniform(*self.start)
        side = None if self.spread is None else rng.uniform(*self.direction)
        sign = rng.choice((-1.0, 1.0)) if self.either_side else 1.0
        for _ in range(count):
            push = self._draw(rng, robot, start, side, sign, margin, limits or self.limit_table)
            pushes.append(push)
            end = start if isinstance(push, Kick) else start + push.duration
            start = end + rng.uniform(*self.interval)
        return () if quiet else tuple(pushes)

    def _draw(
        self,
        rng: np.random.Generator,
        robot: Robot,
        start: float,
        side: float | None,
        sign: float,
        margin: SupportMargin | None,
        limits: Limits | None,
    ) -> Push | Kick:
        bodies = self.bodies or push_bodies(robot)
        body = bodies[int(rng.integers(len(bodies)))]
        duration = rng.uniform(*self.duration)
        if side is None or self.spread is None:
            direction = rng.uniform(*self.direction)
        else:
            direction = (side + rng.uniform(-self.spread, self.spread)) % 360.0
        direction *= sign
        elevation = rng.uniform(*self.elevation)
        x, y, z = (float(u) for u in self.offset * rng.uniform(-1.0, 1.0, 3))
        value = rng.uniform(*self.magnitude)
        profile = PROFILES[int(rng.integers(2))] if self.profile == "any" else self.profile
        if self.kicks > 0.0 and rng.random() < self.kicks:
            return Kick(start, rng.uniform(*self.kick_speed), direction)
        if self.unit == "delta_v":
            return Kick(start, value, direction)
        if self.unit == "controller_fraction":
            if limits is None:
                raise ConfigError(NO_LIMITS, field="limit_table")
            omega = robot.omega
            longer = duration_factor(omega, duration, profile)
            impulse = value * limits(direction) * longer / duration_factor(omega, LIMIT_DURATION)
        else:
            impulse = to_impulse(self.unit, value, robot, direction, duration, profile, margin)
        return Push(body, start, duration, impulse, direction, elevation, (x, y, z), profile)
