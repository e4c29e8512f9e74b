"""An extension of griffe: docstrings that Poise makes when it is imported, as they are then.

The environments' tables are made of their terms (`poise.envs.balance.mdp.docstrings`); the source
has marks in their place, such as <observation>.
"""

from __future__ import annotations

import importlib
import inspect
import re
from typing import Any

import griffe

MARK = re.compile(r"<(observation|rewards|start|arguments)>")


class GeneratedDocstrings(griffe.Extension):
    """Reads the docstring of a class from the class itself where the source has a mark."""

    def on_class_instance(self, *, cls: griffe.Class, **_: Any) -> None:
        """Called for each class that griffe has found in a source."""
        if cls.docstring and MARK.search(cls.docstring.value):
            module, _, name = cls.path.rpartition(".")
            found = getattr(importlib.import_module(module), name)
            cls.docstring.value = inspect.getdoc(found) or ""
