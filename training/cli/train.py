"""`poise train`: a training configuration, changed by flags; one run, or one per seed."""

import argparse
import contextlib
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Literal, get_type_hints

import tyro

from poise.baselines.allowance import allow_words, named
from poise.configs.errors import ConfigError
from poise.configs.files import resolve
from poise.configs.reading import exists, is_file
from poise.configs.schema import build, to_dict
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.statistics.differences import difference
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.benchmarking.trials.agents import code_of
from poise.training.learning.config import TrainConfig, train_config
from poise.training.learning.policy_files import BEST, last_state
from poise.training.learning.seeds.records import SEEDS, Evaluation, evaluations, start_and_best
from poise.training.learning.seeds.train import train_seeds
from poise.training.learning.train import train
from poise.training.running.executor import Backend
from poise.training.running.options.described import Option, kind_of, options_of, sentences
from poise.training.running.options.pages import grouped, print_lines, print_options
from poise.training.running.options.parsing import one_line_errors
from poise.training.running.terminal import terminal

from .commands import Allow

DEFAULT, ANY_ROBOT, QUICK = "residual-torque", "any-robot", "quick"
HUMANOID = TrainConfig.robot  # whose bodies and limits DEFAULT names
BASIC = ("out", "config", "quick", "steps", "seed", "robot", "controller", "resume", "threads",
         "realism", "start-from", "seeds", "workers", "keep-every", "allow")  # fmt: skip
GROUPS = {
    "env": "the environment",
    "env.pushes": "pushes, each range drawn from uniformly",
    "env.pushes.limit-table": "what controller_fraction is measured by",
    "env.noise": "the start",
    "env.fall": "falls and rest",
    "env.reward": "weights of the reward's terms",
    "residual": "what an action of 1 adds, with --action residual",
    "step-residual": "what an action of 1 adds, with --action step or walk",
    "servos": "with --action position or whole",
    "hand-over": "with --action whole",
    "command": "of a walk",
    "ppo": "Stable-Baselines3's PPO, its names",
    "curriculum": "how pushes grow",
    "evaluation": "held-out pushes during the run",
}


@dataclass(frozen=True)
class Command:
    """Train a policy with PPO.

    Attributes:
        settings: Fields of the configuration.
        out: Folder to write to; with --quick runs/quick if not given.
        config: Packaged training configuration (see poise list) or a .yaml file; the options below
            replace its fields. If not given: residual-torque, with another --robot any-robot, with
            --resume the run's own.
        quick: Train a first policy in about ten minutes: the configuration quick.
        realism: Realism level: ideal (an exact, undelayed state), lab, field, or a .yaml file; that
            of the configuration if not given.
        resume: Continue the run, or the runs, in the folder.
        seeds: Train a run for each of these seeds, in folders seed-SEED of the folder.
        backend: Where the runs of several seeds execute: processes of this machine (local), the
            same by joblib, or a cluster (ray).
        workers: Number of concurrent runs of several seeds; all cores if not given.
        allow: What may run though a file names it: module:Class or file.py:Class of a controller or
            a policy, or a policy's file of TorchScript (.pt, .pth, .jit, .ts); repeatable.
    """

    settings: Annotated[TrainConfig, tyro.conf.arg(name="")]  # no prefix
    out: Path = Path("runs/quick")
    config: str | None = None
    quick: tyro.conf.FlagCreatePairsOff[bool] = False
    realism: str | None = None
    resume: tyro.conf.FlagCreatePairsOff[bool] = False
    seeds: tuple[int, ...] = ()
    backend: Backend = "local"
    workers: int | None = None
    allow: Allow = ()


def run_train(args: Sequence[str]) -> None:
    """Parse and train, or print the help; raises ConfigError."""
    if {"-h", "--help", "--help-all"} & set(args):
        print_train_help(train_config(_base(args)), everything="--help-all" in args)
        return
    command = parse_train(args)
    out, allow = command.out, [*named(_peek(args).controller), *command.allow]
    if not command.seeds and not exists(out / SEEDS):
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
    start, best = start_and_best(last_state(out)["evaluations"])
    if start is None or best is None:
        return []
    of_what = config.start_from or (config.controller if config.controlled else "the first policy")
    measured = (
        f"of {config.evaluation.trials} held-out pushes recovered: {start['recovered']:.1%} by "
        f"{of_what}, {best['recovered']:.1%} by {out / BEST} (at step {best['timesteps']:,})"
    )
    return [
        measured,
        gained(start, best, config.evaluation.trials),
        *next_commands(config, out, out),
    ]


def gained(start: Evaluation, best: Evaluation, trials: int) -> str:
    """The gain of the best evaluation over the first one, as far as so many pushes tell it."""
    ends = [wilson_interval(round(row["recovered"] * trials), trials) for row in (start, best)]
    gain, (low, high) = difference(start["recovered"], ends[0], best["recovered"], ends[1])
    points = f"{100.0 * gain:+.1f} points, 95 % {100.0 * low:+.1f} to {100.0 * high:+.1f}"
    said = "" if low > 0.0 else "; 0 is within: train on, or evaluate on more pushes"
    return f"gain: {points}{said}"


