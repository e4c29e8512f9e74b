"""Parts in which conditions differ from the standard case: in one factor, or in all at once."""

from dataclasses import dataclass, field, replace

import numpy as np

from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import Range
from poise.envs.robots.ground import contact_friction
from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.trials.trial import STANDARD_CONDITIONS, Conditions, Trial

from .draw import MOST_TRIALS, Draw, SuitePart, check_rising, generator, start_seed

STANDARD = "standard"  # factor and level of the case that levels are compared with


@dataclass(frozen=True)
class Levels:
    """Levels of every factor in addition to that of the standard case; none: it is not varied."""

    duration: tuple[float, ...] = field(default=(), metadata={"above": 0.0})  # [s]
    body: bool = False  # every body that the robot's description names
    height: tuple[float, ...] = field(default=(), metadata={"above": 0.0})  # of the CoM's height
    friction: tuple[float, ...] = field(default=(), metadata={"above": 0.0})
    delay: tuple[float, ...] = field(default=(), metadata={"min": 0.0, "max": 0.1})  # [s]
    mass_error: tuple[float, ...] = field(default=(), metadata={"above": -1.0, "max": 1.0})
    velocity_noise: tuple[float, ...] = field(default=(), metadata={"min": 0.0})  # [rad/s]
    realism: tuple[str, ...] = ()  # names or files of levels
    pushes: tuple[int, ...] = field(default=(), metadata={"min": 2, "max": 1000})


@dataclass(frozen=True)
class FactorLevel:
    """A level of a factor, and what a trial has there. None: as in the standard case."""

    factor: str
    level: str
    duration: float | None = None
    body: str | None = None
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    conditions: Conditions = STANDARD_CONDITIONS
    count: int = 1

    def push(self, draw: Draw, angle: float, fraction: float) -> Push:
        """Return a push of a fraction of the ankle limit for its duration."""
        duration = draw.standard.push_duration if self.duration is None else self.duration
        push = draw.push(angle, fraction * draw.limits.ankle(angle, duration))
        body = self.body or push.body
        return replace(push, duration=duration, body=body, point=self.point)


@dataclass(frozen=True)
class Factors(SuitePart):
    """One factor at a time; all levels share starts, directions and fractions."""

    trials: int = field(default=12, metadata={"min": 1, "max": MOST_TRIALS})  # per level
    fractions: Range = field(default=(0.4, 1.0), metadata={"above": 0.0})  # of the ankle limit
    levels: Levels = field(default_factory=Levels)

    def __post_init__(self) -> None:
        check_rising(self.fractions, "fractions")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        """Return the trials by cell, the standard case first; all cells share random numbers."""
        drawn = draw.stratified(number, self.trials, self.fractions)
        trials: list[Trial] = []
        for cell in self._cells(draw):
            for k, (angle, fraction) in enumerate(drawn):
                pushes = repeats_of(cell.push(draw, angle, fraction), cell.count, draw)
                trial = draw.trial(
                    number + len(trials), pushes, factor=cell.factor, level=cell.level,
                    conditions=cell.conditions,
                )  # fmt: skip
                trials.append(replace(trial, seed=start_seed(draw.seed, number + k)))
        return trials

    def _cells(self, draw: Draw) -> list[FactorLevel]:
        levels, first, standard = self.levels, draw.bodies[0], standard_levels(draw)
        cells = [FactorLevel("duration", f"{d:g}", duration=d) for d in levels.duration]
        cells += [
            FactorLevel("body", body, body=body) for body in (draw.bodies if levels.body else ())
        ]
        cells += [
            FactorLevel("height", f"{h:.2f}", point=draw.point(first, h)) for h in levels.height
        ]
        for name in ("friction", "delay", "mass_error", "velocity_noise"):
            cells += [FactorLevel(name, f"{value:g}", conditions=Conditions(**{name: value}))
                      for value in getattr(levels, name)]  # fmt: skip
        cells += [
            FactorLevel("realism", r, conditions=Conditions(realism=r)) for r in levels.realism
        ]
        cells += [FactorLevel("pushes", f"{n:g}", count=n) for n in levels.pushes]
        others = [cell for cell in cells if standard[cell.factor] != cell.level]
        return [FactorLevel(STANDARD, STANDARD), *others]


@dataclass(frozen=True)
class Mix(SuitePart):
    """All factors sampled at once, durations evenly on a logarithmic scale."""

    trials: int = field(default=160, metadata={"min": 1, "max": MOST_TRIALS})
    fractions: Range = field(default=(0.3, 1.1), metadata={"above": 0.0})
    duration: Range = field(default=(0.05, 0.5), metadata={"above": 0.0})  # [s]
    height: Range = field(default=(1.0, 1.8), metadata={"above": 0.0})  # where the trunk is pushed
    friction: Range = field(default=(0.4, 1.0), metadata={"above": 0.0})
    delay: tuple[float, ...] = field(default=(0.0,), metadata={"min": 0.0, "max": 0.1})
    mass_error: Range = field(default=(-0.1, 0.1), metadata={"above": -1.0, "max": 1.0})
    repeated: float = field(default=0.25, metadata={"min": 0.0, "max": 1.0})  # are pushed twice

    def __post_init__(self) -> None:
        for name in ("fractions", "duration", "height", "friction", "mass_error"):
            check_rising(getattr(self, name), name)
        if not self.delay:
            raise ValueError("delay: must not be empty")

    def first(self, draw: Draw, number: int) -> list[Trial]:
        drawn = draw.stratified(number, self.trials, self.fractions)
        return [self._trial(draw, number + k, *where) for k, where in enumerate(drawn)]

    def _trial(self, draw: Draw, number: int, angle: float, fraction: float) -> Trial:
        """Return a random trial; the order of the draws is part of the suite."""
        rng = generator(draw.seed, number)
        duration = float(np.exp(rng.uniform(*np.log(self.duration))))
        body = draw.bodies[int(rng.integers(len(draw.bodies)))]
        height = rng.uniform(*self.height)
        trunk = body == draw.bodies[0]
        push = Push(
            body, draw.standard.start, duration, fraction * draw.limits.ankle(angle, duration),
            angle, point=draw.point(body, height) if trunk else (0.0, 0.0, 0.0),
        )  # fmt: skip
        conditions = Conditions(
            friction=float(rng.uniform(*self.friction)),
            delay=self.delay[int(rng.integers(len(self.delay)))],
            mass_error=float(rng.uniform(*self.mass_error)),
        )
        count = 2 if rng.uniform() < self.repeated else 1
        return draw.trial(number, repeats_of(push, count, draw), conditions=conditions)


def repeats_of(push: Push, count: int, draw: Draw) -> list[Push]:
    """Return the same push `count` times, the suite's interval from start to start."""
    interval = draw.standard.interval
    return [replace(push, start=push.start + k * interval) for k in range(count)]


def standard_levels(draw: Draw) -> dict[str, str]:
    """factor → its level in the standard case, as text."""
    robot, first = draw.robot, draw.bodies[0]
    soles = [geom for sole in robot.soles for geom in sole.geom_ids]
    return {
        "duration": f"{draw.standard.push_duration:g}",
        "body": first,
        "height": f"{draw.height(first):.2f}",
        "friction": f"{contact_friction(robot.model, robot.ground_geom_id, soles):g}",
        "delay": "0",
        "mass_error": "0",
        "velocity_noise": "0",
        "realism": IDEAL,
        "pushes": "1",
    }
