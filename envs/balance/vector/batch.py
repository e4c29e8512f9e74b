"""Many environments stepped by a few threads: no processes, no pickling.

Compiled steps release the GIL, so threads run in parallel. Every environment has its own data
and generator: results do not depend on the number of threads.
"""

from collections import deque
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.numbers import real_array, whole_number
from poise.envs.balance.action import BEYOND
from poise.envs.balance.base import BalanceEnv
from poise.envs.compiled.calls import CompiledStep
from poise.envs.compiled.copies import Copyable

from .rows import in_rows
from .scheduler import NOTHING, StepSchedule
from .threads import ThreadTeam


def replicate(env: BalanceEnv, count: int) -> list[BalanceEnv]:
    """`env` and `count` − 1 more like it, which share what is only read (robot, motion).

    Raises ConfigError if `count` is below 1, or the environment's controller cannot be shared.
    """
    count = whole_number(count, 1, "num_envs")
    return [env, *(type(env)(**env.arguments()) for _ in range(count - 1))]


class EnvBatch(Copyable):
    """`len(envs)` environments of one kind; what they report lies in arrays, one row for each.

    These arrays are new ones with every call: whoever holds them keeps what they were.
    """

    def __init__(self, envs: Sequence[BalanceEnv], threads: int = 1):
        if not envs:
            raise ConfigError("needs at least one environment", field="envs")
        self.envs = list(envs)
        first, n = self.envs[0], len(self.envs)
        for env in self.envs:
            spaces = env.observation_space, env.action_space
            if spaces != (first.observation_space, first.action_space):
                raise ConfigError("environments must have the same spaces", field="envs")
        if len({id(env) for env in envs}) < n:
            raise ConfigError("holds an environment twice", field="envs")
        # a window is drawn to from one thread only
        self.threads = 1 if first.render_mode == "human" else max(1, min(threads, n))
        # the environments' own records become rows of these, so that nothing is gathered by hand
        self.episodes, rows = in_rows([env.episode for env in self.envs])
        for env, row in zip(self.envs, rows, strict=True):
            env.episode = row
        self.observations = np.zeros((n, *first.observation_space.shape), dtype=np.float32)
        self.final_observations = self.observations
        self.rewards = np.zeros(n)
        self.terminated = np.zeros(n, dtype=bool)
        self.truncated = np.zeros(n, dtype=bool)
        self._helpers = ThreadTeam()
        self._nothing = StepSchedule(NOTHING, self.threads)
        self._turns: tuple[list[CompiledStep], StepSchedule] = [], self._nothing  # of those steps

    def __getstate__(self) -> dict[str, object]:
        return {**super().__getstate__(), "_turns": ([], self._nothing)}  # they hold addresses

    @property
    def ended(self) -> np.ndarray:
        """(n,) whether the episode ended with the last step."""
        return self.terminated | self.truncated

    def reset(
        self,
        seeds: Sequence[int | None],
        options: Sequence[dict[str, object] | None] | None = None,
        mask: np.ndarray | None = None,
    ) -> np.ndarray:
        """Start episodes, each with its seed and options; returns the observations (n, no).

        Only those of `mask` (n,) if it is given; the others go on.
        """
        n = len(self.envs)
        options = [None] * n if options is None else options
        if len(seeds) != n or len(options) != n:
            raise ConfigError(
                f"{len(seeds)} seeds and {len(options)} options for {n} environments",
                source="reset",
            )
        indices = np.arange(n) if mask is None else np.flatnonzero(mask)
        self._share(lambda i: self._restart(i, seeds[i], options[i]), indices)
        self._report()
        return self.observations

    def step(
        self, actions: np.ndarray, at_end: Callable[[int, BalanceEnv], None] | None = None
    ) -> None:
        """Take a policy step of all; an episode that ends is followed by the next at once.

        Its outcome are `observations`, `rewards`, `terminated`, `truncated` and, where an episode
        ended, `final_observations`. `at_end(i, env)` sees a finished episode before its reset.
        Raises ConfigError for actions (n, na) that are not valid; then nothing has moved.
        """
        self.advance(actions)
        ended = np.flatnonzero(self.ended)
        if len(ended) == 0:
            return
        self.final_observations = self.observations
        if at_end is not None:
            for i in ended:
                at_end(int(i), self.envs[i])
        self._share(self._restart, ended)
        self.observations = self.episodes["observation"].astype(np.float32)

    def advance(self, actions: np.ndarray, restart: np.ndarray | None = None) -> None:
        """Take a policy step of all but those of `restart` (n,), which start an episode instead.

        The action of a restarted environment is ignored; its reward is 0. Nothing else is reset.
        Raises ConfigError for invalid actions (n, na), before any environment steps. An error of a
        controller is raised after all environments have stepped.
        """
        record, everyone = self.episodes, range(len(self.envs))
        stepped: Sequence[int] = everyone
        restarted: list[int] = []
        # rows that are stepped: nearly always all, and a slice is cheap
        live: np.ndarray | slice = slice(None)
        if restart is not None and restart.any():
            live, restarted = ~restart, np.flatnonzero(restart).tolist()
            stepped = np.flatnonzero(live).tolist()
        if not record["running"][live].all():
            for env in np.array(self.envs, dtype=object)[live]:
                env.expect_running()  # raises
        self._set_actions(actions, live)
        turns = self._compiled_steps(stepped)
        if turns is not None and restarted:
            self._share(self._restart, restarted, turns)
        elif turns is not None:
            turns.play_all(self._helpers)
        else:
            again = set(restarted)
            self._share(
                lambda i: self._restart(i) if i in again else self.envs[i].advance(), everyone
            )
        self._report()
        for i in stepped if turns is not None else ():
            self.envs[i].check()

    def _report(self) -> None:
        """Copy what the records say; the record of a new episode is empty."""
        record = self.episodes
        self.observations = record["observation"].astype(np.float32)
        self.rewards = record["reward"].copy()
        self.terminated = record["metrics"]["terminated"] != 0.0
        self.truncated = (record["running"] == 0) & ~self.terminated

    def _compiled_steps(self, stepped: Sequence[int]) -> StepSchedule | None:
        """Return the schedule of the steps of `stepped`; None if Python has to take them."""
        steps = [self.envs[i].compiled_step() for i in stepped]
        known, turns = self._turns
        if steps == known:  # the same objects, as long as none was bound again
            return turns
        found = [step for step in steps if step is not None]
        if len(found) < len(steps):
            return None
        rows = np.array([step.row() for step in found], dtype=np.int64).reshape(-1, 3)
        self._turns = found, StepSchedule(rows, self.threads)
        return self._turns[1]

    def _set_actions(self, actions: np.ndarray, live: np.ndarray | slice) -> None:
        """Set the actions of these rows at once, as `BalanceEnv.set_action` does."""
        record = self.episodes
        vectors = real_array(actions)
        if vectors is None:
            raise ConfigError(f"must be numbers, not {shown(actions)}", field="action")
        if vectors.shape != record["action"].shape:
            raise ConfigError(
                f"has shape {vectors.shape}, expected {record['action'].shape}", field="action"
            )
        vectors = vectors[live].astype(float, copy=False)
        if self.envs[0].config.clip_action:
            vectors = np.clip(vectors, -1.0, 1.0)
        good = np.abs(vectors) <= 1.0 + BEYOND  # NaN is not
        if not good.all():
            for env, vector in zip(np.array(self.envs, dtype=object)[live], vectors, strict=True):
                env.check_action(vector)  # raises, and names the entries
        record["last_action"][live] = record["action"][live]
        record["action"][live] = np.minimum(np.maximum(vectors, -1.0), 1.0)

    def _restart(
        self, i: int, seed: int | None = None, options: dict[str, object] | None = None
    ) -> None:
        self.envs[i].reset(seed=seed, options=options)

    def _share(
        self, work: Callable[[int], None], indices: Iterable[int], turns: StepSchedule | None = None
    ) -> None:
        """Call `work` with every index and play all `turns`, in all threads.

        Whoever is free takes the next. Of the indices they take from both ends, so that most
        environments stay with a thread and in its cache.
        """
        todo, turns = deque(indices), turns or self._nothing
        turns.begin()

        def take_part(thread: int) -> None:
            _work_off(work, todo.pop if thread % 2 else todo.popleft)
            turns.play(thread)

        self._helpers.distribute(take_part, min(self.threads, len(todo) + len(turns.steps)) - 1)

    def close(self) -> None:
        """Close the environments and stop the threads."""
        for env in self.envs:
            env.close()
        self._helpers.close()


def _work_off(work: Callable[[int], None], take: Callable[[], int]) -> None:
    """Call `work` with what `take` gives, until it raises IndexError for want of more."""
    while True:
        try:
            i = take()
        except IndexError:
            return
        work(i)
