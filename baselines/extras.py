"""What extras add to the core, by entry points of the groups ``poise.*`` (see pyproject.toml).

The core imports nothing of `poise[motion]`: neither `baselines/motion` nor `training/motion`.
"""

import re
from functools import cache
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, entry_points
from typing import Any

from poise.configs.errors import ConfigError

MOTION = "motion"  # the extra
#: name of a requirement in the metadata of a package, and the extra that asks for it
REQUIRED = re.compile(r"""([\w.-]+)[^;]*;.*\bextra\s*==\s*["']([\w.-]+)["']""")


class MissingExtra(ConfigError):
    """Something needs an extra that is not installed.

    Attributes:
        extra: its name, such as ``motion``.
    """

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f"needs poise[{extra}]: pip install 'poise[{extra}]'", source=what)
        self.extra = extra

    def __reduce__(self) -> tuple[type, tuple[str | None, str]]:
        return type(self), (self.source, self.extra)  # a worker's error is its command's, too


@cache
def registered(group: str) -> dict[str, EntryPoint]:
    """Return name → entry point of the group ``poise.{group}``, whether or not it can be loaded."""
    return {each.name: each for each in entry_points(group=f"poise.{group}")}


def missing_extra(group: str, name: str) -> str | None:
    """Return the extra that `name` of a group needs and that is not installed; None if it is."""
    entry = registered(group).get(name)
    if entry is None:
        return MOTION
    return next((extra for extra in entry.extras if not _is_installed(entry, extra)), None)


def load_extra(group: str, name: str, what: str = "") -> Any:
    """Return the object that is registered as `name` in the group ``poise.{group}``.

    Raises:
        MissingExtra: the extra that adds it is not installed; `what` needs it, or else `name`.
    """
    if (extra := missing_extra(group, name)) is not None:
        raise MissingExtra(what or name, extra)
    return registered(group)[name].load()


def _is_installed(entry: EntryPoint, extra: str) -> bool:
    """Return whether all packages are here that an extra of the entry point's package requires."""
    requires = (entry.dist.requires if entry.dist else None) or []
    found = (match for line in requires if (match := REQUIRED.match(line)))
    try:
        for match in found:
            if match[2] == extra:
                distribution(match[1])
    except PackageNotFoundError:
        return False
    return True
