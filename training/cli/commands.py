"""The command `poise`. What is heavy (MuJoCo, Numba, torch) is imported by the sub-commands."""

import csv
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from poise.training.running.options.arguments import (
    Allow,
    Backend,
    Json,
    Names,
    OnRobot,
    Overwrite,
    RobotName,
    Switch,
    print_json,
)
from poise.training.running.terminal import terminal

from .policies import dataset, export
from .results import compare, gallery, leaderboard, replay, report
from .view import view
from .walk import gait, walk

if TYPE_CHECKING:
    from poise.training.running.summary import Summary


def demo(
    out: Path | None = None,
    *,
    full: Switch = False,
    workers: int | None = None,
    seed: int = 0,
    overwrite: Overwrite = False,
) -> None:
    """Push four controllers and compare: a table, two plots and a video, in a minute or so.

    momentum-qp keeps its feet fixed; capture-step steps; feedback-step steps better; the policy
    residual-torque runs on top of feedback-step. Run the same command again to resume.

    Args:
        out: folder to write to; out/demo, or out/demo-full, if not given.
        full: push more, also at random, and add a policy with feet fixed: takes minutes.
        workers: number of processes; all cores if not given.
        seed: seed of the pushes.
    """
    from poise.envs.viewing.gl import choose_gl_backend

    choose_gl_backend()
    from .demo import run_demo

    folder = out or Path("out/demo-full" if full else "out/demo")
    run_demo(folder, full=full, workers=workers, seed=seed, overwrite=overwrite, console=terminal())


def train() -> None:
    """Train a policy with PPO: `poise train --quick` is a first one, in some ten minutes."""
    raise AssertionError("main() answers this sub-command")


def evaluate(
    controllers: Names,
    /,
    suite: str = "strong",
    *,
    out: Path | None = None,
    robot: OnRobot = "humanoid",
    seed: int = 0,
    workers: int | None = None,
    backend: Backend = "local",
    trials: int | None = None,
    limits: str | None = None,
    write_limits: Path | None = None,
    motions: tuple[str, ...] = (),
    realism: str | None = None,
    get_up: bool = False,
    physics: str | None = None,
    overwrite: Overwrite = False,
    json: Json = False,
    allow: Allow = (),
) -> int:
    """Run several controllers on the same suite of pushes.

    Writes settings.yaml, trials.jsonl, trials.csv, summary.json and plots. Run the same
    command again to resume. The result does not depend on the number of workers. Exit code 1 if
    a controller raised an error.

    Args:
        controllers: a name of `poise list`, such as residual-torque (a shipped policy), zero (no
            torque), a .yaml file of a controller, a folder written by poise train, with --seeds
            too, or a class of your own, my_file.py:Class or module:Class. A class that a file or a
            folder names also needs --allow my_file.py:Class.
        suite: pushes to run: strong (random pushes that separate good controllers), random,
            envelope, grid, quiet, repeated, in-step, follow, those of poise benchmark, or a .yaml
            file.
        out: folder to write to; out/SUITE if not given.
        seed: seed of the trials.
        workers: number of processes; all cores if not given.
        trials: number of pushes (random), of starts (quiet), of trials per direction and controller
            in the second stage (envelope), of repeats (grid), of sequences (repeated, in-step); of
            a suite of several parts, at most as many in every cell.
        limits: a .yaml file of limits that scale the pushes; if not given, the packaged file of the
            robot, else its ankle limit.
        write_limits: write the first controller's J50s to this file, for --limits.
        motions: motions of the suite follow: packaged clips or motions, .bvh, .npz or .yaml files;
            those of the suite if not given.
        realism: realism level: ideal (an exact, undelayed state), lab, field, or a .yaml file; that
            of the suite if not given.
        get_up: give a robot that falls 10 s to get up again; the rate and the time are reported
            separately.
        physics: the engine that steps the robot: mujoco, drake (needs poise[drake]), or a .yaml
            file of its settings; that of the suite if not given.
    """
    from poise.configs.outputs import check_out_file
    from poise.training.benchmarking.trials.names import check_names

    check_names(controllers, robot=robot, suite=suite, realism=realism, physics=physics)
    from poise.training.benchmarking.evaluation.evaluate import evaluate, measured_limits

    if write_limits is not None:
        check_out_file(write_limits, "write_limits")
    folder = Path("out") / Path(suite).stem if out is None else out
    summary = evaluate(
        controllers, suite, out=folder, robot=robot, seed=seed, workers=workers, backend=backend,
        trials=trials, limits=limits, motions=motions, realism=realism, get_up=get_up,
        physics=physics, overwrite=overwrite, console=terminal(stderr=json), allow=allow,
    )  # fmt: skip
    if write_limits is not None:
        measured_limits(summary, write_limits, robot)
        terminal(stderr=json).print(str(write_limits), soft_wrap=True)
    if json:
        print_json(summary)
    return _raised(summary, folder)


