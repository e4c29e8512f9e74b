"""Environments that the cases of a process share."""

from __future__ import annotations

from functools import cache

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.environments.velocity import VelocityEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.balance.vector.vector_env import BalanceVectorEnv
from tests.support.shared import robot

CLASSES: dict[str, type[BalanceEnv]] = {
    "torque": TorqueBalanceEnv,
    "position": PositionBalanceEnv,
    "residual": ResidualBalanceEnv,
    "step": ResidualStepEnv,
    "whole": ResidualWholeEnv,
    "velocity": VelocityEnv,
}


@cache
def world(name: str) -> BalanceEnv:
    """An environment of each class."""
    return CLASSES[name](robot())


@cache
def worlds() -> BalanceVectorEnv:
    """Two of them at once."""
    return BalanceVectorEnv([TorqueBalanceEnv(robot()) for _ in range(2)])


def warm_up() -> None:
    """Load and compile what a first step of each would."""
    for name in CLASSES:
        play_on(world(name), world(name).reset(seed=0)[0], 1)
    worlds().reset(seed=0)
    worlds().step(np.zeros(worlds().action_space.shape))


def play_on(env: BalanceEnv, observation: np.ndarray, steps: int = 2) -> None:
    """A few policy steps from here; raises AssertionError for an observation that is none."""
    for _ in range(steps):
        assert observation in env.observation_space, "an observation outside its space"
        if env.episode.running:
            observation = env.step(np.zeros(len(env.action_names)))[0]
