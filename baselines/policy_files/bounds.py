"""Bounds of actions and terms as other projects write them, as the pairs that Poise reads."""

from typing import Any


def with_pairs(said: dict[str, Any]) -> dict[str, Any]:
    """Return what a description says, with bounds as pairs.

    A number b stands for [−b, b], of actions and of terms; of actions ``[-100, 100]`` is one pair,
    which bounds them all. What is neither is left as it is, for the checks of the fields.
    """
    if "action_clip" in said:
        said = {**said, "action_clip": pairs(said["action_clip"])}
    terms = said.get("observations")
    if isinstance(terms, dict):
        return {**said, "observations": {name: _clipped(each) for name, each in terms.items()}}
    return {**said, "observations": _clipped(terms)} if terms is not None else said


def pairs(bounds: Any) -> Any:
    """Return bounds of actions as a list of pairs."""
    one = isinstance(bounds, (list, tuple)) and len(bounds) == 2 and all(map(_is_number, bounds))
    return [pair(bounds)] if one or _is_number(bounds) else bounds


def pair(bounds: Any) -> Any:
    """Return the least and the largest value, where one number bounds both."""
    return [-abs(bounds), abs(bounds)] if _is_number(bounds) else bounds


def _clipped(terms: Any) -> Any:
    """Terms, and those of their frames, whose bounds are pairs."""
    if isinstance(terms, (list, tuple)):
        return [_clipped(each) for each in terms]
    if not isinstance(terms, dict):
        return terms
    bounds = {"clip": pair(terms["clip"])} if "clip" in terms else {}
    inner = {"frame": _clipped(terms["frame"])} if "frame" in terms else {}
    return {**terms, **bounds, **inner}


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
