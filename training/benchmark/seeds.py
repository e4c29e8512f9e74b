"""Training seeds: run folders of one configuration, taken together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from poise.envs.config import to_yaml
from poise.envs.errors import ConfigError

from ..statistics import seed_aggregate


def seed_groups(names: Sequence[str], entries: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Interquartile means over the seeds of every configuration that has several run folders.

    The scores of η are those of every direction (the tasks), those of the mix one rate each; the
    seeds are drawn anew for every task [Agarwal21].
    """
    groups: dict[str, list[tuple[str, int]]] = {}
    for name in names:
        if Path(name).is_dir():
            configuration, seed = _configuration(name)
            groups.setdefault(configuration, []).append((name, seed))
    return [
        _aggregate([name for name, _ in group], [seed for _, seed in group], entries)
        for group in groups.values()
        if len(group) > 1
    ]


def _configuration(folder: str) -> tuple[str, int]:
    """What a run was trained with but for its seed, and the seed."""
    from ..policy import load_policy

    try:
        config = load_policy(folder).config
    except ConfigError:  # a run folder of another kind
        return folder, 0
    return to_yaml(replace(config, seed=0)), config.seed


def _aggregate(members: list[str], seeds: list[int], entries: Mapping[str, Any]) -> dict[str, Any]:
    eta = [[direction["eta"] for direction in entries[name]["directions"]] for name in members]
    group: dict[str, Any] = {
        "members": members,
        "seeds": seeds,
        "eta": _figures(np.array(eta)),
    }
    if all(entries[name]["mix"] for name in members):
        rates = [[entries[name]["mix"]["recovered_rate"]] for name in members]
        group["mix"] = _figures(np.array(rates))
    return group


def _figures(scores: np.ndarray) -> dict[str, Any]:
    """IQM of (seeds, tasks) with its interval."""
    found = seed_aggregate(scores)
    return {"iqm": found.iqm, "iqm_ci95": found.interval, "tasks": found.tasks}
