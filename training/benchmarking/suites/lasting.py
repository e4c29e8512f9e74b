"""Parts of sustained pushes, and of gusts: several short pushes from one side.

Parts with a `command` need controllers that walk, for example in side wind.
"""

from dataclasses import dataclass, field, replace

from poise.baselines.walking.planner.command import GaitCommand
from poise.envs.physics.arms import find_arms
from poise.envs.physics.pushes.sampler import PushSampler
from poise.training.benchmarking.trials.trial import Trial

from .draw import MOST_TRIALS, Draw, SuitePart, generator
from .random import PushSequence, check_forces, sampled
from .walking import commanded

PROFILE_NAMES = {"square": "step", "half-sine": "half-sine"}


@dataclass(frozen=True)
class Sustained(SuitePart):
    """One push of seconds per trial: a step of force, or half a sine.

    Without `bodies` in `pushes`, the first two push bodies of the robot's description are pushed,
    torso and pelvis, and with `hands` the hands of a robot whose description says where its
    shoulders are. `level` is the profile.
    """

    trials: int = field(default=120, metadata={"min": 1, "max": MOST_TRIALS})
    pushes: PushSampler = field(
        default_factory=lambda: PushSampler(
            magnitude=(0.6, 1.5), unit="specific_force", duration=(0.8, 4.0), profile="any"
        )
    )
    hands: bool = True
    command: GaitCommand | None = field(default=None, metadata={"omit": "default"})

    def __post_init__(self) -> None:
        if self.pushes.count != (1, 1):
            raise ValueError("pushes: a trial has exactly one push, and it is a force")
        check_forces(self.pushes)

    def first(self, draw: Draw, number: int) -> list[Trial]:
        bodies = self.bodies(draw)
        walk = {} if self.command is None else commanded(self.command)
        trials = []
        for here in range(number, number + self.trials):
            pushes = sampled(self.pushes, bodies, draw, generator(draw.seed, here))
            marks = {**walk, "level": PROFILE_NAMES[pushes[0].profile]}
            trials.append(replace(draw.trial(here, pushes), limit_fraction=None, **marks))
        return trials

    def bodies(self, draw: Draw) -> tuple[str, ...]:
        """Return the bodies from which each push samples one."""
        arms = find_arms(draw.robot) if self.hands else ()
        return (*draw.bodies[:2], *(draw.robot.model.body(arm.hand).name for arm in arms))


@dataclass(frozen=True)
class Gusts(PushSequence):
    """A sequence of short pushes within `pushes.spread` of a random side of the trial.

    See `Sequence` for the units of pushes.
    """

    trials: int = field(default=60, metadata={"min": 1, "max": MOST_TRIALS})
    pushes: PushSampler = field(
        default_factory=lambda: PushSampler(
            magnitude=(0.75, 1.3), unit="controller_fraction", count=(8, 8), interval=(3.4, 3.4),
            spread=20.0,
        )
    )  # fmt: skip
    command: GaitCommand | None = field(default=None, metadata={"omit": "default"})

    def first(self, draw: Draw, number: int) -> list[Trial]:
        walk = {} if self.command is None else commanded(self.command)
        return [replace(trial, **walk) for trial in super().first(draw, number)]
