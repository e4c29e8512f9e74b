"""A folder of `poise train --seeds`, and the runs that it names."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from poise.configs.errors import ConfigError, PoiseError
from poise.configs.reading import is_file, read_json
from poise.training.running.provenance import Circumstances

if TYPE_CHECKING:  # it loads SciPy
    from poise.training.benchmarking.statistics.rates import SeedFigures

SEEDS = "seeds.json"  # in a folder of `poise train --seeds`


class Evaluation(TypedDict):
    """A line of evaluations.csv: fractions of the held-out pushes, and the mean |action|."""

    timesteps: int
    recovered: float
    fallen: float
    mean_abs_action: float
    score: float


class SeedEntry(TypedDict):
    """A run of seeds.json: its first and its best evaluation, null as long as there is none."""

    seed: int
    folder: str
    timesteps: int
    finished: bool
    start: Evaluation | None
    best: Evaluation | None


class SeedSummary(Circumstances):
    """seeds.json of finished runs."""

    runs: list[SeedEntry]
    recovered: SeedFigures


def evaluations(entry: SeedEntry) -> tuple[Evaluation, Evaluation]:
    """The first and the best evaluation of a run that is finished; PoiseError if one is missing."""
    start, best = entry["start"], entry["best"]
    if start is None or best is None:
        raise PoiseError(f"{SEEDS}: a finished run has no evaluation")
    return start, best


def start_and_best(
    rows: Sequence[Evaluation],
) -> tuple[Evaluation | None, Evaluation | None]:
    """The first evaluation, and the best, first of equals, of what was trained; None: none yet."""
    trained = [row for row in rows if row["timesteps"] > 0] or rows
    best = max(trained, key=lambda row: row["score"], default=None)
    return (rows[0] if rows else None), best


def read_seeds(out: Path) -> list[SeedEntry]:
    """Return the runs of seeds.json; raises ConfigError naming the file."""
    path = out / SEEDS
    runs = read_json(path).get("runs")
    if not isinstance(runs, list) or not all(isinstance(run, dict) for run in runs):
        raise ConfigError("must be a list of mappings", source=path, field="runs")
    for run in runs:
        if type(run.get("seed")) is not int or not isinstance(run.get("folder"), str):
            raise ConfigError("a run without a seed or a folder", source=path, field="runs")
    return runs


def expand_seeds(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of controllers, a folder of `poise train --seeds` replaced by those of its runs.

    Raises ConfigError for a folder with a run that is not finished.
    """
    expanded: list[str] = []
    for name in names:
        if not is_file(Path(name) / SEEDS):
            expanded.append(name)
            continue
        for run in read_seeds(Path(name)):
            if not run.get("finished"):
                raise ConfigError(
                    f"the run of seed {run['seed']} is not finished: poise train --resume --out "
                    f"{shlex.quote(name)} goes on",
                    source=Path(name) / SEEDS,
                )
            expanded.append(str(Path(name) / run["folder"]))
    return tuple(expanded)
