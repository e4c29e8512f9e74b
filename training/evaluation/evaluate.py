"""Evaluating controllers on the same trials."""

import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from poise.baselines.allowance import allows
from poise.baselines.warmup import prepare
from poise.configs.errors import ConfigError, shown
from poise.configs.schema import to_dict
from poise.envs.pushes.sampler import LimitTable
from poise.envs.robots.robot import load_robot
from poise.training.learning.seeds import expand_seeds
from poise.training.running.crew import Crew
from poise.training.running.files import PARTIAL, SUMMARY, TRIALS, plain
from poise.training.running.provenance import circumstances, usable_cores, versions
from poise.training.running.stopping import keeps
from poise.training.running.terminal import print_paths, progress_bar
from poise.training.suites.base import MOST_TRIALS, Suite
from poise.training.suites.registry import load_suite
from poise.training.trials.job import EvaluationJob, play
from poise.training.trials.players import Player
from poise.training.trials.push_limits import PushLimits, load_limits, write_limits
from poise.training.trials.stage import Stage
from poise.training.trials.step_limits import stepping_limits
from poise.training.trials.trial import Trial, row

from .folder import EvaluationFolder, Settings
from .plots import draw_plots
from .seed_groups import seed_groups
from .summary import summarise
from .tables import print_summary


@allows("controllers")
def evaluate(
    controllers: Sequence[str],
    suite: str | Path = "random",
    *,
    out: str | Path,
    robot: str = "humanoid",
    seed: int = 0,
    workers: int | None = None,
    trials: int | None = None,
    limits: str | Path | None = None,
    overwrite: bool = False,
    console: Console | None = None,
    allow: str | Iterable[str] = (),
) -> dict[str, Any]:
    """Play a suite with every controller and write what came of it; returns the summary.

    `out` gets settings.yaml, trials.csv, summary.json and the plots. A run that was stopped goes
    on when it is called again alike. The result is the same, bit for bit, for any `workers`.

    Args:
        controllers: names as `load_player` takes them, or folders of several training seeds; all
            different.
        suite: a packaged suite or a path to a ``.yaml`` of one.
        out: the folder to write to.
        robot: a packaged robot or a path to its description.
        seed: of the trials.
        workers: number of processes; None for all cores.
        trials: instead of the suite's own number; of pushes (random), of starts (quiet), of trials
            per direction and controller in the second stage (envelope), of repeats (grid).
        limits: what pushes are measured by, see `load_limits`.
        overwrite: replace an evaluation that `out` holds.
        console: where progress and tables are printed; None: nowhere.
        allow: controllers from outside (``module:Class``) that may run though they are not among
            `controllers`, but named by a policy's folder or a file.

    Raises:
        ConfigError: anything named does not exist or is not valid; nothing is written then.
        PoiseError: a file cannot be written, or a worker has died.
    """
    console = console or Console(quiet=True)
    started = time.perf_counter()
    controllers = expand_seeds(controllers)
    _check(controllers, seed, workers, trials)
    chosen = load_suite(suite)
    if trials is not None:
        chosen = chosen.resized(trials)
    loaded = load_robot(robot)
    pushed = load_limits(loaded, limits)
    stage = Stage(robot, chosen.duration, chosen.noise)
    prepare()
    players = [stage.load(name, loaded) for name in controllers]
    first = chosen.first(pushed, seed)
    _warm_up(players)
    settings = Settings(
        suite_name=str(suite),
        suite=to_dict(chosen),
        robot=str(robot),
        robot_fingerprint=loaded.fingerprint,
        controllers={player.name: player.fingerprint for player in players},
        seed=seed,
        limits=pushed.table,
        versions=versions(("mujoco", "numpy", "numba")),
    )
    folder = EvaluationFolder(Path(out), settings, overwrite)
    keeps(folder.path / PARTIAL, f"the finished trials are kept in {out}; the same command goes on")
    with closing(folder):
        if folder.finished:
            console.print(f"going on after {len(folder.finished)} finished trials")
        count = workers or usable_cores()
        crew = Crew("local", min(count, len(first)))
        done = _play(crew, folder, chosen, pushed, first, stage, console)
        outcomes = {
            name: [folder.finished[trial.number][i] for trial in done]
            for i, name in enumerate(controllers)
        }
        steps = stepping_limits(players, outcomes, pushed)
        figures = summarise(chosen, done, outcomes, pushed, steps)
        summary = plain(
            {
                "suite": str(suite),
                "seed": seed,
                "robot": loaded.name,
                **figures,
                "seeds": seed_groups(controllers, figures["controllers"]),
                **circumstances(started, count),
            }
        )
        plots = draw_plots(Path(out), chosen, done, outcomes, pushed, steps)
        rows = [row(trial, name, outcomes[name][k])
                for k, trial in enumerate(done) for name in controllers]  # fmt: skip
        folder.finish(rows, summary)
    print_summary(summary, console)
    print_paths([*plots, Path(out) / TRIALS, Path(out) / SUMMARY], console)
    return summary


