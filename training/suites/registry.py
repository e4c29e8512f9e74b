"""Suites by name: `configs/suites/*.yaml`, or a path to such a file."""

from pathlib import Path
from typing import Any

from poise.configs.errors import ConfigError, shown
from poise.configs.files import resolve
from poise.configs.schema import build, read_yaml

from .base import Suite
from .directions import EnvelopeSuite, GridSuite
from .random import QuietSuite, RandomSuite
from .sequences import SequenceSuite

KINDS: dict[str, type[Suite]] = {
    "random": RandomSuite,
    "envelope": EnvelopeSuite,
    "grid": GridSuite,
    "quiet": QuietSuite,
    "sequence": SequenceSuite,
}


def load_suite(name: str | Path) -> Suite:
    """A packaged suite (`configs/suites`) or a path to one.

    Raises ConfigError naming the file, the field and the choices.
    """
    path = resolve("suites", name)
    return build_suite(read_yaml(path), str(path))


def build_suite(data: dict[str, Any], source: str) -> Suite:
    """A suite from the fields of its kind; raises ConfigError."""
    kind = data.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise ConfigError(f"no such kind of suite: {shown(kind)}", source=source, field="kind",
                          choices=KINDS)  # fmt: skip
    return build(KINDS[kind], data, source)
