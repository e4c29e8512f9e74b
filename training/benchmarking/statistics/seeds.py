"""Figures of training seeds taken together."""

from collections.abc import Sequence
from typing import TypedDict

import numpy as np

from .rates import seed_aggregate


class SeedFigures(TypedDict):
    """A figure over training seeds, `tasks` of each; `worst` is that of `worst_seed`."""

    iqm: float
    iqm_ci95: tuple[float | None, float | None]
    tasks: int
    values: list[float]
    worst: float
    worst_seed: int


def seed_figures(scores: np.ndarray, seeds: Sequence[int]) -> SeedFigures:
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
