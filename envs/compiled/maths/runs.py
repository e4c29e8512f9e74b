"""Runs of what holds for some rows in a row."""

import numpy as np


def runs_of(holds: np.ndarray) -> np.ndarray:
    """(k, 2) first row, and row after the last one, of every run of true rows of `holds` (n,)."""
    edges = np.diff(np.concatenate([[False], holds, [False]]).astype(int))
    return np.column_stack([np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)])
