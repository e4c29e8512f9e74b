"""What a benchmark's summary.json must hold for those who read it: anybody may have written it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import NoneType
from typing import Any

from poise.configs.errors import ConfigError, shown
from poise.training.statistics.seeds import FIGURES

from .values import number

NUMBER, INTERVAL, EACH = "number", "interval", "each"  # EACH: of a mapping with any keys
BOTH = "both"  # ends of an interval, which INTERVAL may lack
OPTIONAL = (float, int, NoneType)
DIRECTION = {"direction": NUMBER, "eta": NUMBER}
LEVEL = {"level": str, "standard": bool, "recovered_rate": NUMBER}
PAIR = {"only_a": int, "only_b": int, "p_mcnemar": NUMBER}
MIX = {"recovered_rate": NUMBER, "recovered_ci95": INTERVAL}
ENTRY: dict[str, Any] = {
    "trials": int, "errors": int, "root_force_max": NUMBER, "j50_mean": NUMBER,
    "j50_mean_ci95": INTERVAL, "j50_bounded": int, "eta_mean": NUMBER, "eta_mean_ci95": INTERVAL,
    "eta_min": NUMBER, "directions": [DIRECTION], "tick_us": OPTIONAL,
    "factors": [{"factor": str, "standard": str, "levels": [LEVEL]}],
}  # fmt: skip
FORM: dict[str, Any] = {
    "suite": str, "seed": int, "robot": {"name": str}, "reference": str, "ranking": [str],
    "controllers": {EACH: ENTRY}, "pairs": [{"b": str}], "seeds": [{"name": str, "members": list}],
    "versions": dict, "machine": {"processor": str, "cores": int}, "commit": (str, NoneType),
}  # fmt: skip
RATE = {"trials": int, "recovered_rate": NUMBER, "recovered_ci95": BOTH}
RATES = [{"factor": str, "levels": [{"level": str, "standard": bool, **RATE}]}]
SEEDS = {"iqm": NUMBER, "iqm_ci95": BOTH, "worst": NUMBER, "worst_seed": int}


def check_compared(summary: Mapping[str, Any], path: Path) -> None:
    """Raise ConfigError, naming the field, where a benchmark's or an evaluation's summary lacks
    what a comparison of two needs."""
    for name, entry in summary["controllers"].items():
        field = f"controllers.{name}"
        _expect(entry, dict, path, field)
        parts: dict[str, Any] = {}
        if "benchmark" not in summary:
            _check(entry, RATE, path, field)
        else:
            parts["factors"] = RATES
            parts |= {"mix": RATE} if entry.get("mix") is not None else {}
        parts |= {"directions": [{"direction": NUMBER}]} if "directions" in entry else {}
        _check(entry, parts, path, field)


def check_form(summary: Mapping[str, Any], path: Path) -> None:
    """Raise ConfigError, naming the field, where the summary is not of the form."""
    _check(summary, FORM, path, "")
    entries = summary["controllers"]
    for field in ("ranking", "reference"):
        names = summary[field] if field == "ranking" else [summary[field]]
        if not names or not set(names) <= set(entries):
            raise ConfigError("must name its controllers", source=path, field=field)
    for i, pair in enumerate(summary["pairs"]):
        if pair.get("mix") is not None:
            _check(pair["mix"], PAIR, path, f"pairs[{i}].mix")
    for i, group in enumerate(summary["seeds"]):
        for key in (key for key, _, _ in FIGURES if key in group):
            _check(group[key], SEEDS, path, f"seeds[{i}].{key}")
    for name, entry in entries.items():
        if entry.get("mix") is not None:
            _check(entry["mix"], MIX, path, f"controllers.{name}.mix")
        if shape(entry) != shape(next(iter(entries.values()))):
            raise ConfigError("has other directions or levels than the first", source=path,
                              field=f"controllers.{name}")  # fmt: skip


def shape(entry: Mapping[str, Any]) -> tuple[int, list[int]]:
    """How many directions, and how many levels of each factor, a controller has."""
    return len(entry["directions"]), [len(factor["levels"]) for factor in entry["factors"]]


def _check(value: Any, form: Any, path: Path, field: str) -> None:
    if form in (NUMBER, INTERVAL, BOTH):
        ends = {field: value} if form == NUMBER else _ends(value, path, field)
        for name in ends:
            number(ends, name, str(path), needed=form != INTERVAL)
    elif isinstance(form, list):
        _expect(value, list, path, field)
        for i, each in enumerate(value):
            _check(each, form[0], path, f"{field}[{i}]")
    elif isinstance(form, dict):
        _expect(value, dict, path, field)
        for name in value if EACH in form else form:
            inner = f"{field}.{name}" if field else name
            if name not in value:
                raise ConfigError("is missing", source=path, field=inner)
            _check(value[name], form.get(EACH, form.get(name)), path, inner)
    else:
        _expect(value, form, path, field)


def _ends(value: Any, path: Path, field: str) -> dict[str, Any]:
    if not isinstance(value, list) or len(value) != 2:
        raise ConfigError(f"must be [low, high], not {shown(value)}", source=path, field=field)
    return {f"{field}[0]": value[0], f"{field}[1]": value[1]}


def _expect(value: Any, kinds: Any, path: Path, field: str) -> None:
    boolean = isinstance(value, bool)
    if boolean != (kinds is bool) or not isinstance(value, kinds):
        names = kinds if isinstance(kinds, tuple) else (kinds,)
        words = {str: "text", int: "a whole number", float: "a number", list: "a list",
                 bool: "true or false", dict: "a mapping", NoneType: "null"}  # fmt: skip
        expected = " or ".join(words[kind] for kind in names)
        raise ConfigError(f"must be {expected}, not {shown(value)}", source=path, field=field)
