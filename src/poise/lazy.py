"""Public names of a package that are imported when they are first asked for (PEP 562)."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` for a package in whose `file` a block imports the public names.

    The block is that of ``if TYPE_CHECKING:``, which Python does not run: it is read here, so that
    editors, type checkers and users get every name from the same line.
    """

    @cache
    def places() -> dict[str, tuple[str, str]]:
        """Public name → its module, and its name there."""
        body = ast.parse(Path(file).read_bytes()).body
        blocks = [node for node in body if isinstance(node, ast.If)]
        (block,) = (node for node in blocks if ast.unparse(node.test) == "TYPE_CHECKING")
        imports = [node for node in block.body if isinstance(node, ast.ImportFrom)]
        return {
            alias.asname or alias.name: (str(node.module), alias.name)
            for node in imports
            for alias in node.names
        }

    def find(name: str) -> Any:
        itself = sys.modules[package]
        if name not in places():
            message = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(message, name=name, obj=itself)
        module, own = places()[name]
        if module == package:  # a package in it
            return import_module(f"{package}.{own}")
        value = getattr(import_module(module), own)
        setattr(itself, name, value)  # the next lookup does without this function
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *places()})

    return find, names
