"""All kinds of cases."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from hypothesis.strategies import SearchStrategy

from .values import Json

NAMES = ("yaml_files", "robots", "resets", "pushes", "actions", "constructors", "policies",
         "results", "commands", "motions", "networks", "urdfs")  # fmt: skip


@dataclass(frozen=True)
class Kind:
    """One kind of input.

    Attributes:
        name: its module.
        cases: draws what is given, as plain JSON.
        play: hands it over, with an empty folder to work in, which is the current one. Raises
            what Poise raises, AssertionError where the outcome is not what it should be.
    """

    name: str
    cases: SearchStrategy[Json]
    play: Callable[[Json, Path], None]


@cache
def kind(name: str) -> Kind:
    """A kind by its name; loads what it needs."""
    module = importlib.import_module(f"{__package__}.{name}")
    return Kind(name, module.cases(), module.play)
