"""A candidate of `poise tune` is judged here, by how pushes around the limit end."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.sensing.realism import IDEAL, load_realism
from poise.training.benchmarking.trials.agents import Agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.trial import Trial

if TYPE_CHECKING:  # it loads torch
    from poise.training.learning.policy import Policy

START = 0.5  # [s] of a push
UNQUIET, FALLEN = 0.6, 0.3  # what a trial counts at most that is up but not quiet, or fell


@dataclass(frozen=True)
class TuningPushes:
    """Pushes of a generation: `levels` times the limit found so far, in each of `directions`.

    Directions [°] are those of the environment's pushes, ± up to `jitter`; one that is named twice
    counts twice. The limit of a direction starts at `impulse` [N·s/kg] and follows the candidates:
    it rises while they recover more than half of its pushes, and falls else.
    """

    directions: tuple[float, ...] = tuple(22.5 * k for k in range(16))
    jitter: float = field(default=11.25, metadata={"min": 0.0, "max": 180.0})
    levels: tuple[float, ...] = (0.95, 1.05)
    impulse: float = field(default=0.4, metadata={"above": 0.0})
    duration: float = field(default=0.1, metadata={"above": 0.0})
    seconds: float = field(default=5.0, metadata={"above": START})

    def __post_init__(self) -> None:
        if not self.directions:
            raise ValueError("directions: must be one or more")
        if not self.levels or min(self.levels) <= 0.0:
            raise ValueError("levels: must be one or more fractions above 0")

    def draw(self, seed: int, robot: Robot, limits: np.ndarray) -> list[Trial]:
        """Trials, direction by direction; directions are jittered, so that all angles occur.

        `limits` [N·s] has one for each.
        """
        rng = np.random.default_rng(seed)
        body = push_bodies(robot)[0]
        trials: list[Trial] = []
        for direction, limit in zip(self.directions, limits, strict=True):
            for level in self.levels:
                angle = (direction + self.jitter * rng.uniform(-1.0, 1.0)) % 360.0
                push = Push(body, START, self.duration, float(level * limit), float(angle))
                number = len(trials)
                trials.append(Trial(number, seed + number, (push,), limit_fraction=level))
        return trials


@dataclass(frozen=True)
class Candidate:
    """A controller, and the trials by which it is judged alone and under a policy."""

    number: int
    robot: str
    controller: Mapping[str, object]  # its configuration
    seconds: float
    in_place: bool
    alone: tuple[Trial, ...]
    policy: str | None = None
    below: tuple[Trial, ...] = ()  # met by the policy on top of the controller
    realism: str = IDEAL
    chatter: float = 0.0  # the price of torques that jump, see `TuneConfig`


def play(candidate: Candidate) -> tuple[list[float], list[float]]:
    """`worth` of each trial, alone and under the policy."""
    robot = _robot(candidate.robot)
    settings: dict[str, Any] = {
        "controller": controller_config(candidate.controller),
        "duration": candidate.seconds, "pushes": None,
        "realism": load_realism(candidate.realism),
    }  # fmt: skip
    alone, below = [], []
    if candidate.alone:
        env = ResidualBalanceEnv(robot, **settings)
        action = np.zeros(len(env.action_names))
        agent = Agent("alone", env, lambda observation: action, "")
        alone = [
            worth(agent, trial, candidate.in_place, candidate.chatter) for trial in candidate.alone
        ]
    if candidate.policy is not None and candidate.below:
        policy = _policy(candidate.policy, candidate.robot)
        agent = Agent("policy", policy.make_env(robot=robot, **settings), policy.act, "")
        below = [
            worth(agent, trial, candidate.in_place, candidate.chatter) for trial in candidate.below
        ]
    return alone, below


def worth(agent: Agent, trial: Trial, in_place: bool, chatter: float = 0.0) -> float:
    """1 for a recovery, 0.6 for one that does not come to rest, at most 0.3 for a fall, by the time
    until then; less `chatter` times |Δτ|/τ_max a tick, see `TuneConfig`.

    With `in_place` one whose foot moved (`Outcome.foot_displaced`) is no recovery.
    """
    outcome, env = run_trial(agent, trial), agent.env
    period = env.controller.period if isinstance(env, ResidualBalanceEnv) else env.arrays.timestep
    price = chatter * period * (outcome.torque_variation or 0.0)
    if outcome.fallen:
        return FALLEN * env.steps / env.max_steps - price
    moved = in_place and outcome.foot_displaced
    return (1.0 if outcome.recovered and not moved else UNQUIET) - price


def follow(limits: np.ndarray, values: np.ndarray, speed: float = 0.1) -> np.ndarray:
    """Limits (directions,) [N·s] nearer to where half of the pushes are recovered.

    `values` (candidates, directions, levels) is `worth`.
    """
    recovered = (values > UNQUIET).mean(axis=(0, 2))
    return limits * np.exp(speed * (recovered - 0.5))


@lru_cache(maxsize=1)
def _robot(name: str) -> Robot:
    return load_robot(name)


@lru_cache(maxsize=1)
def _policy(name: str, robot: str) -> "Policy":
    from poise.training.learning.policy import load_policy  # loads torch

    return load_policy(name, _robot(robot))
