"""Options of a command or a configuration, described by docstrings."""

import dataclasses
import inspect
import re
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from poise.configs.kinds import OfKind

ENTRY = re.compile(r"\s{4}(\w+): (.+)")  # of `Attributes:` or `Args:`, one level below it
SECTION = re.compile(r"(?:Attributes|Args):\n(.*?)(?:\n\n|\Z)", re.DOTALL)
WIDE = 50  # characters of names from which their list may break into lines
BOUNDS = {"min": "at least", "above": "above", "max": "at most"}
KINDS = {int: "N", float: "NUMBER", str: "NAME"}


@dataclass(frozen=True)
class Option:
    """An option of a command.

    Attributes:
        name: with its dashes; of a positional argument what stands for it, without any.
        kind: form of its value; empty for a switch and a positional argument.
        sentence: meaning, with unit.
        default: default value as text; empty without one.
        bounds: valid range of a number as text; empty without one.
        required: whether a command does not run without it.
        switch: whether it takes no value; with both forms, ``--x`` and ``--no-x``, or the first.
    """

    name: str
    kind: str
    sentence: str
    default: str
    bounds: str = ""
    required: bool = False
    switch: Literal["", "one", "both"] = ""

    @property
    def heading(self) -> str:
        """The option as a user writes it."""
        if self.switch == "both":
            before, _, last = self.name.rpartition(".")
            no = f"{before}.no-{last}" if before else f"--no-{self.name[2:]}"
            return f"{self.name}, {no}"
        return f"{self.name} {self.kind}".rstrip()

    @property
    def group(self) -> str:
        """The section of the configuration; empty at the top level."""
        return self.name[2:].rpartition(".")[0]


def entries(docstring: str | None) -> dict[str, str]:
    """Return the entries of a docstring's section `Attributes` or `Args`, each on one line."""
    found = SECTION.search(inspect.cleandoc(docstring or ""))
    texts: dict[str, str] = {}
    for line in found[1].split("\n") if found else ():
        if entry := ENTRY.fullmatch(line):
            texts[name := entry[1]] = entry[2]
        elif texts:
            texts[name] += f" {line.strip()}"
    return texts


def sentences(cls: type) -> dict[str, str]:
    """Return the descriptions of a dataclass's fields from its docstring and those of its bases.

    A weight of the reward is described by the formula in its field's metadata.
    """
    texts: dict[str, str] = {}
    for each in reversed(cls.__mro__):
        texts |= entries(each.__dict__.get("__doc__"))
    if issubclass(cls, OfKind):
        texts.setdefault("kind", "The kind; choose another one in a file.")
    for field in dataclasses.fields(cls):
        if "formula" in field.metadata:
            texts[field.name] = f"Weight of the term {field.metadata['formula']}."
    return {name: _sentence(text.replace("None: ", "not given: ")) for name, text in texts.items()}


def _sentence(text: str) -> str:
    text = text[0].upper() + text[1:]
    return text if text.endswith(".") else f"{text}."


def arguments_of(function: Callable[..., object]) -> list[Option]:
    """Return the arguments of a command, by its signature and the entries of its docstring.

    What several commands share is described by its type: help and metavar of `tyro.conf.arg`.
    """
    texts, hints = entries(inspect.getdoc(function)), get_type_hints(function, include_extras=True)
    return [
        _argument(parameter, hints[name], texts.get(name, ""))
        for name, parameter in inspect.signature(function).parameters.items()
    ]


def _argument(parameter: inspect.Parameter, hint: Any, text: str) -> Option:
    marks: tuple[Any, ...] = ()
    if get_origin(hint) is Annotated:
        hint, *found = get_args(hint)
        marks = tuple(found)
    text = text or next((each.help for each in marks if getattr(each, "help", None)), "")
    kind = next((each.metavar for each in marks if getattr(each, "metavar", None)), kind_of(hint))
    required = parameter.default is inspect.Parameter.empty
    default = "" if required else _text(parameter.default)
    if parameter.kind is parameter.POSITIONAL_ONLY:
        return Option(kind, "", _sentence(text), default, required=required)
    own = next((each.name for each in marks if getattr(each, "name", None)), parameter.name)
    name = f"--{own.replace('_', '-')}"
    if hint is not bool:
        return Option(name, kind, _sentence(text), default, required=required)
    one = tyro.conf.FlagCreatePairsOff in marks
    return Option(
        name, "", _sentence(text), "" if one else default, switch="one" if one else "both"
    )


def options_of(config: Any, prefix: str = "--") -> Iterator[Option]:
    """Yield the options of a dataclass, first its own fields, then those of nested dataclasses.

    A nested dataclass that is None, or one of several, has no options: only a file can set it.

    Args:
        config: an instance, whose values are the defaults.
        prefix: of the options' names.
    """
    texts, hints = sentences(type(config)), get_type_hints(type(config))
    below = []
    for field in dataclasses.fields(config):
        value, name = getattr(config, field.name), prefix + field.name.replace("_", "-")
        if dataclasses.is_dataclass(value):
            below.append((value, f"{name}."))
        elif isinstance(value, Mapping) and value:
            sentence = texts.get(field.name, "")
            for key, each in value.items():
                yield Option(f"{name}.{key}", "NUMBER", sentence, _text(each), _bounds(field))
        elif not any(map(dataclasses.is_dataclass, get_args(hints[field.name]))):
            switch = hints[field.name] is bool
            yield Option(name, "" if switch else kind_of(hints[field.name]),
                         texts.get(field.name, ""), _text(value), _bounds(field),
                         switch="both" if switch else "")  # fmt: skip
    for value, deeper in below:
        yield from options_of(value, deeper)


def kind_of(hint: Any) -> str:
    """Return the form of a value of this type on the command line."""
    origin, args = get_origin(hint), get_args(hint)
    if origin is Literal:
        names = [str(arg) for arg in args]
        return "|".join(names) if sum(map(len, names)) < WIDE else " | ".join(names)
    if origin in (Union, types.UnionType):
        return "|".join(kind_of(arg) for arg in args if arg is not type(None))
    if origin is tuple:
        return f"{kind_of(args[0])} …" if args[-1] is Ellipsis else " ".join(map(kind_of, args))
    if origin is dict:
        return "NAME NUMBER …"
    return "" if hint is bool else KINDS.get(hint, "PATH")


def _text(value: Any) -> str:
    """Return a default as text, empty where none is set: the sentence says what holds then."""
    if value is None or value == () or value == {}:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _bounds(field: dataclasses.Field[Any]) -> str:
    return ", ".join(f"{BOUNDS[key]} {field.metadata[key]:,}"
                     for key in BOUNDS if key in field.metadata)  # fmt: skip
