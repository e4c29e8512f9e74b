"""The `info` of many environments at once: an array for each key."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.reward import REWARD_TERMS
from poise.envs.compiled.copies import Copyable


class InfoColumns(Copyable):
    """The entries of `BalanceEnv.info` of many `envs`, one array for each key.

    `record` holds their rows. The lists of pushes are the same ones until the next episode.
    """

    def __init__(self, envs: Sequence[BalanceEnv], record: dict[str, Any]):
        self.envs, self.record = envs, record
        self._quiet_steps = np.array([env.quiet_steps for env in envs])
        self._pushes: list[object] = [None] * len(envs)  # those described
        self._descriptions = np.empty(len(envs), dtype=object)

    def read(self) -> dict[str, Any]:
        """The columns (n,) of the last step: "push" of lists, "root_wrench" (n, 6)."""
        record, metrics = self.record, self.record["metrics"]
        for i, env in enumerate(self.envs):
            pushes = env.simulation.pushes
            if pushes is not self._pushes[i]:
                self._pushes[i], self._descriptions[i] = pushes, env.push_infos()
        return {
            "reward_terms": dict(zip(REWARD_TERMS, record["reward_terms"].T.copy(), strict=True)),
            "push": self._descriptions.copy(),
            "is_success": metrics["quiet_steps"] >= self._quiet_steps,
            "solver_failures": metrics["failures"].astype(int),
            "torque_saturation": metrics["saturated"] / np.maximum(metrics["ticks"], 1.0),
            "root_wrench": record["root_wrench"].copy(),
        }
