"""Running a benchmark: whatever is missing in the folder is played, then figures are written."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from rich.console import Console

from poise.baselines.allowance import allowing, allows
from poise.baselines.warmup import prepare
from poise.configs.errors import ConfigError, shown
from poise.configs.files import packaged
from poise.configs.schema import to_dict
from poise.envs.robots.robot import Robot, load_robot
from poise.training.evaluation.seed_groups import seed_groups
from poise.training.learning.seeds import expand_seeds
from poise.training.running.crew import Crew, check_backend
from poise.training.running.files import SETTINGS, SUMMARY, TRIALS, plain
from poise.training.running.provenance import circumstances, versions
from poise.training.running.stopping import keeps
from poise.training.running.terminal import print_paths, progress_bar
from poise.training.suites.base import MOST_TRIALS
from poise.training.trials.players import Player
from poise.training.trials.stage import Stage
from poise.training.trials.step_limits import curves, stepping_limits

from .case import Case, case_row
from .cases import Cases
from .figures import controller_figures, pair_figures, robot_figures
from .folder import FORMAT, LOG, BenchmarkFolder, BenchmarkSettings
from .suite import load_benchmark
from .table import print_benchmark
from .tick_times import tick_times
from .world import Job, play

REFERENCE = "momentum-qp"
RESTLESS = ("simbicon",)  # always marks time, and so never counts as recovered


@allows("controllers")
def benchmark(
    controllers: Sequence[str] = (),
    suite: str | Path = "standard",
    *,
    out: str | Path,
    robot: str = "humanoid",
    seed: int = 0,
    workers: int | None = None,
    backend: str = "local",
    trials: int | None = None,
    overwrite: bool = False,
    console: Console | None = None,
    allow: str | Iterable[str] = (),
) -> dict[str, Any]:
    """Play a suite with every controller and write what came of it; returns the summary.

    Trials that `out` already holds are not played again, be it stopped or finished; controllers
    that it holds besides stay in the result. Results are the same, bit for bit, for any `workers`
    and `backend`, but for the time of a tick.

    Args:
        controllers: names as `load_player` takes them, or folders of several training seeds;
            none: `default_controllers`.
        suite: a packaged suite (`configs/benchmarks`) or a path to a ``.yaml`` of one.
        out: the folder to write to.
        robot: a packaged robot or a path to its description.
        seed: of the cases.
        workers: number of processes; None for all cores.
        backend: local, joblib or ray.
        trials: at most as many in every cell of the suite.
        overwrite: replace what `out` holds.
        console: where progress and tables are printed; None: nowhere.
        allow: controllers from outside (``module:Class``) that may run though they are not among
            `controllers`, but named by what `out` holds, a policy's folder or a file.

    Raises:
        ConfigError: anything named does not exist or is not valid; nothing is written then.
        PoiseError: a file cannot be written, or a worker has died.
    """
    console = console or Console(quiet=True)
    started = time.perf_counter()
    names = expand_seeds(controllers) or default_controllers()
    _check(names, seed, workers, trials)
    check_backend(backend)
    chosen = load_benchmark(suite)
    if trials is not None:
        chosen = chosen.resized(trials)
    loaded = load_robot(robot)
    cases = Cases(chosen, loaded, seed)
    prepare()
    stage = Stage(robot, chosen.duration, chosen.noise)
    players = {name: stage.load(name, loaded) for name in names}
    settings = BenchmarkSettings(
        benchmark=FORMAT,
        suite_name=str(suite),
        suite=to_dict(chosen),
        robot=str(robot),
        robot_fingerprint=loaded.fingerprint,
        seed=seed,
        versions=versions(("mujoco", "numpy", "numba")),
        controllers={name: player.fingerprint for name, player in players.items()},
    )
    folder = BenchmarkFolder(Path(out), settings, overwrite)
    keeps(folder.path / LOG, f"the finished trials are kept in {out}; the same command goes on")
    with closing(folder):
        _announce(folder, console)
        names = tuple(folder.settings.controllers)
        for name in names:
            if name not in players:
                players[name] = _load_again(name, loaded, stage, folder)
        crew = Crew(backend, workers)
        _play(folder, cases, names, stage, crew, console)
        played = {name: _played(folder, cases, name) for name in names}
        outcomes = {name: [result.outcome for _, result in played[name]] for name in names}
        steps = stepping_limits([players[name] for name in names], outcomes, cases.limits)
        entries = {name: controller_figures(played[name], cases, steps.get(name)) for name in names}
        ticks = tick_times(players)
        for name, entry in entries.items():
            entry["tick_us"] = ticks[name]
            entry["fingerprint"] = folder.settings.controllers[name]
        reference = REFERENCE if REFERENCE in names else names[0]
        summary = plain(
            {
                "benchmark": FORMAT,
                "suite": str(suite),
                "seed": seed,
                "robot": {"name": loaded.name, **robot_figures(cases.limits)},
                "reference": reference,
                "ranking": sorted(names, key=lambda name: -entries[name]["j50_mean"]),
                "controllers": entries,
                "pairs": [
                    pair_figures(reference, name, played, entries)
                    for name in names
                    if name != reference
                ],
                **({"step_limits": curves(steps, chosen.push_duration)} if steps else {}),
                "seeds": seed_groups(names, entries),
                **circumstances(started, crew.workers, backend=backend),
            }
        )
        rows = [case_row(case, name, result) for name in names for case, result in played[name]]
        folder.finish(rows, summary)
        print_benchmark(summary, console)
        print_paths([Path(out) / TRIALS, Path(out) / SUMMARY], console)
        return summary


def default_controllers() -> tuple[str, ...]:
    """The reference, all other packaged controllers that can rest, and the packaged policies."""
    others = (name for name in packaged("controllers") if name not in (REFERENCE, *RESTLESS))
    return (REFERENCE, *others, *packaged("policies"))


def errors(summary: dict[str, Any]) -> int:
    """Trials in which a controller raised."""
    return sum(entry["errors"] for entry in summary["controllers"].values())


def _load_again(name: str, robot: Robot, stage: Stage, folder: BenchmarkFolder) -> Player:
    """A controller that the folder has besides; raises ConfigError if it is no longer the same."""
    with allowing(source=folder.path / SETTINGS):
        player = stage.load(name, robot)
    if player.fingerprint != folder.settings.controllers[name]:
        raise ConfigError(
            f"holds trials of {shown(name)}, which has changed since: choose another folder",
            source=folder.path, field="controllers",
        )  # fmt: skip
    return player


def _check(names: Sequence[str], seed: int, workers: int | None, trials: int | None) -> None:
    for name in names:
        if list(names).count(name) > 1:
            raise ConfigError(f"{shown(name)} is given twice", field="controllers")
    for value, name, least in ((seed, "seed", 0), (workers, "workers", 1), (trials, "trials", 1)):
        if value is not None and value < least:
            raise ConfigError(f"must be at least {least}, not {value}", field=name)
    if trials is not None and trials > MOST_TRIALS:
        raise ConfigError(f"must be at most {MOST_TRIALS}", field="trials")


def _announce(folder: BenchmarkFolder, console: Console) -> None:
    if folder.damaged:
        console.print(f"{folder.damaged} lines of {folder.path} could not be read: played again")
    if folder.finished:
        console.print(f"going on after {len(folder.finished)} finished trials")


def _play(
    folder: BenchmarkFolder,
    cases: Cases,
    names: Sequence[str],
    stage: Stage,
    crew: Crew,
    console: Console,
) -> None:
    """Play what is missing: first stages, then all that follows from them."""

    def missing(wanted: Iterable[tuple[str, Case]]) -> list[Job]:
        return [
            Job(stage, name, case)
            for name, case in wanted
            if (name, case.number) not in folder.finished
        ]

    first = missing((name, case) for case in cases.first for name in names)
    with progress_bar(console) as bar:
        total = cases.count(len(names))
        task = bar.add_task("", total=total, completed=len(folder.finished), rates="")
        won = [result.outcome.recovered for result in folder.finished.values()]
        shown = {"played": len(won), "won": sum(won)}

        def keep(jobs: list[Job]) -> None:
            for job, result in crew.each(play, jobs):
                folder.append(job.controller, job.case.number, result)
                shown["played"] += 1
                shown["won"] += result.outcome.recovered
                rates = f"{shown['won'] / shown['played']:.0%}"
                bar.update(task, completed=len(folder.finished), rates=rates)

        def rest() -> list[Job]:
            second = [(n, case) for n in names for case in _second(folder, cases, n)]
            return missing(sorted([*second, *((n, c) for n in names for c in cases.others)],
                                  key=lambda pair: pair[1].number))  # fmt: skip

        if not first and not rest():
            return
        with crew:
            keep(first)
            keep(rest())


def _second(folder: BenchmarkFolder, cases: Cases, name: str) -> list[Case]:
    recovered = {
        case.number: folder.finished[name, case.number].outcome.recovered for case in cases.first
    }
    return cases.second(recovered)


def _played(folder: BenchmarkFolder, cases: Cases, name: str) -> list[tuple[Case, Any]]:
    """Cases and results of a controller, by number."""
    all_cases = [*cases.first, *_second(folder, cases, name), *cases.others]
    return [(case, folder.finished[name, case.number]) for case in all_cases]
