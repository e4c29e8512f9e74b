"""Messages that many checks share, each written once; tests look at their names and facts."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from .errors import ConfigError, shown

#: name of a problem → its text, with the facts that it holds
TEXTS: Final[Mapping[str, str]] = MappingProxyType({
    "unknown field": "unknown field{hint}",
    "renamed": "is now {name}",
    "missing": "this field is missing",
    "unknown kind": "no such kind: {value}",
    "unknown value": "unknown value {value}",
    "unknown name": "no such name: {value}{hint} give a path to a .yaml file or a packaged name",
    "no file": "no such file: {value}{hint} give a path to a .yaml file or a packaged name",
    "folder": "is a folder: {value}; give a path to a .yaml file or a packaged name",
    "unreadable": "cannot be read ({why})",
    "type": "must be {expected}, not {value}",
    "range": "must be {limits}, not {value}",
    "choice": "must be one of {valid}, not {value}",
    "unknown command": "no such command: {value}{hint}",
    "unknown option": "no such option{hint}",
    "unknown argument": "takes no {value}: see {prog} --help",
    "needs": "needs {what}",
    "no value": "needs {count} behind it",
    "unknown controller": "no such controller: {value}{hint} give a name, a .yaml file of a "
    "controller, a folder written by poise train, an ONNX file or a folder with a deploy.yaml, or "
    "module:Class",
    "unknown policy": "no such policy: {value}{hint} give a packaged one or a folder written by "
    "poise train",
})  # fmt: skip


class Problem(ConfigError):
    """A ConfigError with one of the shared messages.

    Attributes:
        problem: its name, a key of `TEXTS`.
        facts: what the message holds.
    """

    def __init__(
        self,
        problem: str,
        source: str | Path | None = None,
        field: str | None = None,
        choices: Iterable[object] | None = None,
        **facts: Any,
    ) -> None:
        self.problem, self.facts = problem, facts
        text = TEXTS[problem].format_map(facts)
        super().__init__(text, source=source, field=field, choices=choices)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (self.problem, self.source, self.field, self.choices, self.facts)


def _again(problem: str, source: Any, field: Any, choices: Any, facts: dict[str, Any]) -> Problem:
    return Problem(problem, source, field, choices, **facts)


def out_of_range(
    value: Any,
    field: str | None,
    source: str | Path | None = None,
    *,
    least: float | None = None,
    above: float | None = None,
    most: float | None = None,
    form: str = "",
) -> Problem:
    """Return the error of a number that is not within its bounds; `least` and `most` are valid.

    `form` is the format of the value; without one it is as in Python.
    """
    bounds = {"least": least, "above": above, "most": most}
    facts: dict[str, Any] = {name: bound for name, bound in bounds.items() if bound is not None}
    words = {"least": "at least", "above": "above", "most": "at most"}
    limits = " and ".join(f"{words[name]} {bound}" for name, bound in facts.items())
    if least is not None and most is not None:
        limits = f"from {least} to {most}"
    text = f"{value:{form}}" if form else shown(value)
    return Problem("range", source, field, limits=limits, value=text, **facts)
