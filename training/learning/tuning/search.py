"""Tuning a controller's gains by CMA-ES on seeded pushes [Hansen16].

Candidates of one generation meet the same pushes; every generation draws new ones, so that
gains are not fitted to a few trials. Needs the `cma` package (`pip install -e '.[dev]'`).
"""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TypedDict

import numpy as np
from rich.console import Console

from poise.baselines.allowance import allows
from poise.configs.errors import ConfigError
from poise.configs.extras import needing
from poise.configs.files import resolve, write_atomic
from poise.configs.outputs import check_out_folder
from poise.configs.problems import out_of_range
from poise.configs.reading import is_file, parse_json, read_lines
from poise.configs.schema import build, on_base, read_yaml, to_dict, to_yaml
from poise.envs.robots.robot import load_robot
from poise.training.running.executor import Executor
from poise.training.running.folder_lock import FolderLock, check_resume
from poise.training.running.stopping import keeps

from .candidates import Candidate, check_tuning_commands, follow_limits, worth_of_trials
from .gains import Gains
from .pace import GenerationPace
from .tasks import TuneConfig

CONFIG, GAINS, HISTORY = "config.yaml", "gains.yaml", "history.jsonl"
AVERAGED = 16  # generations whose better halves the result is the mean of


class Generation(TypedDict):
    """A line of the history: where the candidates were, and the `worth` of their trials.

    `units` (candidates, gains); `alone` and `below` (candidates, trials), empty where no trials
    were run; `limits` (2, directions) [N·s] after it.
    """

    generation: int
    units: list[list[float]]
    alone: list[list[float]]
    below: list[list[float]]
    limits: list[list[float]]


def tune_config(name_or_path: str | Path, **fields: object) -> TuneConfig:
    """A packaged tuning configuration (`configs/tuning`) or a path to one; `base` names another.

    `fields` replace its own.

    Raises ConfigError naming the file, the field and the choices.
    """
    path = resolve("tuning", name_or_path)
    return build(TuneConfig, {**on_base(read_yaml(path), "tuning", path), **fields}, str(path))


@allows()
def tune(
    config: TuneConfig,
    out: Path,
    workers: int = 2,
    resume: bool = False,
    console: Console | None = None,
    allow: str | Iterable[str] = (),
    minutes: float | None = None,
) -> dict[str, object]:
    """Search; returns the controller's configuration at the mean of the last candidates.

    Writes `out/gains.yaml`, that controller, after each generation, and `out/history.jsonl` with
    all that was tried, from which `resume` goes on as if nothing had happened. A controller from
    outside (``module:Class``) that the configuration or the policy names must be among `allow`.
    No generation begins that would end later than `minutes` after the first one of this call
    began, as estimated from the earlier ones; at least one is run.

    Raises ConfigError for a configuration that is not valid or names what is not allowed, walks out
    of the controller's range where the search starts, `minutes` that are not above 0, a
    folder that holds another search, or where the library `cma` is missing; PoiseError when another
    process searches there, or a file cannot be written.
    """
    if minutes is not None and not minutes > 0.0:
        raise out_of_range(minutes, field="minutes", above=0)
    check_out_folder(out)
    _known(config, out, resume)  # what is refused makes no folder
    gains = Gains(config.controller, config.gains, config.robot)
    if config.walks is not None:
        check_tuning_commands(config.controller, load_robot(config.robot), config.walks)
    if config.policy is not None:
        from poise.training.learning.policy import load_policy

        load_policy(config.policy, load_robot(config.robot))
    search = _Search(config, gains)
    console = console or Console(quiet=True)
    keeps(out / HISTORY, f"the finished generations are kept in {out}; go on with --resume")
    with Executor("local", workers) as executor, FolderLock(out):
        rows = _known(config, out, resume)  # another search may have ended since
        for row in rows:
            search.again(row, out / HISTORY)
        write_atomic(out / CONFIG, to_yaml(config))
        pace = GenerationPace(minutes)
        while search.generation < config.generations and pace.allows_another():
            rows.append(search.step(executor))
            pace.count()
            write_atomic(out / GAINS, to_yaml(gains.at(search.mean)))
            write_atomic(out / HISTORY, "".join(json.dumps(row) + "\n" for row in rows))
            left = config.generations - search.generation
            console.print(search.words(rows[-1]) + pace.words(left), highlight=False)
    return gains.at(search.mean)


