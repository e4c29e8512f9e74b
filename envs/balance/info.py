"""The `info` of environments, of one and of many at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from poise.envs.compiled.copies import Copyable

from .episode import FAILURES, QUIET_STEPS, SATURATED, TICKS, EpisodeArrays
from .mdp.reward import REWARD_TERMS

if TYPE_CHECKING:
    from .base import BalanceEnv


def step_info(env: BalanceEnv) -> dict[str, Any]:
    """Reward terms, push and record of the episode so far; see also `InfoColumns`."""
    # Python's own numbers: arithmetic with NumPy's costs ten times as much
    metrics, terms = env.episode.metrics.tolist(), env.episode.reward_terms.tolist()
    return {
        "reward_terms": dict(zip(REWARD_TERMS, terms, strict=True)),
        "push": env.push_infos(),
        "is_success": env.recovered,
        "solver_failures": int(metrics[FAILURES]),
        "torque_saturation": metrics[SATURATED] / max(metrics[TICKS], 1.0),
        "root_wrench": env.episode.root_wrench.copy(),
        **drawn_info(env),
    }


def drawn_info(env: BalanceEnv) -> dict[str, Any]:
    """What is told of the episode's robot where that is drawn, see `DrawnRobot.summary`."""
    if env.drawn is None:
        return {}
    return {"realism": {"level": env.realism.name, **env.drawn.summary(env.arrays.timestep)}}


class InfoArrays(TypedDict):
    """The entries of `step_info` of n environments, each (n,) but for the last one."""

    reward_terms: dict[str, np.ndarray]
    push: np.ndarray  # of lists
    is_success: np.ndarray
    solver_failures: np.ndarray
    torque_saturation: np.ndarray
    root_wrench: np.ndarray  # (n, 6)


class InfoColumns(Copyable):
    """The entries of `step_info` of many `envs`, one array for each key.

    `record` holds their rows. The lists of pushes are the same ones until the next episode.
    """

    def __init__(self, envs: Sequence[BalanceEnv], record: EpisodeArrays):
        self.envs, self.record = envs, record
        self._quiet_steps = np.array([env.quiet_steps for env in envs])
        self._pushes: list[object] = [None] * len(envs)  # those described
        self._descriptions = np.empty(len(envs), dtype=object)

    def read(self) -> InfoArrays:
        """The columns of the last step."""
        record, metrics = self.record, self.record.metrics
        for i, env in enumerate(self.envs):
            pushes = env.simulation.pushes
            if pushes is not self._pushes[i]:
                self._pushes[i], self._descriptions[i] = pushes, env.push_infos()
        return {
            "reward_terms": dict(zip(REWARD_TERMS, record.reward_terms.T.copy(), strict=True)),
            "push": self._descriptions.copy(),
            "is_success": metrics[:, QUIET_STEPS] >= self._quiet_steps,
            "solver_failures": metrics[:, FAILURES].astype(int),
            "torque_saturation": metrics[:, SATURATED] / np.maximum(metrics[:, TICKS], 1.0),
            "root_wrench": record.root_wrench.copy(),
        }
