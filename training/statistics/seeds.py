"""Figures of training seeds taken together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .rates import seed_aggregate


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


#: key in a group → what it is called, how it is written
FIGURES = (
    ("j50_mean", "mean J50 [N·s]", ".1f"),
    ("eta", "η", ".2f"),
    ("recovered", "recovered", ".1%"),
    ("mix", "recovered of the mix", ".1%"),
)
