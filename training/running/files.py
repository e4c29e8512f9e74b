"""Names of result files, and how figures are written into them."""

import csv
import dataclasses
import io
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

SETTINGS, LOG, TRIALS, SUMMARY = "settings.yaml", "trials.jsonl", "trials.csv", "summary.json"
PLOTS = ("polar_envelope.png", "fall_probability.png")
CURVE = "learning_curve.png"  # only for several checkpoints of a training run
REPORT = "report.html"  # by `poise report`; removed together with the result
FILES = (SUMMARY, SETTINGS, LOG, TRIALS, *PLOTS, CURVE)


def csv_text(rows: Sequence[Mapping[str, object]], columns: Sequence[str]) -> str:
    """Return rows as CSV with a header."""
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def plain(value: object) -> Any:
    """Return a value as plain lists and numbers for JSON, None where a number is not finite."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return plain(dataclasses.asdict(value))
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
