"""What a kernel is compiled from: its file, and all files of these packages that it imports.

A kernel calls functions of other files, which are compiled into it, and reads constants of others.
It knows them as globals of its module, so they come in by imports at the top of its file, or of one
imported there. Kernels called by address are compiled apart, from files of their own; of a block a
kernel's signature says all. How both are compiled is defined in this package, which all share.
"""

import hashlib
import os
import re
from functools import cache

_ROOM = os.path.dirname(os.path.realpath(__file__))
_HOUSE = os.path.dirname(os.path.dirname(_ROOM))
_PACKAGES = ("envs", "baselines")  # kernels are compiled from no other's files
_IMPORT = re.compile(
    r"^(?:from|import) +(\.+|poise\.)([\w.]*)(?: +import +(\([^)]*\)|.*))?", re.MULTILINE
)


@cache
def source_digest(file: str) -> str:
    """A digest of a file and of what it imports, at first hand or through others.

    Each file is read once in a process.
    """
    room = [os.path.join(_ROOM, name) for name in os.listdir(_ROOM) if name.endswith(".py")]
    digests = (f"{path} {_read(path)[0]}" for path in sorted({*room, *imported(file)}))
    return hashlib.sha256("\n".join(digests).encode()).hexdigest()


def imported(file: str) -> set[str]:
    """The file itself, and the files of these packages that it imports."""
    seen, ahead = {file}, [file]
    while ahead:
        new = _read(ahead.pop())[1] - seen
        seen |= new
        ahead += new
    return seen


@cache
def _read(file: str) -> tuple[str, frozenset[str]]:
    """The digest of one file, and what it imports itself at its top level."""
    with open(file, "rb") as opened:
        text = opened.read()
    found: set[str | None] = set()
    for above, module, names in _IMPORT.findall(text.decode()):
        place = _place(file, above, module.split(".") if module else [])
        if place is not None:
            found |= _sources(place, names)
    return hashlib.sha256(text).hexdigest(), frozenset(path for path in found if path)


def _place(file: str, above: str, parts: list[str]) -> str | None:
    """Where an import leads, without the suffix; None: to another package than these."""
    if above == "poise.":
        return os.path.join(_HOUSE, *parts) if parts[0] in _PACKAGES else None
    place = os.path.normpath(os.path.join(file, *[".."] * len(above), *parts))
    return place if place.startswith(_HOUSE + os.sep) else None


def _sources(place: str, names: str) -> set[str | None]:
    """The file of a module; or that of a package, and of its modules among `names`."""
    module = _existing(f"{place}.py")
    if module:
        return {module}
    parts = (_existing(os.path.join(place, f"{name}.py")) for name in re.findall(r"\w+", names))
    return {_existing(os.path.join(place, "__init__.py")), *parts}


@cache
def _existing(path: str) -> str | None:
    return path if os.path.isfile(path) else None
