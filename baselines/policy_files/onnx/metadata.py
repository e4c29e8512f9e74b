"""The metadata that mjlab and holosoma write into the ONNX files that they export."""

import math
import sys
from pathlib import Path

from poise.configs.errors import ConfigError
from poise.configs.reading import parse_json

#: terms that mjlab's tasks call by the name of another one: there they are relative
RELATIVE = {"joint_pos": "joint_pos_rel", "joint_vel": "joint_vel"}
NAMES = ("joint_names", "dof_names")  # mjlab's, holosoma's
NUMBERS = {"joint_stiffness": "stiffness", "joint_damping": "damping", "kp": "stiffness",
           "kd": "damping", "default_joint_pos": "default", "default_dof_pos": "default",
           "default_joint_angles": "default", "action_scale": "action_scale"}  # fmt: skip


def metadata_fields(metadata: dict[str, str], source: Path) -> dict[str, object]:
    """Fields of a `PolicyFileConfig` from the metadata of an ONNX file; none where it has none.

    Lists have commas between their entries (mjlab) or are JSON (holosoma).

    Raises ConfigError for numbers that are none, histories that are no numbers of steps, and lists
    of different lengths.
    """
    fields: dict[str, object] = {}
    for key in NAMES:
        if key in metadata:
            fields["joints"] = tuple(map(str, _entries(metadata[key], key, source)))
    for key, name in NUMBERS.items():
        if key in metadata:
            numbers = _floats(_entries(metadata[key], key, source), key, source)
            fields[name] = numbers[0] if len(numbers) == 1 else numbers
    if "observation_names" in metadata:
        fields["observations"] = _terms(metadata, source)
    if "anchor_body_name" in metadata:
        fields["motion"] = {"anchor": metadata["anchor_body_name"], "clip": "network"}
    return fields


def _entries(text: str, field: str, source: Path) -> list[object]:
    """The entries of a list, the only one where it is none."""
    if not text.lstrip().startswith("["):
        return [each.strip() for each in text.split(",")]
    try:
        return list(parse_json(text.replace("'", '"')))  # as Python writes a list of names
    except ValueError as error:
        raise ConfigError(f"is no list in JSON: {error}", source=source, field=field) from None


def _terms(metadata: dict[str, str], source: Path) -> list[dict[str, object]]:
    names = list(map(str, _entries(metadata["observation_names"], "observation_names", source)))
    # what tracks a motion is commanded that motion
    tracking = "anchor_body_name" in metadata or any(map(_is_anchor, names))
    renamed = {**RELATIVE, "command": "motion_command"} if tracking else RELATIVE
    terms: list[dict[str, object]] = [{"term": renamed.get(name, name)} for name in names]
    for key, name in (("scale", "scale"), ("history_length", "history"), ("clip", "clip")):
        whole = f"observation_terms_{key}"
        if whole not in metadata:
            continue
        entries = metadata[whole].split(",")
        if len(entries) != len(names):
            raise ConfigError(f"has {len(entries)} entries for {len(names)} observations",
                              source=source, field=whole)  # fmt: skip
        for term, entry in zip(terms, entries, strict=True):
            values = _floats(entry.split(";"), whole, source)
            if name == "history":
                term[name] = _steps(values, whole, source)
            elif name == "clip":
                term[name] = _bounds(values, whole, source)
            else:
                term[name] = values[0] if len(values) == 1 else values
    return terms


def _is_anchor(name: str) -> bool:
    return name.startswith(("motion_anchor", "motion_ref"))


def _steps(values: tuple[float, ...], field: str, source: Path) -> int:
    """Policy steps of a history; 0 is a term without one, which shows this step alone."""
    if len(values) != 1 or not values[0].is_integer() or values[0] < 0.0:
        raise ConfigError(f"must be a whole number of steps, not {';'.join(map(str, values))}",
                          source=source, field=field)  # fmt: skip
    return max(1, int(values[0]))


def _bounds(values: tuple[float, ...], field: str, source: Path) -> tuple[float, float] | None:
    """Least and largest value, both finite; None where they bound nothing."""
    if len(values) != 2:
        raise ConfigError(f"must be two numbers, not {len(values)}", source=source, field=field)
    low, high = values
    if (low, high) == (-math.inf, math.inf):
        return None
    farthest = sys.float_info.max
    return (-farthest if low == -math.inf else low, farthest if high == math.inf else high)


def _floats(entries: list[object] | list[str], field: str, source: Path) -> tuple[float, ...]:
    try:
        return tuple(float(entry) for entry in entries)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise ConfigError(f"must be numbers, not {str(entries)[:60]}", source=source,
                          field=field) from None  # fmt: skip
