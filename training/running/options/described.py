"""What each option of a configuration means: its sentence is that of its field's docstring."""

import dataclasses
import inspect
import re
import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from poise.configs.kinds import OfKind

ENTRY = re.compile(r"\s{4}(\w+): (.+)")  # of `Attributes:` or `Args:`, one level below it
SECTION = re.compile(r"(?:Attributes|Args):\n(.*?)(?:\n\n|\Z)", re.DOTALL)
BOUNDS = {"min": "at least", "above": "above", "max": "at most"}
KINDS = {int: "INT", float: "NUMBER", str: "NAME"}


@dataclass(frozen=True)
class Option:
    """An option of a command.

    Attributes:
        name: as it is typed, with its dashes.
        kind: what is typed after it.
        sentence: what it means, with its unit.
        default: what holds without it, as text; empty where nothing does.
        bounds: what a number must be, as text; empty where any will do.
    """

    name: str
    kind: str
    sentence: str
    default: str
    bounds: str = ""

    @property
    def group(self) -> str:
        """The section of the configuration that it belongs to; empty for the top."""
        return self.name[2:].rpartition(".")[0]


def entries(docstring: str | None) -> dict[str, str]:
    """The entries of the section `Attributes` or `Args` of a docstring, each on one line."""
    found = SECTION.search(inspect.cleandoc(docstring or ""))
    told: dict[str, str] = {}
    for line in found[1].split("\n") if found else ():
        if entry := ENTRY.fullmatch(line):
            told[name := entry[1]] = entry[2]
        elif told:
            told[name] += f" {line.strip()}"
    return told


def sentences(cls: type) -> dict[str, str]:
    """What the docstrings of a dataclass and of its bases say of its fields.

    A weight of the reward is told by the formula in its field's metadata.
    """
    told: dict[str, str] = {}
    for each in reversed(cls.__mro__):
        told |= entries(each.__dict__.get("__doc__"))
    if issubclass(cls, OfKind):
        told.setdefault("kind", "Which kind it is; another one is chosen in a file.")
    for field in dataclasses.fields(cls):
        if "formula" in field.metadata:
            told[field.name] = f"Weight of the term {field.metadata['formula']}."
    return {name: _sentence(text) for name, text in told.items()}


def _sentence(text: str) -> str:
    text = text[0].upper() + text[1:]
    return text if text.endswith(".") else f"{text}."


def options_of(config: Any, prefix: str = "--") -> Iterator[Option]:
    """The options of a dataclass, those of the dataclasses in it after its own fields.

    A dataclass that is not there has none: a file alone can bring it.

    Args:
        config: an instance, whose values are the defaults.
        prefix: of their names.
    """
    told, hints = sentences(type(config)), get_type_hints(type(config))
    below = []
    for field in dataclasses.fields(config):
        value, name = getattr(config, field.name), prefix + field.name.replace("_", "-")
        if dataclasses.is_dataclass(value):
            below.append((value, f"{name}."))
        elif isinstance(value, Mapping) and value:
            sentence = told.get(field.name, "")
            for key, each in value.items():
                yield Option(f"{name}.{key}", "NUMBER", sentence, _text(each), _bounds(field))
        elif value is not None or not any(
            map(dataclasses.is_dataclass, get_args(hints[field.name]))
        ):
            yield Option(name, kind_of(hints[field.name]), told.get(field.name, ""), _text(value),
                         _bounds(field))  # fmt: skip
    for value, deeper in below:
        yield from options_of(value, deeper)


def kind_of(hint: Any) -> str:
    """What is typed for a value of this type."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Literal:
        return "|".join(str(arg) for arg in args)
    if origin in (Union, types.UnionType):
        return "|".join(kind_of(arg) for arg in args if arg is not type(None))
    if origin is tuple:
        return f"{kind_of(args[0])} …" if args[-1] is Ellipsis else " ".join(map(kind_of, args))
    if origin is dict:
        return "NAME NUMBER …"
    return "yes|no" if hint is bool else KINDS.get(hint, "PATH")


def _text(value: Any) -> str:
    if value is None or value == () or value == {}:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _bounds(field: dataclasses.Field[Any]) -> str:
    return ", ".join(f"{BOUNDS[key]} {field.metadata[key]:,}"
                     for key in BOUNDS if key in field.metadata)  # fmt: skip
