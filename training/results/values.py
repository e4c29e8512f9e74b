"""Values of a summary.json, checked where they are used: anybody may have written it."""

import math
from collections.abc import Mapping
from typing import Any

from poise.configs.errors import ConfigError, shown


def number(entry: Mapping[str, Any], key: str, where: str, needed: bool = False) -> float | None:
    """A finite number of the summary, or None where it has none.

    Raises ConfigError for anything else, or where it is `needed` and missing.
    """
    value = entry.get(key)
    if value is None and not needed:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not _finite(value):
        raise ConfigError(f"must be a number, not {shown(value)}", source=where, field=key)
    return value


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond all floats
        return False


def numbers(entry: Mapping[str, Any], key: str, where: str) -> list[float]:
    """A list of finite numbers of the summary; raises ConfigError for anything else."""
    values = entry.get(key)
    if not isinstance(values, list):
        raise ConfigError(
            f"must be a list of numbers, not {shown(values)}", source=where, field=key
        )
    for value in values:
        number({key: value}, key, where, needed=True)
    return values


def interval(entry: Mapping[str, Any], key: str, where: str) -> tuple[float, float] | None:
    """[low, high] of the summary, or None where it has none; raises ConfigError for others."""
    value = entry.get(key)
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 2:
        raise ConfigError(f"must be [low, high], not {shown(value)}", source=where, field=key)
    if None in value:
        return None
    ends = {"low": value[0], "high": value[1]}
    low, high = (number(ends, end, f"{where}: {key}", needed=True) for end in ends)
    assert low is not None and high is not None
    return low, high
