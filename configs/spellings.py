"""Older names of public fields and columns, which are read for one release with one warning."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .errors import PoiseWarning


def respelled(data: Any, names: Mapping[str, str], source: str | Path, free: str = "") -> Any:
    """Return plain data whose mappings have the present names; warn once of those that are older.

    Args:
        data: as a file holds it.
        names: older name → present name, of keys at any depth.
        source: the file, for the warning.
        free: key of a mapping whose own keys are a user's names, and stay.
    """
    found: dict[str, str] = {}
    data = _respelled(data, names, free, found, False)
    if found:
        said = ", ".join(f"{old!r} is now {new!r}" for old, new in found.items())
        warnings.warn(f"{source}: older names are read for one release: {said}", PoiseWarning,
                      stacklevel=3)  # fmt: skip
    return data


def _respelled(
    data: Any, names: Mapping[str, str], free: str, found: dict[str, str], kept: bool
) -> Any:
    if isinstance(data, list):
        return [_respelled(each, names, free, found, False) for each in data]
    if not isinstance(data, dict):
        return data
    old = set() if kept else {key for key in data if key in names and names[key] not in data}
    found |= {key: names[key] for key in data if key in old}
    return {
        names[key] if key in old else key: _respelled(each, names, free, found, key == free)
        for key, each in data.items()
    }
