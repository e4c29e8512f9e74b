"""Many environments stepped by a few threads: no processes, no pickling.

Compiled steps release the GIL, so threads run in parallel. Every environment has its own data
and generator: results do not depend on the number of threads.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from .balance import BalanceEnv


class EnvBatch:
    """`len(envs)` environments of one kind, with automatic reset after an episode's end."""

    def __init__(self, envs: Sequence[BalanceEnv], threads: int = 1):
        self.envs = list(envs)
        self.threads = max(1, min(threads, len(self.envs)))
        first, n = self.envs[0], len(self.envs)
        self.observations = np.zeros((n, *first.observation_space.shape), dtype=np.float32)
        self.final_observations = np.zeros_like(self.observations)
        self.rewards = np.zeros(n)
        self.terminated = np.zeros(n, dtype=bool)
        self.truncated = np.zeros(n, dtype=bool)
        self._pool = ThreadPoolExecutor(self.threads) if self.threads > 1 else None
        self._chunks = np.array_split(np.arange(n), self.threads)

    def reset(
        self, seeds: Sequence[int | None], options: Sequence[dict[str, Any] | None] | None = None
    ) -> np.ndarray:
        """Start all episodes, each with its seed and options; returns the observations (n, no)."""
        options = [None] * len(self.envs) if options is None else options
        for i, (env, seed, option) in enumerate(zip(self.envs, seeds, options, strict=True)):
            self.observations[i] = env.reset(seed=seed, options=option)[0]
        return self.observations

    def step(
        self, actions: np.ndarray, at_end: Callable[[int, BalanceEnv], None] | None = None
    ) -> None:
        """One policy step of all; `at_end(i, env)` sees a finished episode before its reset.

        Fills `observations`, `rewards`, `terminated`, `truncated`, and `final_observations` of
        the environments whose episode ended.
        """
        if self._pool is None:
            self._step_chunk(self._chunks[0], actions)
        else:
            jobs = [self._pool.submit(self._step_chunk, c, actions) for c in self._chunks]
            for job in jobs:
                job.result()
        for i in np.flatnonzero(self.terminated | self.truncated):
            env = self.envs[i]
            self.final_observations[i] = self.observations[i]
            if at_end is not None:
                at_end(int(i), env)
            self.observations[i] = env.reset()[0]

    def _step_chunk(self, indices: np.ndarray, actions: np.ndarray) -> None:
        for i in indices:
            env = self.envs[i]
            self.rewards[i], self.terminated[i], self.truncated[i] = env.step_in_place(actions[i])
            self.observations[i] = env.episode.observation

    def close(self) -> None:
        """Close the environments and stop the threads."""
        for env in self.envs:
            env.close()
        if self._pool is not None:
            self._pool.shutdown()