def benchmark(
    controllers: Names = (),
    /,
    *,
    out: Path | None = None,
    suite: str = "standard",
    robot: OnRobot = "humanoid",
    seed: int = 0,
    workers: int | None = None,
    backend: Backend = "local",
    trials: int | None = None,
    realism: str | None = None,
    physics: str | None = None,
    overwrite: Overwrite = False,
    report: bool = True,
    submit: Path | None = None,
    json: Json = False,
    allow: Allow = (),
) -> int:
    """Rank controllers: J50 per direction, factors one at a time, a random suite; see docs.

    Writes settings.yaml, trials.jsonl, trials.csv, summary.json and report.html. Run the same
    command again to resume, or with other controllers to add them. Exit code 1 if a controller
    raised an error.

    Args:
        controllers: names as poise evaluate takes them, also my_file.py:Class (one that a file or
            a folder names also needs --allow my_file.py:Class); all packaged ones that can rest
            if not given.
        out: folder to write to; required, except with --submit.
        suite: pushes to run: quick (minutes), standard (an hour), full (many hours), those of poise
            evaluate, or a .yaml file.
        seed: seed of the cases.
        workers: number of processes; all cores if not given.
        trials: at most as many in every cell of the suite, to try things out; of a suite of one
            part, its number.
        realism: realism level: ideal, lab, field or a .yaml file; that of the suite if not given.
        physics: the engine that steps the robot: mujoco, drake or a .yaml file of its settings;
            that of the suite if not given.
        report: write report.html at the end, as poise report does.
        submit: run nothing; check this finished folder and pack it, without any code, into a .zip
            beside it, which you attach to the issue form for results.
    """
    if submit is not None:
        from poise.training.benchmarking.results.submission import pack_submission

        print(pack_submission(submit))
        return 0
    if out is None:
        from poise.configs.errors import ConfigError

        raise ConfigError("needs --out PATH", source="benchmark")
    from poise.envs.viewing.gl import choose_gl_backend

    choose_gl_backend()
    from poise.baselines.allowance import named
    from poise.training.benchmarking.trials.names import check_names

    check_names(controllers, robot=robot, suite=suite, realism=realism, physics=physics)
    from poise.training.benchmarking.evaluation.evaluate import benchmark

    summary = benchmark(
        controllers, suite, out=out, robot=robot, seed=seed, workers=workers, backend=backend,
        trials=trials, realism=realism, physics=physics, overwrite=overwrite,
        console=terminal(stderr=json), allow=allow,
    )  # fmt: skip
    code = _raised(summary, out)
    if json:
        print_json(summary)
    if report:
        from poise.training.pictures.report.page import write_report

        write_report(out, console=terminal(stderr=json), allow=[*named(*controllers), *allow])
    return code


def _raised(summary: "Summary", out: Path) -> int:
    """Return the exit code: 1, with a line that tells the first error, if a controller raised."""
    if failed := sum(entry["errors"] for entry in summary["controllers"].values()):
        table = out / "trials.csv"
        with table.open(newline="", encoding="utf-8") as file:
            first = next(filter(None, (row["error"] for row in csv.DictReader(file))), "unknown")
        print(f"poise: a controller raised an error in {failed} trials, see the column error of "
              f"{table}; the first one: {first}", file=sys.stderr)  # fmt: skip
    return 1 if failed else 0


def tune(
    *,
    out: Path,
    config: str = "momentum-qp",
    controller: str | None = None,
    robot: str | None = None,
    policy: str | None = None,
    generations: int | None = None,
    minutes: float | None = None,
    seed: int | None = None,
    workers: int = 2,
    resume: Switch = False,
    allow: Allow = (),
) -> None:
    """Search a controller's gains by CMA-ES on seeded pushes, or on walks.

    Args:
        out: folder to write gains.yaml (a controller) and history.jsonl to.
        config: a packaged tuning configuration or a .yaml file: which gains, how far.
        controller: initial controller of the search: a packaged one or a .yaml file.
        robot: a packaged robot or a .yaml description.
        policy: a policy on top of the controller, which counts too.
        generations: number of generations; that of the configuration if not given.
        minutes: time limit of the search; --resume continues it.
        seed: seed of the search and its pushes.
        workers: number of processes.
        resume: continue the search in the folder.
    """
    from poise.baselines.allowance import named
    from poise.configs.files import resolve
    from poise.training.benchmarking.trials.names import check_name, check_names

    resolve("tuning", config)
    check_names(robot=robot)
    if policy is not None:
        check_name(policy)
    from poise.training.learning.tuning.search import tune, tune_config

    given = {"controller": controller, "robot": robot, "policy": policy,
             "generations": generations, "seed": seed}  # fmt: skip
    chosen = {name: value for name, value in given.items() if value is not None}
    permitted = [*named(controller), *allow]
    tune(tune_config(config, **chosen), out, workers, resume, terminal(), permitted, minutes)


