"""Gymnasium's vector environment over a batch: threads, no processes, no pickling."""

import os
from collections.abc import Mapping, Sequence
from enum import Enum
from functools import partial
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space

from poise.configs.errors import ConfigError, shown
from poise.configs.numbers import option_mapping, seed_number, whole_number
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.compiled.copies import Copyable

from .batch import EnvBatch, replicate
from .info_columns import InfoColumns

try:
    from gymnasium.vector import AutoresetMode
except ImportError:  # Gymnasium 1.0, which knows the first mode only

    class AutoresetMode(Enum):  # type: ignore[no-redef]
        """The moment at which an ended episode is followed by the next."""

        NEXT_STEP = "NextStep"
        SAME_STEP = "SameStep"
        DISABLED = "Disabled"


class BalanceVectorEnv(Copyable, VectorEnv):
    """`len(envs)` environments of one kind, stepped by `threads` threads.

    Row i of every array, and every `info`, is what `gymnasium.vector.SyncVectorEnv` would give of
    the same environments, bit for bit, for any number of threads. `autoreset_mode`, a
    `gymnasium.vector.AutoresetMode` or its value, says what follows an episode's end:

    - "NextStep": the next `step` resets it, whatever its action; reward 0
    - "SameStep": it is reset at once; the end is in `info` as "final_obs" and "final_info"
    - "Disabled": nothing; use `reset(options={"reset_mask": ended})`

    Raises ConfigError for an unknown mode, fewer threads than one, or environments that differ.
    """

    batch: EnvBatch
    envs: list[BalanceEnv]

    def __init__(
        self,
        envs: Sequence[BalanceEnv],
        threads: int = 1,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    ):
        modes = {mode.value: mode for mode in AutoresetMode}
        if isinstance(autoreset_mode, AutoresetMode):
            self.autoreset_mode = autoreset_mode
        elif isinstance(autoreset_mode, str) and autoreset_mode in modes:
            self.autoreset_mode = modes[autoreset_mode]
        else:
            raise ConfigError(
                f"unknown mode {shown(autoreset_mode)}", field="autoreset_mode", choices=modes
            )
        self.batch = EnvBatch(envs, whole_number(threads, 1, "threads"))
        self.envs = self.batch.envs
        first = self.envs[0]
        self.num_envs = len(self.envs)
        self.metadata = {**first.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = first.render_mode
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self.observation_space = batch_space(first.observation_space, self.num_envs)
        self.action_space = batch_space(first.action_space, self.num_envs)
        self._own_infos: bool = any(type(env).info is not BalanceEnv.info for env in self.envs)
        self._columns: InfoColumns = InfoColumns(self.envs, self.batch.episodes)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start episodes: environment i with `seed` + i, or with entry i of a list.

        `options` are those of a single environment, for each. In addition "reset_mask" (n,) bool
        selects the environments to reset. Raises ConfigError for a wrong number of seeds, mask or
        option.
        """
        n, options = self.num_envs, option_mapping(options)
        seeds = self._seeds(seed)
        mask = options.pop("reset_mask", None)
        if mask is None:
            mask = np.ones(n, dtype=bool)
        elif not (isinstance(mask, np.ndarray) and mask.dtype == bool and mask.shape == (n,)):
            raise ConfigError(f"must be a bool array ({n},)", source="reset", field="reset_mask")
        elif not mask.any():
            raise ConfigError("needs at least one True", source="reset", field="reset_mask")
        observations = self.batch.reset(seeds, [options] * n, mask)
        return observations, stack_infos([env.info() for env in self.envs], mask)

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        """A seed for each environment; the batch checks their number."""
        if isinstance(seed, np.ndarray):
            seed = seed.tolist()
        if isinstance(seed, (list, tuple)):
            return [seed_number(each, f"seed[{i}]") for i, each in enumerate(seed)]
        first = seed_number(seed)
        return [None if first is None else first + i for i in range(self.num_envs)]

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take a policy step of all with `actions` (n, na).

        Raises ConfigError for actions that are not valid (nothing has moved then), PoiseError
        before the first reset.
        """
        batch = self.batch
        infos: dict[str, object] = {}
        if self.autoreset_mode is AutoresetMode.SAME_STEP:
            final: list[dict[str, Any]] = [{} for _ in self.envs]

            def at_end(i: int, env: BalanceEnv) -> None:
                final[i] = env.info()

            batch.step(actions, at_end)
            ended = batch.ended
            if ended.any():
                last = zip(batch.final_observations, final, strict=True)
                ends = [{"final_obs": row, "final_info": info} for row, info in last]
                infos = stack_infos(ends, ended)
        else:
            resets = self.autoreset_mode is AutoresetMode.NEXT_STEP
            batch.advance(actions, batch.ended if resets else None)
        if self.render_mode == "human":
            self.render()
        return (
            batch.observations,
            batch.rewards,
            batch.terminated.copy(),  # by these it knows what to reset
            batch.truncated.copy(),
            {**self._infos(), **infos},
        )

    def _infos(self) -> dict[str, object]:
        """`stack_infos` of what each environment's `info` says."""
        every = np.ones(self.num_envs, dtype=bool)
        if self._own_infos:  # of a subclass
            return stack_infos([env.info() for env in self.envs], every)
        columns = self._columns.read()
        terms = _with_masks(columns["reward_terms"], every)
        return _with_masks({**columns, "reward_terms": terms}, every)

    def render(self) -> tuple[Any, ...]:
        """A frame of each environment, see `BalanceEnv.render`."""
        return tuple(env.render() for env in self.envs)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """Each environment's generator."""
        return tuple(env.np_random for env in self.envs)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of each environment's generator."""
        return tuple(env.np_random_seed for env in self.envs)

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call the method `name` of each environment, or get its attribute `name`."""
        found = [getattr(env, name) for env in self.envs]
        return tuple(each(*args, **kwargs) if callable(each) else each for each in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of each environment."""
        return self.call(name)

    def set_attr(self, name: str, values: object) -> None:
        """Set an attribute: a list or tuple has a value for each environment, else all get it."""
        if not isinstance(values, (list, tuple)):
            values = [values] * self.num_envs
        if len(values) != self.num_envs:
            raise ConfigError(f"needs {self.num_envs} values, not {len(values)}", field=name)
        for env, value in zip(self.envs, values, strict=True):
            setattr(env, name, value)

    def close_extras(self, **kwargs: object) -> None:
        """Close the environments and stop the threads."""
        self.batch.close()


def stack_infos(infos: Sequence[dict[str, Any]], mask: np.ndarray) -> dict[str, Any]:
    """Infos with the same keys as one, in the form of Gymnasium's vector environments.

    Numbers and arrays become arrays with a row for each environment, dictionaries are gone into,
    all else becomes an array of objects. "_key" (n,) tells whose `key` was reported: `mask`, of
    which the rows outside hold nothing.
    """
    rows = np.flatnonzero(mask).tolist()
    return _stack([infos[i] for i in rows], rows, mask.copy())


def _with_masks(columns: Mapping[str, object], mask: np.ndarray) -> dict[str, object]:
    """The columns, each with the rows that it is reported for."""
    marked: dict[str, object] = {}
    for key, column in columns.items():
        marked[key], marked[f"_{key}"] = column, mask
    return marked


def _stack(infos: list[dict[str, Any]], rows: list[int], mask: np.ndarray) -> dict[str, object]:
    stacked: dict[str, object] = {}
    for key, example in infos[0].items():
        values = [info[key] for info in infos]
        column: dict[str, object] | np.ndarray
        if isinstance(example, dict):
            column = _stack(values, rows, mask)
        elif key != "final_obs" and isinstance(example, (int, float, np.number, np.ndarray)):
            column = np.array(values)
            if len(rows) < len(mask):
                column, filled = np.zeros((len(mask), *column.shape[1:]), column.dtype), column
                column[rows] = filled
        else:
            column = np.full(len(mask), None, dtype=object)
            for i, value in zip(rows, values, strict=True):
                column[i] = value
        stacked[key] = column
        stacked[f"_{key}"] = mask
    return stacked


def make_vector_env(
    env_class: type[BalanceEnv],
    num_envs: int = 1,
    threads: int | None = None,
    autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    **arguments: Any,
) -> BalanceVectorEnv:
    """Make `num_envs` environments that share one robot, for `gymnasium.make_vec`.

    `threads` defaults to the processor's cores that this process may use; `arguments` are those
    of a single environment. Raises ConfigError naming what is wrong.
    """
    if threads is None:
        usable = getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))
        threads = len(usable(0))
    return BalanceVectorEnv(replicate(env_class(**arguments), num_envs), threads, autoreset_mode)


# for gymnasium.make_vec
torque_vector_env = partial(make_vector_env, TorqueBalanceEnv)
position_vector_env = partial(make_vector_env, PositionBalanceEnv)