def _known(config: TuneConfig, out: Path, resume: bool) -> list[Generation]:
    """Return the generations that an earlier call has tried."""
    check_resume(out, resume, is_file(out / CONFIG), "a search", "search")
    if not resume:
        return []
    before = to_dict(build(TuneConfig, read_yaml(out / CONFIG), out / CONFIG))
    for name, value in to_dict(config).items():
        if name != "generations" and before[name] != value:
            raise ConfigError("is not that of the search here", source=out / CONFIG, field=name)
    if not is_file(out / HISTORY):
        return []
    try:
        rows = [parse_json(line) for line in read_lines(out / HISTORY)]
    except ValueError as error:
        raise ConfigError(f"not valid JSON: {error}", source=out / HISTORY) from None
    for number, row in enumerate(rows, 1):
        if not isinstance(row, dict):
            raise ConfigError(f"line {number} must be a mapping", source=out / HISTORY)
    return rows


class _Search:
    """CMA-ES, and how far the pushes have followed the candidates."""

    def __init__(self, config: TuneConfig, gains: Gains):
        with needing("dev"):
            import cma
        self.config, self.gains, self.robot = config, gains, load_robot(config.robot)
        rng = np.random.default_rng(config.seed)
        options = {
            "bounds": [0, 1], "popsize": config.population, "verbose": -9, "seed": np.nan,
            "randn": lambda *shape: rng.standard_normal(shape),
        }  # fmt: skip
        self.cma = cma.CMAEvolutionStrategy(gains.first(), config.spread, options)
        first = config.tasks.first(self.robot)
        self.limits = [first, first]  # alone, under the policy
        self.generation = 0
        self.mean = gains.first()  #: what the search has found
        self.centres: list[np.ndarray] = []

    def step(self, executor: Executor) -> Generation:
        """Return a generation; returns its line of the history."""
        config, limits = self.config, self.limits
        units = [np.asarray(u) for u in self.cma.ask()]
        seeds = [config.seed + 100_000 * (2 * self.generation + k + 1) for k in range(2)]
        alone, below = (tuple(config.tasks.draw(seeds[k], self.robot, limits[k])) for k in range(2))
        if config.policy is None or config.policy_share == 0.0:
            below = ()
        elif config.policy_share == 1.0:
            alone = ()
        jobs = [Candidate(number, config, self.gains.at(u), alone, below)
                for number, u in enumerate(units)]  # fmt: skip
        found = {job.number: values for job, values in executor.each(worth_of_trials, jobs)}
        row: Generation = {
            "generation": self.generation,
            "units": [u.tolist() for u in units],
            "alone": [found[k][0] for k in range(len(units))],
            "below": [found[k][1] for k in range(len(units))],
            "limits": [],
        }
        self._take(units, row)
        row["limits"] = [each.tolist() for each in self.limits]
        return row

    def again(self, row: Generation, source: Path) -> None:
        """Restore a generation that has been evaluated before."""
        units = [np.asarray(u) for u in self.cma.ask()]
        try:
            same = np.allclose(units, row["units"], rtol=0.0, atol=1e-12)
            same = same and self._are_worths(row["alone"]) and self._are_worths(row["below"])
        except (KeyError, TypeError, ValueError, OverflowError):
            same = False
        if not same:
            raise ConfigError(
                f"line {self.generation + 1} is not what this search tries there", source=source
            )
        self._take(units, row)

    def _are_worths(self, values: list[list[float]]) -> bool:
        """Return True if these are values of all candidates and tasks, or of no tasks."""
        found = np.asarray(values, float)
        trials = len(self.limits[0]) * len(self.config.tasks.levels)
        sizes = [(self.config.population, count) for count in (0, trials)]
        return found.shape in sizes and bool(np.all((found >= 0.0) & (found <= 1.0)))

    def _take(self, units: list[np.ndarray], row: Generation) -> None:
        """Let the search learn from what a generation was worth."""
        fraction = self.config.policy_share if row["below"][0] else 0.0
        scores = np.zeros(len(units))
        shape = (len(units), len(self.limits[0]), len(self.config.tasks.levels))
        agents = (row["alone"], 1.0 - fraction), (row["below"], fraction)
        for k, (worths, weight) in enumerate(agents):
            if worths[0]:
                found = np.reshape(worths, shape)
                scores += weight * found.mean(axis=(1, 2))
                self.limits[k] = follow_limits(self.limits[k], found)
        self.cma.tell(units, (-scores).tolist())
        better = np.argsort(-scores, kind="stable")[: (len(units) + 1) // 2]
        self.centres.append(np.mean([units[k] for k in better], axis=0))
        # a generation's own mean follows the chance of its pushes
        self.mean = np.mean(self.centres[-AVERAGED:], axis=0)
        self.scores = scores
        self.generation += 1

    def words(self, row: Generation) -> str:
        """Return a line for the terminal."""
        text = f"generation {self.generation} of {self.config.generations}"
        text += f": score {self.scores.mean():.2f}, best {self.scores.max():.2f}"
        agents = ("alone", row["alone"]), (f"under {self.config.policy}", row["below"])
        for (who, worths), limits in zip(agents, self.limits, strict=True):
            if worths[0]:
                text += f"; {self.config.tasks.words(who, limits)}"
        return text