def qp_set(
    *,
    out: Path,
    count: int = 1000,
    seed: int = 0,
    form: Literal["reduced", "full"] = "reduced",
    robot: OnRobot = "humanoid",
    controller: str = "momentum-qp",
) -> None:
    """Export whole-body QPs of real push recoveries, for qpsolvers and qpbenchmark.

    Args:
        out: folder to write to: new, or empty.
        count: number of problems; 25 of each trial.
        seed: seed of the pushes and starts.
        form: form of the QP: reduced (dense, inequalities only) or full (accelerations and
            wrenches, equalities).
        controller: a packaged controller or a .yaml file.
    """
    from poise.training.deploy.qp_set.export import write_qp_set

    manifest = write_qp_set(
        out, count=count, seed=seed, form=form, robot=robot, controller=controller
    )
    ends = [trial["end"] for trial in manifest["trials"]]
    counts = ", ".join(f"{ends.count(end)} {end}" for end in dict.fromkeys(ends))
    print(f"{out}: {count} problems of {len(ends)} trials ({counts})")


def robot(
    name: RobotName,
    /,
    *,
    out: Path | None = None,
    picture: Path | None = None,
    json: Json = False,
) -> None:
    """Check a robot description: torque margins, ankle limit, and faults to correct.

    Mass, soles, margins, torques to stand on both feet and on one, self-contacts, posture, two
    seconds at rest, which controllers support it, and pushes that a pendulum of its size resists.

    Of a model alone, .xml or .urdf, it guesses the description and writes it to the current folder.

    Args:
        name: a packaged robot (see poise list), a .yaml description, or a model.
        out: a JSON file to write the figures to.
        picture: a PNG file to write: the robot standing, its CoM, and its soles.
    """
    from json import dumps

    from poise.configs.files import write_atomic
    from poise.configs.outputs import check_out_file

    if out is not None:
        check_out_file(out)
    if picture is not None:
        from poise.envs.viewing.gl import choose_gl_backend

        check_out_file(picture, "picture")
        choose_gl_backend()
    from poise.training.deploy.robot_check.check import check_robot
    from poise.training.deploy.robot_check.tables import print_robot_check, summary
    from poise.training.deploy.robot_check.written import load_and_write

    loaded, written = load_and_write(name)
    if written is not None:
        print(f"{written}: a guessed description: edit it, and pass it to --robot")
    terminal(stderr=True).print(summary(loaded), markup=False, highlight=False)
    check = check_robot(loaded)
    print_robot_check(check, terminal(stderr=json))
    if json:
        print_json(check.to_json())
    if out is not None:
        write_atomic(out, dumps(check.to_json(), indent=2, ensure_ascii=False) + "\n")
        terminal(stderr=json).print(str(out), soft_wrap=True)
    if picture is not None:
        from poise.training.deploy.robot_check.picture import write_picture

        write_picture(loaded, picture)
        print(picture)


def motion() -> None:
    """Motion capture on a robot: info, convert, import, follow; `poise motion --help`."""
    raise AssertionError("main() answers this sub-command")


def policies() -> None:
    """Public policies of others: which are known, which are here; check FILE: what one lacks."""
    raise AssertionError("main() answers this sub-command")


def list_names(*, json: Json = False) -> None:
    """List what can be named: robots, controllers, policies with their J50, suites and the like."""
    from poise.baselines.extras import load_extra, missing_extra, registered
    from poise.training.running.options.names import names_by_kind, suites_of_j50
    from poise.training.running.options.pages import print_names

    further = {kind: missing_extra("names", kind) for kind in registered("names")}
    more = {kind: load_extra("names", kind)() for kind, extra in further.items() if extra is None}
    if json:
        print_json({**names_by_kind(), **more})
        return
    print_names(names_by_kind(), suites_of_j50(), terminal())
    for kind, names in more.items():
        print(f"{kind}: {', '.join(names)}")
    for kind, extra in further.items():
        if extra is not None:
            print(f"{kind}: none without poise[{extra}]")
    print("also as controllers: zero, a folder written by poise train, my_file.py:Class")


COMMANDS: dict[str, Callable[..., object]] = {
    "demo": demo,
    "train": train,
    "evaluate": evaluate,
    "benchmark": benchmark,
    "compare": compare,
    "leaderboard": leaderboard,
    "walk": walk,
    "gait": gait,
    "view": view,
    "replay": replay,
    "report": report,
    "gallery": gallery,
    "tune": tune,
    "qp-set": qp_set,
    "export": export,
    "policies": policies,
    "dataset": dataset,
    "robot": robot,
    "motion": motion,
    "list": list_names,
}
