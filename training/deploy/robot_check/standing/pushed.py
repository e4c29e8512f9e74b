"""Pushes that the QP recovers from on any sound robot: if not, the description is why."""

from collections import Counter
from dataclasses import dataclass

from poise.configs.errors import PoiseError
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import LIMIT_DURATION, push_bodies
from poise.envs.robots.robot import Robot
from poise.training.benchmarking.diagnosis.words import cause
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Trial

from .rest import CONTROLLER

SHARE = 0.5  # of the ankle limit
DIRECTIONS = tuple(45.0 * i for i in range(8))  # [deg]
START, DURATION = 0.3, 3.0  # [s]


@dataclass(frozen=True)
class Pushed:
    """Pushes of 0.1 s at half of the ankle limit, with `CONTROLLER`, whose feet stay.

    Attributes:
        trials: directions in which it was pushed; 0 where the controller does not support it.
        falls: directions in which it fell [deg].
        cause: what most of these had in common; empty without falls.
    """

    trials: int = 0
    falls: tuple[float, ...] = ()
    cause: str = ""


def push_gently(robot: Robot) -> Pushed:
    """Push a robot in eight directions, each from the same start."""
    try:
        agent = load_agent(CONTROLLER, robot, pushes=None, duration=DURATION)
    except PoiseError:
        return Pushed()
    limits, body, falls = PushLimits(robot), push_bodies(robot)[0], []
    causes: Counter[str] = Counter()
    for k, direction in enumerate(DIRECTIONS):
        impulse = SHARE * limits.ankle(direction, LIMIT_DURATION)
        push = Push(body, START, LIMIT_DURATION, impulse, direction)
        outcome = run_trial(agent, Trial(k, 0, (push,)))
        if outcome.fallen:
            falls.append(direction)
            causes[cause(outcome, None).split(", then")[0]] += 1
    common = causes.most_common(1)
    return Pushed(len(DIRECTIONS), tuple(falls), common[0][0] if common else "")
