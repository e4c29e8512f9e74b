"""A benchmark's summary in the form of an evaluation's, for whoever shows both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from poise.configs.errors import ConfigError
from poise.training.statistics.rates import wilson_interval

ENVELOPE = ("j50_mean", "j50_mean_ci95", "j50_mean_per_mass", "j50_min", "j90_mean", "j50_bounded",
            "eta_mean", "eta_mean_ci95", "eta_min", "directions", "factors", "eurobench",
            "tick_us", "errors")  # fmt: skip
COUNTS = ("both", "only_a", "only_b", "neither", "p_mcnemar")


def flat(
    summary: Mapping[str, Any], rows: Sequence[Mapping[str, str]], source: str
) -> dict[str, Any]:
    """The summary with `robot` as a name, and entries and pairs as of `poise evaluate`.

    An entry has the counts of the random mix, or of all its trials where there is no mix; a pair
    those of the mix too, or of all trials that both met. `played` counts all trials.

    Args:
        summary: as in summary.json.
        rows: lines of trials.csv.
        source: the file, for errors.

    Raises:
        ConfigError: the summary is not of this form.
    """
    robot = _mapping(summary.get("robot"), source, "robot")
    entries = _mapping(summary.get("controllers"), source, "controllers")
    pairs = summary.get("pairs")
    if not isinstance(pairs, list):
        raise ConfigError("must be a list", source=source, field="pairs")
    return {
        **summary,
        "robot": robot.get("name"),
        "controllers": {
            name: _entry(_mapping(entry, source, f"controllers.{name}"), name, rows, source)
            for name, entry in entries.items()
        },
        "pairs": [_pair(_mapping(pair, source, f"pairs.{k}"), k, source)
                  for k, pair in enumerate(pairs)],
    }  # fmt: skip


def _entry(
    entry: Mapping[str, Any], name: str, rows: Sequence[Mapping[str, str]], source: str
) -> dict[str, Any]:
    mix = entry.get("mix")
    if mix is None:
        counts = _counts([row for row in rows if row["controller"] == name])
    else:
        counts = dict(_mapping(mix, source, f"controllers.{name}.mix"))
    own = {key: entry.get(key) for key in ENVELOPE}
    return {**counts, **own, "played": entry.get("trials")}


def _counts(rows: Sequence[Mapping[str, str]]) -> dict[str, Any]:
    """Counts of all trials."""
    recovered = sum(row["recovered"] == "True" for row in rows)
    return {
        "trials": len(rows),
        "recovered": recovered,
        "recovered_rate": recovered / max(len(rows), 1),
        "recovered_ci95": list(wilson_interval(recovered, max(len(rows), 1))),
        "fallen": sum(row["fallen"] == "True" for row in rows),
        "solver_failures": sum(int(row["solver_failures"] or 0) for row in rows),
        "root_force_max": max((float(row["root_force"] or 0.0) for row in rows), default=None),
    }


def _pair(pair: Mapping[str, Any], k: int, source: str) -> dict[str, Any]:
    found = pair.get("mix") or pair.get("all")
    shown: dict[str, Any] = {key: pair.get(key) for key in ("a", "b", "j50_gain", "j50_gain_ci95")}
    if found is not None:
        counts = _mapping(found, source, f"pairs.{k}.mix")
        shown |= {key: counts.get(key) for key in COUNTS}
    return shown


def _mapping(value: Any, source: str, field: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ConfigError("must be a mapping", source=source, field=field)
    return value
