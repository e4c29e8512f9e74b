"""Public names of a package that are imported when they are first asked for (PEP 562)."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any


def lazy(
    package: str, modules: Mapping[str, Sequence[str]]
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` for a package whose public names stand in its modules.

    `modules` maps a module, relative to the package, to its names, as an import writes them:
    ``name``, or ``name as other``. The names of the empty module are subpackages.
    """
    places = {
        line.split()[-1]: (module, line.split()[0])
        for module, lines in modules.items()
        for line in lines
    }

    def find(name: str) -> Any:
        itself = sys.modules[package]
        if name not in places:
            message = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(message, name=name, obj=itself)
        module, own = places[name]
        if not module:
            return import_module(f"{package}.{own}")
        value = getattr(import_module(f"{package}.{module}"), own)
        setattr(itself, name, value)  # the next lookup does without this function
        return value

    def names() -> list[str]:
        return sorted({*vars(sys.modules[package]), *places})

    return find, names
