"""A wrapper whose `info` is arrays throughout, for recorders that take nothing else."""

from typing import Any

import gymnasium as gym
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.physics.pushes.push import PushInfo

from .base import BalanceEnv


class PlainInfo(gym.Wrapper):
    """`info["push"]` as arrays with an entry for each push of the episode, instead of a list.

    Its keys are those of the list's mappings; `body` is MuJoCo's number of the body, `env.model`
    knows its name. ``minari.DataCollector(PlainInfo(env), record_infos=True)`` takes that.

    Raises ConfigError for an environment of another package.
    """

    def __init__(self, env: gym.Env):
        super().__init__(env)
        if not isinstance(self.unwrapped, BalanceEnv):
            raise ConfigError("is no environment of Poise", source="PlainInfo", field="env")

    def reset(self, **arguments: Any) -> tuple[Any, dict[str, Any]]:
        """As of the environment."""
        observation, info = self.env.reset(**arguments)
        return observation, self._plain(info)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """As of the environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return observation, reward, terminated, truncated, self._plain(info)

    def _plain(self, info: dict[str, Any]) -> dict[str, Any]:
        return {**info, "push": push_arrays(info["push"], self.unwrapped)}  # type: ignore[arg-type]


def push_arrays(pushes: list[PushInfo], env: BalanceEnv) -> dict[str, np.ndarray]:
    """Each entry of `PushInfo` as an array (pushes,), of bodies their numbers in `env.model`."""
    numbers = [name for name in PushInfo.__annotations__ if name != "body"]
    arrays: dict[str, np.ndarray] = {
        name: np.array([push[name] for push in pushes], dtype=float)  # type: ignore[literal-required]
        for name in numbers
    }
    return {**arrays, "body": np.array([env.model.body(push["body"]).id for push in pushes], int)}