def measured_limits(summary: dict[str, Any], path: Path, robot: str) -> None:
    """Write the J50s of an evaluation's first controller as a file of limits.

    Raises ConfigError when the suite does not measure J50 in each direction.
    """
    name, entry = next(iter(summary["controllers"].items()))
    directions = entry.get("directions")
    if not directions:
        raise ConfigError(f"the suite {summary['suite']!r} does not measure J50", field="suite")
    table = LimitTable(
        tuple(d["direction"] for d in directions), tuple(round(d["j50"], 3) for d in directions)
    )
    write_limits(path, load_robot(robot), name, table)


def _check(controllers: Sequence[str], seed: int, workers: int | None, trials: int | None) -> None:
    if not controllers:
        raise ConfigError("give at least one", field="controller")
    for name in controllers:
        if list(controllers).count(name) > 1:
            raise ConfigError(f"{shown(name)} is given twice", field="controller")
    for value, name, least in ((seed, "seed", 0), (workers, "workers", 1), (trials, "trials", 1)):
        if value is not None and value < least:
            raise ConfigError(f"must be at least {least}, not {value}", field=name)
    if trials is not None and trials > MOST_TRIALS:
        raise ConfigError(f"must be at most {MOST_TRIALS}", field="trials")


def _play(
    crew: Crew,
    folder: EvaluationFolder,
    suite: Suite,
    limits: PushLimits,
    first: list[Trial],
    stage: Stage,
    console: Console,
) -> list[Trial]:
    """Play all stages of the suite; returns the trials in order, `folder` has their outcomes."""
    trials: list[Trial] = []
    controllers = tuple(folder.settings.controllers)
    following = first
    with crew, progress_bar(console) as bar:
        task = bar.add_task("", total=suite.count(len(controllers)), rates="")

        def show() -> None:
            rates = np.mean([[o.recovered for o in os] for os in folder.finished.values()], axis=0)
            text = "  ".join(f"{n} {r:.0%}" for n, r in zip(controllers, rates, strict=True))
            bar.update(task, completed=len(folder.finished), rates=text)

        while following:
            missing = [
                EvaluationJob(stage, controllers, trial)
                for trial in following
                if trial.number not in folder.finished
            ]
            for job, outcomes in crew.each(play, missing):
                folder.append(job.trial.number, outcomes)
                show()
            trials += following
            recovered = {
                name: [folder.finished[trial.number][i].recovered for trial in trials]
                for i, name in enumerate(controllers)
            }
            following = suite.more(limits, folder.settings.seed, trials, recovered)
        if folder.finished:
            show()
    return trials


def _warm_up(players: Sequence[Player]) -> None:
    """Compile what is not yet compiled, once, before many processes would do it each."""
    for player in players:
        observation, _ = player.env.reset(seed=0, options={"push": []})
        player.env.step(player.act(observation))
