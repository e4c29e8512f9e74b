"""Types of arguments shared by several sub-commands, and early checks of their values."""

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

import tyro

from poise.configs.errors import ConfigError
from poise.configs.files import resolve
from poise.configs.reading import is_folder

Names = Annotated[
    tuple[str, ...],
    tyro.conf.Positional,
    tyro.conf.arg(metavar="CONTROLLER …", help_behavior_hint=""),
]
PolicyName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="POLICY")]
RobotName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ROBOT")]
Folder = Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
Switch = Annotated[bool, tyro.conf.FlagCreatePairsOff]  # without a --no- form
Overwrite = Annotated[Switch, tyro.conf.arg(help="replace the contents of the folder.")]
OnRobot = Annotated[
    str, tyro.conf.arg(help="a packaged robot (see poise list) or a .yaml description.")
]
Backend = Annotated[
    Literal["local", "joblib", "ray"],
    tyro.conf.arg(
        help="where trials run: local (processes of this machine), joblib (the same by joblib), "
        "ray (a cluster)."
    ),
]
Json = Annotated[
    bool,
    tyro.conf.FlagCreatePairsOff,
    tyro.conf.arg(help="Print the result as JSON; other text goes to standard error."),
]
Allow = Annotated[
    tuple[str, ...],
    tyro.conf.UseAppendAction,
    tyro.conf.arg(
        metavar="NAME",
        help="Code that may run although only a file names it: module:Class or file.py:Class of a "
        "controller or policy, or a TorchScript file (.pt, .pth, .jit, .ts); repeatable.",
    ),
]


def print_json(value: object) -> None:
    """Print a value as JSON, and nothing else."""
    print(json.dumps(value, indent=2, ensure_ascii=False))


def check_folders(*paths: str | Path) -> None:
    """Raise ConfigError for a missing folder, before any slow import."""
    for path in paths:
        if not is_folder(path):
            raise ConfigError("no such folder", source=path)


def check_out(args: Sequence[str]) -> None:
    """Raise ConfigError for an empty ``--out``, of an unset variable: parsed, it would be the
    working folder."""
    if "--out=" in args or ("--out", "") in pairwise(args):
        raise ConfigError("must not be empty", field="out")


def check_flags(args: Sequence[str], kinds: Mapping[str, str]) -> None:
    """Raise ConfigError for an unknown name after a flag, before a command's slow parsing.

    Args:
        args: of the command.
        kinds: flag → kind of its value, a folder of poise.configs.
    """
    for flag, value in pairwise(args):
        if flag in kinds:
            resolve(kinds[flag], value)
