"""`poise train`: a training configuration, changed by flags; one run, or one per seed."""

import argparse
import contextlib
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import tyro

from poise.baselines.allowance import named
from poise.configs.errors import ConfigError
from poise.configs.files import resolve
from poise.configs.schema import build, to_dict
from poise.training.learning.checkpoints import STATE, find_checkpoint
from poise.training.learning.config import TrainConfig, train_config
from poise.training.learning.policy_files import read_state
from poise.training.learning.seeds import SEEDS, evaluations, start_and_best
from poise.training.learning.train import BEST, LAST, train
from poise.training.learning.train_seeds import train_seeds
from poise.training.running.executor import Backend
from poise.training.running.terminal import terminal

from .commands import Allow

DEFAULT, ANY_ROBOT = "residual", "any-robot"
HUMANOID = TrainConfig.robot  # whose bodies and limits DEFAULT names


@dataclass(frozen=True)
class Command:
    """Train a residual policy with PPO.

    Attributes:
        settings: fields of the configuration.
        out: folder to write to.
        config: a packaged training configuration or a path to a .yaml file; the flags below
            replace its fields. If not given: residual, with another --robot any-robot, with
            --resume the run's own.
        resume: go on with the run, or the runs, that the folder holds.
        seeds: train a run for each of these seeds, in folders seed-SEED of the folder.
        backend: of runs with several seeds: local (processes of this machine), joblib (the same
            by joblib), ray (a cluster).
        workers: with several seeds, runs at a time; all cores if not given.
    """

    settings: Annotated[TrainConfig, tyro.conf.arg(name="")]  # no prefix
    out: Path
    config: str | None = None
    resume: tyro.conf.FlagCreatePairsOff[bool] = False
    seeds: tuple[int, ...] = ()
    backend: Backend = "local"
    workers: int | None = None
    allow: Allow = ()


def run(args: Sequence[str]) -> None:
    """Parse and train; raises ConfigError, and SystemExit as command lines do."""
    command = parse(args)
    out, allow = command.out, [*named(_peek(args).controller), *command.allow]
    if not command.seeds and not (out / SEEDS).exists():
        note = steps_note(command.settings, out, command.resume)
        best = train(command.settings, out, command.resume, allow=allow)
        if note:
            print(f"poise: {note}", file=sys.stderr)
        print(best)
        for line in last_words(command.settings, out):
            print(line)
        return
    summary = train_seeds(
        command.settings, command.seeds, out, resume=command.resume, allow=allow,
        workers=command.workers, backend=command.backend, console=terminal(),
    )  # fmt: skip
    print(out / SEEDS)
    best_run = max(summary["runs"], key=lambda run: evaluations(run)[1]["score"])
    for line in next_commands(command.settings, out, out / best_run["folder"]):
        print(line)


def last_words(config: TrainConfig, out: Path) -> list[str]:
    """What was recovered of the held-out pushes, and the commands that come next."""
    checkpoint = find_checkpoint(out / LAST)
    rows = [] if checkpoint is None else read_state(checkpoint / STATE)["evaluations"]
    start, best = start_and_best(rows)
    if start is None or best is None:
        return []
    of_what = config.start_from or (config.controller if controls(config) else "the first policy")
    measured = (
        f"of {config.evaluation.trials} held-out pushes recovered: {start['recovered']:.1%} by "
        f"{of_what}, {best['recovered']:.1%} by {out / BEST} (at step {best['timesteps']:,})"
    )
    return [measured, *next_commands(config, out, out)]


def next_commands(config: TrainConfig, out: Path, shown: Path) -> list[str]:
    """How to measure what was trained into `out` on pushes of its own, and how to look at it."""
    robot = [] if config.robot == HUMANOID else ["--robot", config.robot]
    allow = [word for name in named(config.controller) for word in ("--allow", name)]
    names = [config.controller, str(out)] if controls(config) else [str(out)]
    suite = ["--suite", "walk-push"] if config.action == "walk" else []
    to = ["--out", str(Path("out") / out.name)]
    return [
        f"next: {shlex.join(['poise', 'evaluate', *names, *suite, *robot, *to, *allow])}",
        f"      {shlex.join(['poise', 'view', str(shown), *robot, *allow])}",
    ]


def controls(config: TrainConfig) -> bool:
    """Whether a controller is below the policy."""
    return config.action not in ("torque", "position")


def steps_note(config: TrainConfig, out: Path, resume: bool) -> str:
    """Say where a run ends, if that is not at `config.steps`."""
    checkpoint = find_checkpoint(out / LAST) if resume else None
    done = 0 if checkpoint is None else int(read_state(checkpoint / STATE)["timesteps"])
    if done >= config.steps:
        return f"{out} has {done:,} steps already; --steps says how many it is to have"
    rollout = config.ppo.n_envs * config.ppo.n_steps
    end = done + rollout * -(-(config.steps - done) // rollout)
    if end == config.steps:
        return ""
    return f"steps come in rollouts of {rollout:,}: it ended at {end:,}"


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
    return replace(command, settings=settings)


def _base(args: Sequence[str]) -> str | Path:
    """The file that the flags' defaults come from, looked up before the flags are read."""
    known = _peek(args)
    if known.config is not None:
        return known.config
    own = Path(known.out or ".") / "config.yaml"
    if known.resume and own.is_file():
        return own
    return DEFAULT if _is_humanoid(known.robot) else ANY_ROBOT


def _peek(args: Sequence[str]) -> argparse.Namespace:
    """The flags that matter by being there, which a parsed command does not tell."""
    peek = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    for name in ("--config", "--out", "--controller"):
        peek.add_argument(name)
    peek.add_argument("--robot", default=HUMANOID)
    peek.add_argument("--resume", action="store_true")
    try:
        return peek.parse_known_args(list(args))[0]
    except argparse.ArgumentError as error:
        raise ConfigError(str(error), source="command line") from None


def _is_humanoid(robot: str) -> bool:
    """Return whether a name or a file is the humanoid's; it need not exist yet."""
    with contextlib.suppress(ConfigError):
        return resolve("robots", robot).samefile(resolve("robots", HUMANOID))
    return False
