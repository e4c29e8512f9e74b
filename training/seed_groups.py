"""Training seeds: runs of one configuration that differ in the seed alone, taken together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from poise.envs.config import to_yaml
from poise.envs.errors import ConfigError
from poise.envs.reading import is_file, is_folder, read_json

from .statistics import seed_aggregate

SEEDS = "seeds.json"  # in a folder of `poise train --seeds`


def seed_folder(out: Path, seed: int) -> Path:
    """Where the run of a seed lies."""
    return out / f"seed-{seed}"


def read_seeds(out: Path) -> list[dict[str, Any]]:
    """The runs of seeds.json; raises ConfigError naming the file."""
    path = out / SEEDS
    runs = read_json(path).get("runs")
    if not isinstance(runs, list) or not all(isinstance(run, dict) for run in runs):
        raise ConfigError("must be a list of mappings", source=path, field="runs")
    for run in runs:
        if type(run.get("seed")) is not int or not isinstance(run.get("folder"), str):
            raise ConfigError("a run without a seed or a folder", source=path, field="runs")
    return runs


def expand_seeds(names: Sequence[str]) -> tuple[str, ...]:
    """Names of controllers, a folder of `poise train --seeds` replaced by those of its runs.

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
                    f"the run of seed {run['seed']} is not finished: poise train --resume goes on",
                    source=Path(name) / SEEDS,
                )
            expanded.append(str(Path(name) / run["folder"]))
    return tuple(expanded)


def seed_groups(names: Sequence[str], entries: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Interquartile means over the seeds of every configuration that has several run folders.

    `entries` are those of a summary, of `poise evaluate` or `poise benchmark`. The scores of η are
    those of every direction (the tasks); J50's mean and the recovered rates are one task each.
    The seeds are drawn anew for every task [Agarwal21]. Checkpoints of one run, which share a seed,
    are no sample of seeds: a configuration with two of the same is left out.
    """
    groups: dict[str, list[tuple[str, int]]] = {}
    for name in names:
        if is_folder(name):
            configuration, seed = _configuration(name)
            groups.setdefault(configuration, []).append((name, seed))
    return [
        _aggregate([name for name, _ in group], [seed for _, seed in group], entries)
        for group in groups.values()
        if len(group) > 1 and len({seed for _, seed in group}) == len(group)
    ]


def seed_figures(scores: np.ndarray, seeds: Sequence[int]) -> dict[str, Any]:
    """IQM of (seeds, tasks) with its interval, every seed's mean, and the worst of these."""
    found, values = seed_aggregate(scores), scores.mean(axis=1)
    worst = int(np.argmin(values))
    return {
        "iqm": found.iqm,
        "iqm_ci95": found.interval,
        "tasks": found.tasks,
        "values": values.tolist(),
        "worst": float(values[worst]),
        "worst_seed": seeds[worst],
    }


def seed_lines(groups: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line of text per group and figure, for the terminal."""
    lines = []
    for group in groups:
        head = f"IQM over {len(group['members'])} training seeds, {group['name']}:"
        for key, title, form in FIGURES:
            if key in group:
                found = group[key]
                value, low, high, worst = (
                    format(x, form) for x in (found["iqm"], *found["iqm_ci95"], found["worst"])
                )
                text = f"{title} {value} [{low}, {high}], worst {worst} (seed"
                lines.append(f"{head} {text} {found['worst_seed']})")
    return lines


#: key in a group → what it is called, how it is written
FIGURES = (
    ("j50_mean", "mean J50 [N·s]", ".1f"),
    ("eta", "η", ".2f"),
    ("recovered", "recovered", ".1%"),
    ("mix", "recovered of the mix", ".1%"),
)


def _configuration(folder: str) -> tuple[str, int]:
    """What a run was trained with but for its seed, and the seed."""
    from .policy import load_policy

    try:
        config = load_policy(folder).config
    except ConfigError:  # a run folder of another kind
        return folder, 0
    return to_yaml(replace(config, seed=0)), config.seed


def _aggregate(members: list[str], seeds: list[int], entries: Mapping[str, Any]) -> dict[str, Any]:
    here = [entries[name] for name in members]
    parents = {str(Path(name).parent) for name in members}
    together = len(parents) == 1 and is_file(Path(members[0]).parent / SEEDS)
    scores: dict[str, list[list[float]]] = {}
    if all(entry.get("directions") for entry in here):
        scores["j50_mean"] = [[entry["j50_mean"]] for entry in here]
        scores["eta"] = [[direction["eta"] for direction in e["directions"]] for e in here]
    if all(entry.get("mix") for entry in here):
        scores["mix"] = [[entry["mix"]["recovered_rate"]] for entry in here]
    if all("recovered_rate" in entry for entry in here):
        scores["recovered"] = [[entry["recovered_rate"]] for entry in here]
    return {
        "name": parents.pop() if together else ", ".join(members),
        "members": members,
        "seeds": seeds,
        **{key: seed_figures(np.array(table), seeds) for key, table in scores.items()},
    }