def next_commands(config: TrainConfig, out: Path, shown: Path) -> list[str]:
    """How to measure what was trained into `out` on pushes of its own, and how to look at it."""
    robot = [] if config.robot == HUMANOID else ["--robot", config.robot]
    allow = allow_words(code_of(config.controller) if config.controlled else ())
    names = [config.controller, str(out)] if config.controlled else [str(out)]
    suite = ["--suite", "walk-push"] if config.action == "walk" else []
    to = ["--out", str(Path("out") / out.name)]
    return [
        f"next: {shlex.join(['poise', 'evaluate', *names, *suite, *robot, *to, *allow])}",
        f"      {shlex.join(['poise', 'view', str(shown), *robot, *allow])}",
    ]


def steps_note(config: TrainConfig, out: Path, resume: bool) -> str:
    """Say where a run ends, if that is not at `config.steps`."""
    done = last_state(out)["timesteps"] if resume else 0
    if done >= config.steps:
        return f"{out} has {done:,} steps already; --steps says how many it is to have"
    rollout = config.ppo.n_envs * config.ppo.n_steps
    end = done + rollout * -(-(config.steps - done) // rollout)
    if end == config.steps:
        return ""
    return f"steps come in rollouts of {rollout:,}: it ended at {end:,}"


def options(config: TrainConfig) -> list[Option]:
    """Return all options: the command's own, then the fields of the configuration."""
    helps, hints, own = sentences(Command), get_type_hints(Command), []
    for name, default in ((f.name, f.default) for f in fields(Command) if f.name != "settings"):
        switch: Literal["one", ""] = "one" if isinstance(default, bool) else ""
        kind = "" if switch else kind_of(hints[name])
        own.append(Option(f"--{name}", kind, helps[name], "", switch=switch))
    return [*own, *options_of(config)]


def print_train_help(config: TrainConfig, everything: bool) -> None:
    """The options that a first run needs, or all in groups, with the defaults of `config`."""
    console, found = terminal(), options(config)
    print_lines("usage: poise train --out PATH [OPTIONS]", console)
    console.print()
    print_lines("Train a policy with PPO: poise train --quick is a first one, in some ten minutes.",
                console)  # fmt: skip
    first = [option for option in found if option.name[2:] in BASIC]
    print_options("options", first, console)
    if not everything:
        more = len(found) - len(first)
        console.print()
        print_lines(
            f"{more} more: poise train --help-all (docs/training.md#configuration)", console
        )
        return
    others = [option for option in found if option not in first]
    for title, group in grouped(others, GROUPS).items():
        print_options(title or "more of the run", group, console)


def parse_train(args: Sequence[str]) -> Command:
    """Return the command of these arguments, its configuration checked like one from a file."""
    base, quick = train_config(_base(args)), _peek(args).quick
    with one_line_errors("poise train", options(base), args):
        command = tyro.cli(
            Command,
            prog="poise train",
            args=list(args),
            default=Command(base) if quick else Command(base, out=tyro.MISSING),
            config=(tyro.conf.AvoidSubcommands,),
        )
    fields = to_dict(command.settings)
    if command.realism is not None:
        fields["env"]["realism"] = to_dict(load_realism(command.realism))
    settings = build(TrainConfig, fields, "command line")
    return replace(command, settings=settings)


def _base(args: Sequence[str]) -> str | Path:
    """Return the file that the flags' defaults come from, looked up before the flags are read."""
    known = _peek(args)
    if known.quick and (known.config is not None or known.resume):
        raise ConfigError("goes with no --config and no --resume: a quick run goes on with "
                          "--resume --out DIR", source="poise train", field="--quick")  # fmt: skip
    if known.config is not None or known.quick:
        return QUICK if known.config is None else known.config
    own = Path(known.out or ".") / "config.yaml"
    if known.resume and is_file(own):
        return own
    return DEFAULT if _is_humanoid(known.robot) else ANY_ROBOT


def _peek(args: Sequence[str]) -> argparse.Namespace:
    """Return the flags that matter by being there, which a parsed command does not tell."""
    peek = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    for name in ("--config", "--out", "--controller"):
        peek.add_argument(name)
    peek.add_argument("--robot", default=HUMANOID)
    for name in ("--resume", "--quick"):
        peek.add_argument(name, action="store_true")
    try:
        return peek.parse_known_args(list(args))[0]
    except argparse.ArgumentError as error:
        raise ConfigError(str(error), source="command line") from None


def _is_humanoid(robot: str) -> bool:
    """Return whether a name or a file is the humanoid's; it need not exist yet."""
    with contextlib.suppress(ConfigError):
        return resolve("robots", robot).samefile(resolve("robots", HUMANOID))
    return False
