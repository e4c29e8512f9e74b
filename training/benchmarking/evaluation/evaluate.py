"""Run a suite with several controllers: `poise evaluate` and `poise benchmark`."""

import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.console import Console

from poise.baselines.allowance import allows
from poise.baselines.registry import available_controllers, walking_controllers
from poise.configs.errors import ConfigError, PoiseWarning
from poise.configs.files import packaged, packaged_folder
from poise.configs.reading import read_json, read_yaml
from poise.envs.physics.pushes.sampler import LimitTable
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.trials.push_limits import (
    BASELINE,
    PushLimits,
    load_limits,
    write_limits,
)
from poise.training.running.summary import Summary

from .run import Run

RESTLESS = ("simbicon",)  # always marks time, and so never counts as recovered


@allows("controllers")
def evaluate(
    controllers: Sequence[str],
    suite: str | Path = "strong",
    *,
    out: str | Path,
    robot: str = "humanoid",
    seed: int = 0,
    workers: int | None = None,
    backend: str = "local",
    trials: int | None = None,
    limits: str | Path | None = None,
    motions: Sequence[str] = (),
    realism: str | None = None,
    get_up: bool = False,
    physics: str | None = None,
    overwrite: bool = False,
    console: Console | None = None,
    allow: str | Iterable[str] = (),
) -> Summary:
    """Run a suite with several controllers and write the outcomes; return the summary.

    Write settings.yaml, trials.jsonl, trials.csv, summary.json and, with pushes, plots to `out`.
    Trials that `out` already holds, stopped or finished, are not repeated. Other controllers in
    `out` stay in the result. The result is bitwise identical for any `workers` and `backend`.

    Args:
        controllers: distinct names as for `load_agent`, or folders of several training seeds. The
            first is the reference.
        suite: a packaged suite or a path to a ``.yaml`` of one.
        out: the folder to write to.
        robot: a packaged robot or a path to its description.
        seed: of the trials.
        workers: number of processes; None for all cores.
        backend: local, joblib or ray.
        trials: replaces the number of trials of a suite with one part (of an envelope, that of its
            second stage); caps the number in every cell of a suite with several parts.
        limits: reference impulses of pushes, see `load_limits`.
        motions: names and files of motions that replace those of a suite.
        realism: a packaged realism level or a path to one that replaces the suite's.
        get_up: give a fallen robot 10 s to get up again, reported as a separate figure.
        physics: a packaged engine or a path to its settings that replaces the suite's.
        overwrite: replace the contents of `out`.
        console: for progress and tables; None: no output.
        allow: external controllers (``module:Class``) that may run although only `out`, a policy's
            folder or a file names them.

    Raises:
        ConfigError: invalid input; nothing is written.
        PoiseError: a file cannot be written, or a worker has died.
    """
    if not controllers:
        raise ConfigError("give at least one", field="controller")
    run = Run(
        controllers, suite, out, robot, seed, workers, backend, trials, overwrite, console,
        reference=None, measured=lambda loaded: load_limits(loaded, limits), motions=motions,
        realism=realism, get_up=get_up, physics=physics,
    )  # fmt: skip
    own = robot not in packaged("robots")  # whose published results count by ankle limits
    if own and run.suite.relative and run.limits.table is None:
        warnings.warn(f"no J50 of {run.robot.name} is known (--limits FILE, see --write-limits): "
                      "pushes in controller_fraction are fractions of its ankle limit",
                      PoiseWarning, stacklevel=2)  # fmt: skip
    return run.play(plots=True)


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
    realism: str | None = None,
    physics: str | None = None,
    overwrite: bool = False,
    console: Console | None = None,
    allow: str | Iterable[str] = (),
) -> Summary:
    """Rank controllers by a suite: `evaluate` with pushes scaled by the ankle limit.

    The ankle limit depends on the robot alone, so results stay comparable when a controller
    changes. The reference is momentum-qp. The time of a control tick is measured in addition; it
    alone varies with `workers`.

    Args:
        controllers: as of `evaluate`; none: `default_controllers`.
        suite, out, robot, seed, workers, backend, trials, realism, physics, overwrite, console,
            allow: as of `evaluate`.

    Raises:
        ConfigError, PoiseError: as `evaluate`.
    """
    chosen = controllers or default_controllers(load_robot(robot).name)
    run = Run(
        chosen, suite, out, robot, seed, workers, backend, trials,
        overwrite, console, reference=BASELINE, measured=PushLimits, realism=realism,
        physics=physics,
    )  # fmt: skip
    return run.play(timed=True)


def default_controllers(robot: str = "humanoid") -> tuple[str, ...]:
    """Return the reference, the other packaged controllers that stand still, and the policies.

    Controllers that walk, and policies on them, are left out: without commands they are equivalent
    to `feedback-step`.
    """
    elsewhere = {BASELINE, *RESTLESS, *walking_controllers()}
    others = (name for name in available_controllers() if name not in elsewhere)
    policies = (name for name in packaged_policies(robot) if not walks(name))
    return (BASELINE, *others, *policies)


def packaged_policies(robot: str) -> list[str]:
    """Return the packaged policies that were trained on the robot of this name."""
    folder = packaged_folder("policies")
    states = {name: read_json(folder / name / "state.json") for name in packaged("policies")}
    return [name for name, state in states.items() if state["robot"] == robot]


def walks(policy: str) -> bool:
    """Return whether this packaged policy moves the steps of a walk."""
    config = read_yaml(packaged_folder("policies") / policy / "config.yaml")
    return bool(config.get("action") == "walk")


def measured_limits(summary: Summary, path: Path, robot: str) -> None:
    """Write the J50s of a result's first controller as a file of limits.

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
