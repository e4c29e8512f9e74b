"""Training seeds: runs of one configuration that differ in the seed alone, taken together."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.reading import is_file, is_folder
from poise.configs.schema import to_yaml
from poise.training.benchmarking.statistics.rates import SeedFigures, seed_figures
from poise.training.learning.seeds.records import SEEDS
from poise.training.running.columns import NONE, OVER_SEEDS
from poise.training.running.summary import Entry, SeedGroup


def seed_groups(names: Sequence[str], entries: Mapping[str, Entry]) -> list[SeedGroup]:
    """Return the interquartile means over the seeds of every configuration that has several run
    folders.

    `entries` are those of a summary. The scores of η are those of every direction (the tasks);
    J50's mean and the recovered rate are one task each. Seeds are resampled for every task
    [Agarwal21]. Checkpoints of one run, which share a seed, are no sample of seeds: a
    configuration with two of the same is left out.
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


def seed_lines(groups: Sequence[SeedGroup]) -> list[str]:
    """Return a line for each group and figure, for the terminal."""
    lines = []
    for group in groups:
        head = f"IQM over {len(group['members'])} training seeds, {group['name']}:"
        for each in OVER_SEEDS:
            if each.key in group:
                found = cast(SeedFigures, group.get(each.key))
                value, low, high, worst = (
                    format(x, each.form) if x is not None else NONE
                    for x in (found["iqm"], *found["iqm_ci95"], found["worst"])
                )
                text = f"{each.heading} {value} [{low}, {high}], worst {worst} (seed"
                lines.append(f"{head} {text} {found['worst_seed']})")
    return lines


def _configuration(folder: str) -> tuple[str, int]:
    """Return the configuration of a run without its seed, and the seed."""
    from poise.training.learning.policy import load_policy

    try:
        config = load_policy(folder).config
    except ConfigError:  # a run folder of another kind
        return folder, 0
    return to_yaml(replace(config, seed=0)), config.seed


def _aggregate(members: list[str], seeds: list[int], entries: Mapping[str, Entry]) -> SeedGroup:
    here = [entries[name] for name in members]
    parents = {str(Path(name).parent) for name in members}
    together = len(parents) == 1 and is_file(Path(members[0]).parent / SEEDS)
    group: SeedGroup = {
        "name": parents.pop() if together else ", ".join(members),
        "members": members,
        "seeds": seeds,
    }
    if all("directions" in entry for entry in here):
        j50 = [[entry["j50_mean"]] for entry in here]
        group["j50_mean"] = seed_figures(np.array(j50), seeds)
        etas = [[direction["eta"] for direction in entry["directions"]] for entry in here]
        group["eta"] = seed_figures(np.array(etas), seeds)
    rates = [[entry["recovered_rate"]] for entry in here]
    group["recovered"] = seed_figures(np.array(rates), seeds)
    return group
