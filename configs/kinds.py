"""Configurations distinguished by their `kind`, each kind in a file of its own."""

import importlib
import pkgutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar


class OfKind:
    """Base of dataclasses that a file chooses by `kind`, a field with a default.

    A field of the base's type takes any of them. Those in the package `room` are found without
    being listed anywhere; those from elsewhere count once they are imported.
    """

    room: ClassVar[str] = ""

    @classmethod
    def kinds(cls) -> dict[str, type]:
        """`kind` → class, of everything below this class; a subclass hides no class of its kind."""
        if cls.room:
            for module in pkgutil.iter_modules(importlib.import_module(cls.room).__path__):
                importlib.import_module(f"{cls.room}.{module.name}")
        found: dict[str, type] = {}
        for each in _below(cls):
            found.setdefault(kind_of(each), each)
        return {kind: each for kind, each in sorted(found.items()) if kind}


def kind_of(cls: Any) -> str:
    """Return what `kind` says in the files of a dataclass; empty where it has no such field."""
    own = [field for field in fields(cls) if field.name == "kind"] if is_dataclass(cls) else []
    return str(own[0].default) if own else ""


def _below(cls: type) -> Iterator[type]:
    each: type
    for each in cls.__subclasses__():
        yield each
        yield from _below(each)
