"""An extension of griffe: docstrings that Poise makes when it is imported, and what `#:` says.

The environments' tables are made of their terms (`poise.envs.balance.mdp.docstrings`); the source
has marks in their place, such as <observation>.
"""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path
from typing import Any

import griffe

MARK = re.compile(r"<(observation|rewards|start|arguments)>")


class GeneratedDocstrings(griffe.Extension):
    """Reads the docstring of a class from the class itself where the source has a mark.

    A field without a docstring has what `#:` says above it, or at the end of its line.
    """

    def on_class_instance(self, *, cls: griffe.Class, **_: Any) -> None:
        """Called for each class that griffe has found in a source."""
        if cls.docstring and MARK.search(cls.docstring.value):
            module, _, name = cls.path.rpartition(".")
            found = getattr(importlib.import_module(module), name)
            cls.docstring.value = inspect.getdoc(found) or ""

    def on_attribute_instance(self, *, attr: griffe.Attribute, **_: Any) -> None:
        """Called for each attribute that griffe has found in a source."""
        if attr.docstring or attr.lineno is None or attr.endlineno is None:
            return
        lines = Path(str(attr.filepath)).read_text("utf-8").splitlines()
        said = [lines[attr.endlineno - 1].partition("#:")[2]]
        above = attr.lineno - 2
        while not said[0] and above >= 0 and lines[above].lstrip().startswith("#:"):
            said.insert(1, lines[above].partition("#:")[2])
            above -= 1
        if text := " ".join(part.strip() for part in said if part):
            attr.docstring = griffe.Docstring(text, lineno=attr.lineno, parent=attr)
