"""Sampling of trials, which depends only on the seed and the trial's number."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import ClassVar, Self, TypedDict, TypeVar, Unpack

import mujoco
import numpy as np

from poise.baselines.walking.schedule import TimedCommand
from poise.envs.balance.config import StartNoise
from poise.envs.physics.engines.config import MUJOCO
from poise.envs.physics.pushes.options import check_body
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.physics.pushes.sampler import Range, push_bodies
from poise.envs.sensing.realism import IDEAL
from poise.envs.terrain.terrain import Terrain
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Conditions, Trial

T = TypeVar("T")
MOST_TRIALS = 100_000  # all are sampled before the first one runs
Recovered = Mapping[str, Sequence[bool]]  # controller → outcome of each trial of the first stage


@dataclass(frozen=True)
class Standard:
    """The settings that the parts of a suite have in common.

    They are how long a trial lasts, how far its start is disturbed, and the standard push, a square
    one at the body's centre of mass."""

    duration: float = field(default=6.0, metadata={"above": 1.0, "max": 1e6})  # of a trial [s]
    start: float = field(default=0.5, metadata={"min": 0.0})  # of the first push [s]
    push_duration: float = field(default=0.1, metadata={"above": 0.0})  # [s]
    interval: float = field(default=1.0, metadata={"above": 0.0})  # between repeated pushes [s]
    body: str | None = None  # the robot's first push body
    # time after a fall in which the robot may get up again [s]; 0: a fall ends the trial
    get_up_time: float = field(default=0.0, metadata={"min": 0.0, "max": 1e3, "omit": "default"})
    realism: str = field(default=IDEAL, metadata={"omit": "default"})  # a level or a file of one
    physics: str = field(default=MUJOCO, metadata={"omit": "default"})  # an engine, or its file
    noise: StartNoise = field(default_factory=StartNoise)


class Marks(TypedDict, total=False):
    """Optional fields of a trial: its place in its part, its conditions, its walk."""

    stage: int
    factor: str | None
    level: str | None
    conditions: Conditions
    commands: tuple[TimedCommand, ...]
    kicks: tuple[Kick, ...]
    terrain: Terrain | None
    motion: str | None
    share: float | None
    start: int | None


class Draw:
    """Makes the trials of a suite for a robot.

    Attributes:
        standard: what the suite's parts share.
        limits: reference impulses of pushes.
        seed: of the suite.
        bodies: that are pushed; the first one by the standard push.
        motions: name → duration [s] of the motions that are performed.
    """

    def __init__(
        self,
        standard: Standard,
        limits: PushLimits,
        seed: int,
        motions: Mapping[str, float] | None = None,
    ):
        self.standard, self.limits, self.seed = standard, limits, seed
        self.motions = dict(motions or {})
        self.robot = limits.robot
        self.bodies = push_bodies(self.robot)
        if standard.body is not None:
            check_body(standard.body, self.robot, "suite")
            self.bodies = (standard.body, *(b for b in self.bodies if b != standard.body))

    def push(self, angle: float, impulse: float) -> Push:
        """Return the standard push with an impulse [N·s] towards a direction [deg]."""
        standard = self.standard
        return Push(self.bodies[0], standard.start, standard.push_duration, impulse, angle)

    def trial(self, number: int, pushes: Iterable[Push] = (), **marks: Unpack[Marks]) -> Trial:
        """Return a trial with its own seed and its first push over the limit."""
        pushes = tuple(pushes)
        fraction = self.limits.fraction(pushes[0]) if pushes else None
        seed = start_seed(self.seed, number)
        return Trial(number, seed, pushes, limit_fraction=fraction, **marks)

    def spread(
        self, number: int, ranges: Iterable[tuple[float, float, float, int]], stage: int
    ) -> list[Trial]:
        """`count` trials per (direction, low, high, count), one in each of as many equal parts."""
        trials: list[Trial] = []
        for angle, low, high, count in ranges:
            for part in range(count):
                here = number + len(trials)
                fraction = (part + generator(self.seed, here).uniform()) / count
                push = self.push(angle, low + fraction * (high - low))
                trials.append(self.trial(here, [push], stage=stage))
        return trials

    def stratified(self, number: int, count: int, fractions: Range) -> list[tuple[float, float]]:
        """(direction, fraction) with one of each in each of `count` equal parts, shuffled."""
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, number, 2]))
        angles = 360.0 * (np.arange(count) + rng.uniform(size=count)) / count
        places = (rng.permutation(count) + rng.uniform(size=count)) / count
        low, high = fractions
        return [
            (float(a), float(low + u * (high - low))) for a, u in zip(angles, places, strict=True)
        ]

    def height(self, body: str) -> float:
        """Return the height of the body's centre of mass, standing, over that of the robot's."""
        return float(self._data.xipos[self.robot.model.body(body).id, 2] / self.robot.height_com)

    def point(self, body: str, height: float) -> tuple[float, float, float]:
        """Return the point above the body's CoM at a height [of the robot's CoM], in its frame
        [m]."""
        axes = self._data.xmat[self.robot.model.body(body).id].reshape(3, 3)
        up = (height - self.height(body)) * self.robot.height_com
        x, y, z = (float(u) for u in axes.T @ [0.0, 0.0, up])
        return x, y, z

    @cached_property
    def _data(self) -> mujoco.MjData:
        """The robot, standing."""
        data = mujoco.MjData(self.robot.model)
        data.qpos[:] = self.robot.standing_qpos
        mujoco.mj_kinematics(self.robot.model, data)
        return data


@dataclass(frozen=True)
class SuitePart:
    """A part of a suite: trials of one kind. Their `part` is its name in the suite, unless set."""

    SIZE: ClassVar[str] = "trials"  # the field that says how many

    def first(self, draw: Draw, number: int) -> list[Trial]:
        """Return the trials of the first stage, numbered from `number`."""
        raise NotImplementedError

    def second_count(self, controllers: int) -> int:
        """Return the number of trials of each controller in the second stage."""
        return 0

    def second(
        self, draw: Draw, number: int, first: Sequence[Trial], recovered: Recovered
    ) -> dict[str, list[Trial]]:
        """controller → its trials of the second stage, chosen by the outcomes of the first."""
        return {}

    def resized(self, trials: int) -> Self:
        """Return the part with another number of trials (its field `SIZE`)."""
        return replace(self, **{self.SIZE: trials})

    def capped(self, trials: int) -> Self:
        """Return the part with at most as many trials in every cell."""
        return self.resized(min(getattr(self, self.SIZE), trials))


def start_seed(seed: int, number: int) -> int:
    """Return the seed of a trial's start, from those of the suite and the trial's number alone."""
    return int(np.random.SeedSequence([seed, number, 0]).generate_state(1)[0])


def generator(seed: int, number: int) -> np.random.Generator:
    """Draws the push of a trial, apart from what disturbs its start."""
    return np.random.default_rng(np.random.SeedSequence([seed, number, 1]))


def repeated(cases: Iterable[T], trials: int, number: int) -> Iterator[tuple[int, T]]:
    """Return the number of each trial, from `number` on, and its case; every case has `trials`."""
    return enumerate((case for case in cases for _ in range(trials)), number)


def check_rising(pair: Range, name: str) -> None:
    """Raise ValueError for a range that decreases."""
    if pair[0] > pair[1]:
        raise ValueError(f"{name}: the range [{pair[0]}, {pair[1]}] must not decrease")
