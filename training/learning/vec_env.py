"""Stable-Baselines3's vector environment over threads instead of processes."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices

from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.vector.batch import EnvBatch
from poise.envs.compiled.copies import Copyable


class ThreadedVecEnv(Copyable, VecEnv):
    """An `EnvBatch` as SB3 sees it; the same bits for any number of threads.

    At an episode's end `infos[i]` holds "episode" (return r, length l), "is_success",
    "terminal_observation" and "TimeLimit.truncated", as SB3 expects; else it is empty.
    """

    def __init__(self, envs: Sequence[BalanceEnv], threads: int = 1):
        self.batch = EnvBatch(envs, threads)
        first = self.batch.envs[0]
        self.render_mode = first.render_mode
        super().__init__(len(envs), first.observation_space, first.action_space)
        self._returns = np.zeros(len(envs))
        self._actions: np.ndarray | None = None
        self.reward_terms = self.batch.episodes[
            "reward_terms"
        ].copy()  #: (n, terms) of the last step

    def reset(self) -> np.ndarray:
        """Start all episodes, with what was last given to `seed` and `set_options`."""
        self._returns[:] = 0.0
        observations = self.batch.reset(self._seeds, self._options)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Remember the actions (n, na)."""
        self._actions = actions

    def step_wait(self):
        """Step all environments."""
        infos: list[dict[str, object]] = [{} for _ in range(self.num_envs)]
        last: dict[int, np.ndarray] = {}  # of episodes that end: the next one clears the record

        def at_end(i: int, env: BalanceEnv) -> None:
            last[i] = env.episode.reward_terms.copy()
            infos[i] = {
                "episode": {
                    "r": float(self._returns[i] + batch.rewards[i]),
                    "l": env.steps,
                    "t": 0.0,
                },
                "is_success": env.recovered and not env.fallen,
                "terminal_observation": batch.observations[i].copy(),
                "TimeLimit.truncated": bool(batch.truncated[i]),
            }

        batch = self.batch
        assert self._actions is not None  # step_async came first
        batch.step(self._actions, at_end)
        self.reward_terms = batch.episodes["reward_terms"].copy()
        for i, terms in last.items():
            self.reward_terms[i] = terms
        dones = batch.ended
        self._returns += batch.rewards
        self._returns[dones] = 0.0
        return batch.observations, batch.rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Stop the threads."""
        self.batch.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each environment."""
        return [getattr(self.batch.envs[i], attr_name) for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of each environment."""
        for i in self._get_indices(indices):
            setattr(self.batch.envs[i], attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method of each environment."""
        envs = [self.batch.envs[i] for i in self._get_indices(indices)]
        return [getattr(env, method_name)(*args, **kwargs) for env in envs]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return False for each: the environments are not wrapped."""
        return [False for _ in self._get_indices(indices)]
