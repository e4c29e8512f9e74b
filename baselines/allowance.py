"""The code that may run: what the user has named, never what a file has.

Files that are read (policies, results, configurations) may name an external class, and to find
it is to run its module. `find_plugin`, the one function that imports what has been named, asks
`check_allowed` first. Nothing is allowed to begin with; a scope is opened with

- what the user types as a controller, or hands to an environment (`named`), and
- what the user also allows: ``--allow`` of a command, ``allow=`` in Python.

A scope ends with its block, in its thread; processes are sent it with their work
(`carrying_allowance`).
"""

import functools
import inspect
import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path
from typing import ParamSpec, TypeGuard, TypeVar

from poise.configs.errors import ConfigError
from poise.configs.reading import whole_path
from poise.configs.schema import read_yaml

#: a module has no spaces, the path of a file may
NAME = re.compile(r"(?P<place>[^:\s]+|[^:]+\.py):(?P<name>[A-Za-z_]\w*)")
SCRIPTS = (".pt", ".pth", ".jit", ".ts")  # of files of TorchScript, which is code
P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Allowance:
    """The code that may run: `names` as of `_key`; `source`, the file being read, for errors."""

    names: frozenset[str] = frozenset()
    source: str | None = None


NOTHING = Allowance()
_current: ContextVar[Allowance] = ContextVar("allowance", default=NOTHING)
_asked: ContextVar[list[str] | None] = ContextVar("asked", default=None)


def is_plugin(name: object) -> TypeGuard[str]:
    """Return whether a name has the form ``module:Class``."""
    return isinstance(name, str) and name.isprintable() and NAME.fullmatch(name) is not None


def is_script(name: str | Path) -> bool:
    """Return whether a file of this name is TorchScript."""
    return Path(name).suffix in SCRIPTS and str(name).isprintable()


def check_allowed(name: str) -> None:
    """Raise ConfigError, which says how to allow it, unless the user has named it.

    That is ``module:Class``, or a file of TorchScript.
    """
    allowance, asked = _current.get(), _asked.get()
    if asked is not None and name not in asked:
        asked.append(name)
    if _key(name, allowance.source, "controller") not in allowance.names:
        raise ConfigError(
            f"runs external code, {name!r}: if you trust it, allow it by --allow "
            f"{shlex.quote(name)}, or poise.allowing({name!r}) in Python",
            source=allowance.source, field="controller",
        )  # fmt: skip


def listed(names: str | Iterable[str]) -> list[str]:
    """What an argument `allow` holds, one name or several."""
    return [names] if isinstance(names, str) else list(names)


@contextmanager
def allowing(names: str | Iterable[str] = (), source: str | Path | None = None) -> Iterator[None]:
    """Context in which these classes may also run.

    Args:
        names: ``module:Class``, ``file.py:Class``, or a file of TorchScript; a file is the same by
            any path to it.
        source: the file that is read inside, which errors then name.

    Raises:
        ConfigError: a name of another form, or that of a file that links lead to in a circle.
    """
    names = listed(names)
    for name in names:
        if not is_plugin(name) and not is_script(name):
            raise ConfigError(
                f"{name!r} is not of the form module:Class or file.py:Class, nor a file of "
                f"TorchScript ({', '.join(SCRIPTS)})",
                field="allow",
            )
    keys = frozenset(_key(name, None, "allow") for name in names)
    with _opened(keys, None if source is None else str(source)):
        yield


def allows(*handed: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Makes a function run with what its argument `allow` allows, and what `handed` ones name."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def inside(*args: P.args, **kwargs: P.kwargs) -> R:
            given = signature.bind(*args, **kwargs)
            given.apply_defaults()
            values = given.arguments
            with allowing(values["allow"]), allowing(named(*(values[key] for key in handed))):
                return function(*args, **kwargs)

        return inside

    return decorate


def named(*controllers: object) -> list[str]:
    """Names of external classes among what a user has typed or handed over as controllers.

    That is ``module:Class``, and what a mapping or a file of ``kind: outside`` names: the mapping
    or the file itself, not what its `base` says. Of a list, its members are looked at.
    """
    found: list[str] = []
    for controller in controllers:
        if isinstance(controller, (list, tuple)):
            found += named(*controller)
            continue
        if isinstance(controller, (str, Path)) and not is_plugin(controller):
            is_yaml = Path(controller).suffix in (".yaml", ".yml") and os.path.isfile(controller)
            controller = read_yaml(Path(controller)) if is_yaml else None
        if isinstance(controller, Mapping):
            kind = controller.get("kind")  # anything that a user has handed over
            outside = isinstance(kind, str) and kind == "outside"
            controller = controller.get("name") if outside else None
        if is_plugin(controller):
            found.append(controller)
    return found


@contextmanager
def noting() -> Iterator[list[str]]:
    """Yield the names that are asked of `check_allowed` inside, allowed or refused; a context."""
    asked: list[str] = []
    token = _asked.set(asked)
    try:
        yield asked
    finally:
        _asked.reset(token)


def allow_words(names: Iterable[str]) -> list[str]:
    """Return the words of ``--allow`` by which a printed command allows these names."""
    return [word for name in names for word in ("--allow", name)]


def carrying_allowance(function: Callable[P, R]) -> Callable[P, R]:
    """The function, taking what is allowed here to wherever it is called; it can be pickled."""
    return functools.partial(_inside, _current.get(), function)


def _inside(
    allowance: Allowance, function: Callable[P, R], /, *arguments: P.args, **options: P.kwargs
) -> R:
    with _opened(allowance.names, allowance.source):
        return function(*arguments, **options)


@contextmanager
def _opened(names: frozenset[str], source: str | None) -> Iterator[None]:
    before = _current.get()
    token = _current.set(Allowance(before.names | names, source or before.source))
    try:
        yield
    finally:
        _current.reset(token)


def _key(name: str, source: str | None, field: str) -> str:
    """Return what a name stands for: a file by its whole path, links followed."""
    if is_script(name):
        return str(whole_path(name, source, field))
    place, _, attribute = name.rpartition(":")
    if not place.endswith(".py"):
        return name
    return f"{whole_path(place, source, field)}:{attribute}"
