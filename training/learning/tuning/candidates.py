"""Scores of the candidates of `poise tune`: outcomes of pushes and walks around the limit."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config
from poise.baselines.walking.schedule import TimedCommand
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.trials.agents import Agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.trial import Outcome, Trial

from .tasks import TuneConfig, TuningWalks

if TYPE_CHECKING:  # it loads torch
    from poise.training.learning.policy import Policy

SLACK = 0.2  # relative error of a walk's speed at which its worth is least
UNQUIET, FALLEN = 0.6, 0.3  # largest score of a trial that is upright but not quiet, or fell


@dataclass(frozen=True)
class Candidate:
    """A controller, and the trials by which it is judged alone and under a policy."""

    number: int
    config: TuneConfig
    controller: Mapping[str, object]  # its configuration
    alone: tuple[Trial, ...]
    below: tuple[Trial, ...] = ()  # met by the policy on top of the controller


def worth_of_trials(candidate: Candidate) -> tuple[list[float], list[float]]:
    """`worth` of each trial, alone and under the policy."""
    config = candidate.config
    robot = _robot(config.robot)
    settings: dict[str, Any] = {
        "controller": controller_config(candidate.controller),
        "duration": config.tasks.seconds, "pushes": None,
        "realism": load_realism(config.realism),
    }  # fmt: skip

    def worths(agent: Agent, trials: Iterable[Trial]) -> list[float]:
        return [worth(agent, each, config.in_place, config.chatter) for each in trials]

    alone, below = [], []
    if candidate.alone:
        env = ResidualBalanceEnv(robot, **settings)
        action = np.zeros(len(env.action_names))
        agent = Agent("alone", env, lambda observation: action, "")
        alone = worths(agent, candidate.alone)
    if config.policy is not None and candidate.below:
        policy = _policy(config.policy, config.robot)
        agent = Agent("policy", policy.make_env(robot=robot, **settings), policy.act, "")
        below = worths(agent, candidate.below)
    return alone, below


def check_tuning_commands(controller: str, robot: Robot, walks: TuningWalks) -> None:
    """Raise ConfigError for a controller that does not walk, or that rejects the first commands."""
    env = ResidualBalanceEnv(robot, controller=controller_config(controller), pushes=None)
    for trial in walks.draw(0, robot, walks.first(robot)):
        env.reset(seed=trial.seed, options=trial.options)


def worth(agent: Agent, trial: Trial, in_place: bool, chatter: float = 0.0) -> float:
    """1 for a recovery, 0.6 for one that does not come to rest, at most 0.3 for a fall, by the time
    until then; less `chatter` times |Δτ|/τ_max a tick, see `TuneConfig`.

    A walk counts as `_as_commanded`, and 0 if the candidate's gains put the command out of range.
    With `in_place` a foot that moved (`Outcome.foot_displaced`) is no recovery.
    """
    try:
        outcome, env = run_trial(agent, trial), agent.env
    except ConfigError:
        if trial.commands:
            return 0.0
        raise
    period = env.controller.period if isinstance(env, ResidualBalanceEnv) else env.arrays.timestep
    price = chatter * period * (outcome.torque_variation or 0.0)
    if outcome.fallen:
        return FALLEN * env.steps / env.max_steps - price
    if trial.command is not None:
        return _as_commanded(trial.command, outcome) - price
    moved = in_place and outcome.foot_displaced
    return (1.0 if outcome.recovered and not moved else UNQUIET) - price


def _as_commanded(command: TimedCommand, outcome: Outcome) -> float:
    """Return 1 for a walk at the commanded speed and turn rate, 0.6 for an error ≥ 20 %.

    Speeds are means over strides, along the path: in a curve the feet do not point along it.
    """
    commanded = np.hypot(command.ahead, command.left)
    if outcome.speed_ahead is None or outcome.speed_left is None or outcome.turn_rate is None:
        return UNQUIET  # it has taken no strides
    speed = np.hypot(outcome.speed_ahead, outcome.speed_left)
    off = max(abs(speed / commanded - 1.0) if commanded else 0.0,
              abs(outcome.turn_rate / command.turn - 1.0) if command.turn else 0.0)  # fmt: skip
    return float(UNQUIET + (1.0 - UNQUIET) * max(1.0 - off / SLACK, 0.0))


def follow_limits(limits: np.ndarray, values: np.ndarray, speed: float = 0.1) -> np.ndarray:
    """Return limits (directions,) [N·s] nearer to where half of the pushes are recovered.

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
