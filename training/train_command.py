"""`poise train`: a training configuration, changed by flags."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from poise.envs.config import build, to_dict
from poise.envs.errors import ConfigError

from .config import TrainConfig, train_config
from .train import train

DEFAULT = "residual"


@dataclass(frozen=True)
class Command:
    """Train a residual policy with PPO.

    Attributes:
        settings: fields of the configuration.
        out: folder to write to.
        config: a packaged training configuration or a path to a .yaml file; the flags below
            replace its fields. With --resume, the run's own configuration if not given.
        resume: go on with the run that the folder holds.
    """

    settings: Annotated[TrainConfig, tyro.conf.arg(name="")]  # no prefix
    out: Path
    config: str | None = None
    resume: tyro.conf.FlagCreatePairsOff[bool] = False


def run(args: Sequence[str]) -> None:
    """Parse and train; raises ConfigError, and SystemExit as command lines do."""
    command = parse(args)
    best = train(command.settings, command.out, command.resume)
    print(best)


def parse(args: Sequence[str]) -> Command:
    """The command of these arguments, its configuration checked like one from a file."""
    base = train_config(_base(args))
    command = tyro.cli(
        Command,
        prog="poise train",
        args=list(args),
        default=Command(base, out=tyro.MISSING, config=None),
        config=(tyro.conf.AvoidSubcommands,),
    )
    settings = build(TrainConfig, to_dict(command.settings), "command line")
    return Command(settings, command.out, command.config, command.resume)


def _base(args: Sequence[str]) -> str | Path:
    """Where the defaults of the flags come from: looked up before the flags are read."""
    peek = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    peek.add_argument("--config")
    peek.add_argument("--out")
    peek.add_argument("--resume", action="store_true")
    try:
        known, _ = peek.parse_known_args(list(args))
    except argparse.ArgumentError as error:
        raise ConfigError(str(error), source="command line") from None
    if known.config is not None:
        return known.config
    own = Path(known.out or ".") / "config.yaml"
    return own if known.resume and own.is_file() else DEFAULT
