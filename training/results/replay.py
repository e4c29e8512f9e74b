"""Playing one trial of an evaluation again, exactly, from its folder."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from poise.baselines.allowance import allowing
from poise.configs.errors import ConfigError, shown
from poise.configs.reading import is_file, parse_json, parsing, read_table
from poise.configs.schema import build
from poise.envs.balance.base import BalanceEnv
from poise.envs.pushes.push import Push
from poise.envs.robots.robot import load_robot
from poise.training.evaluation.folder import Settings, read_settings
from poise.training.running.files import SETTINGS, SUMMARY, TRIALS
from poise.training.suites.registry import build_suite
from poise.training.trials.players import Player, load_player
from poise.training.trials.signals import Signals
from poise.training.trials.trial import COLUMNS, PUSH_COLUMNS, Outcome, Trial, run_trial

from .benchmark import is_benchmark, load_benchmark_data, player_of, read_case


@dataclass(frozen=True)
class Replay:
    """A trial played again.

    Attributes:
        trial: the trial.
        controller: who played it.
        outcome: of now.
        differences: outcome → (recorded, now), for those that differ.
    """

    trial: Trial
    controller: str
    outcome: Outcome
    differences: dict[str, tuple[str, str]]


def replay(
    folder: str | Path,
    trial: int,
    controller: str | None = None,
    *,
    video: str | Path | None = None,
    plot: str | Path | None = None,
    watch: Callable[[BalanceEnv], Any] | None = None,
    allow: str | Iterable[str] = (),
) -> Replay:
    """Play a trial of an evaluation or a benchmark again and compare it with what was recorded.

    Args:
        folder: written by `evaluate` or `benchmark`.
        trial: its number in trials.csv.
        controller: one of the evaluation's; None: the last, which is the first if it is alone.
        video: an MP4 file to write.
        plot: a PNG file to write: CoM, CoP, capture point and torque over time.
        watch: called with the environment after the reset and after every step.
        allow: controllers from outside (``module:Class``) that may run.

    Raises:
        ConfigError: no evaluation there, no such trial or controller, or a controller or robot
            that is no longer the one that was evaluated, or may not run.
        PoiseError: nothing can be drawn here, or a file cannot be written.
    """
    find = _of_benchmark if is_benchmark(folder) else _of_evaluation
    with allowing(allow, source=Path(folder) / SETTINGS):
        name, line, again, player = find(Path(folder), trial, controller)
    signals = Signals() if plot is not None else None
    watches = [each for each in (signals, watch) if each is not None]
    outcome = run_trial(player, again, lambda env: [each(env) for each in watches])
    differences = {
        key: (line[key], text)
        for key, value in asdict(outcome).items()
        if line[key] != (text := "" if value is None else str(value))
    }
    if plot is not None and signals is not None:
        _draw(signals, Path(plot), again, f"Trial {trial}, {name}")
    if video is not None:
        from poise.training.figures.video import record

        record(player.env, player.act, video, {"seed": again.seed, "options": again.options})
    return Replay(again, name, outcome, differences)


Found = tuple[str, Mapping[str, str], Trial, Player]


def _of_evaluation(folder: Path, trial: int, controller: str | None) -> Found:
    settings = read_settings(folder)
    name = _choose(folder, settings.controllers, controller)
    line = _find(folder, trial, name)
    return name, line, _trial(line, folder / TRIALS), _player(settings, name, folder)


def _of_benchmark(folder: Path, trial: int, controller: str | None) -> Found:
    data = load_benchmark_data(folder)
    name = _choose(folder, data.settings.controllers, controller)
    line = data.row(name, trial)
    case = read_case(line, folder / TRIALS)
    return name, line, case, player_of(data, name).prepare(case)


def _choose(folder: Path, names: Mapping[str, str], controller: str | None) -> str:
    """The controller asked for, else the last."""
    name = tuple(names)[-1] if controller is None else controller
    if name not in names:
        raise ConfigError(f"{shown(name)} was not evaluated", source=folder, field="controller",
                          choices=names)  # fmt: skip
    return name


def _find(folder: Path, trial: int, controller: str) -> Mapping[str, str]:
    """The line of trials.csv."""
    path = folder / TRIALS
    if not is_file(folder / SUMMARY) or not is_file(path):
        raise ConfigError("holds no finished evaluation", source=folder)
    columns, lines = read_table(path)
    if columns != COLUMNS:
        raise ConfigError("has other columns than poise evaluate writes", source=path)
    for line in lines:
        if line["trial"] == str(trial) and line["controller"] == controller:
            return line
    with parsing(path):
        last = max((int(line["trial"]) for line in lines), default=-1)
    raise ConfigError(f"no trial {trial}; they are numbered from 0 to {last}", source=path,
                      field="trial")  # fmt: skip


def _trial(line: Mapping[str, str], path: Path) -> Trial:
    """The trial of a line; numbers read back exactly as they were."""
    push = None
    try:
        if line["body"]:
            data: dict[str, Any] = {
                key: line[key] if key in ("body", "profile") else float(line[key])
                for key in PUSH_COLUMNS
            }
            data["point"] = [data.pop(key) for key in ("point_x", "point_y", "point_z")]
            push = build(Push, data, str(path))
        fraction = float(line["limit_fraction"]) if line["limit_fraction"] else None
        rest = parse_json(line["later"]) if line["later"] else []
        later = tuple(build(Push, push, str(path)) for push in rest)
        number, seed, stage = (int(line[key]) for key in ("trial", "seed", "stage"))
        return Trial(number, seed, push, fraction, stage, later)
    except (ValueError, TypeError) as error:
        raise ConfigError(f"trial {line['trial']} does not parse: {error}", source=path) from None


def _player(settings: Settings, name: str, folder: Path) -> Player:
    """The controller as it was evaluated."""
    robot = load_robot(settings.robot)
    if robot.fingerprint != settings.robot_fingerprint:
        raise ConfigError(f"the robot {shown(settings.robot)} has changed since", source=folder,
                          field="robot_fingerprint")  # fmt: skip
    suite = build_suite(settings.suite, str(folder))
    player = load_player(name, robot, duration=suite.duration, pushes=None, noise=suite.noise)
    if player.fingerprint != settings.controllers[name]:
        raise ConfigError(f"the controller {shown(name)} has changed since", source=folder,
                          field="controllers")  # fmt: skip
    return player


def _draw(signals: Signals, path: Path, trial: Trial, title: str) -> None:
    from poise.training.figures.time_series import trial_timeseries

    shown = {k: v for k, v in signals.columns.items() if k != "angular_momentum"}
    pushes = [(push.start, push.duration) for push in trial.options["push"]]
    trial_timeseries(path, signals.t, shown, pushes=pushes, title=title)
