"""Reading a finished benchmark back: its figures, its trials, and a trial played again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from poise.baselines.allowance import allowing
from poise.configs.errors import ConfigError, shown
from poise.configs.reading import is_file, parsing, read_json, read_table
from poise.configs.schema import build
from poise.envs.balance.base import BalanceEnv
from poise.envs.pushes.push import Push
from poise.envs.robots.robot import load_robot
from poise.training.benchmark.case import COLUMNS, Case, Result
from poise.training.benchmark.folder import FORMAT, BenchmarkSettings, read_benchmark_settings
from poise.training.benchmark.suite import BenchmarkSuite
from poise.training.benchmark.world import BenchmarkPlayer, play_case
from poise.training.running.files import SETTINGS, SUMMARY, TRIALS
from poise.training.trials.players import Player, load_player
from poise.training.trials.trial import PUSH_COLUMNS

from .summary_form import check_form


@dataclass(frozen=True)
class BenchmarkData:
    """A finished benchmark.

    Attributes:
        folder: where it lies.
        settings: what decided it.
        summary: the figures, as in summary.json.
        rows: the lines of trials.csv, texts by column.
    """

    folder: Path
    settings: BenchmarkSettings
    summary: dict[str, Any]
    rows: list[dict[str, str]]

    def row(self, controller: str, trial: int) -> dict[str, str]:
        """The line of a trial; raises ConfigError where there is none."""
        for line in self.rows:
            if line["controller"] == controller and line["trial"] == str(trial):
                return line
        with parsing(self.folder / TRIALS):
            numbers = [int(row["trial"]) for row in self.rows if row["controller"] == controller]
        if not numbers:
            raise ConfigError(f"{shown(controller)} took no part", source=self.folder,
                              field="controller", choices=self.settings.controllers)  # fmt: skip
        raise ConfigError(f"no trial {trial}; they are numbered from 0 to {max(numbers)}",
                          source=self.folder, field="trial")  # fmt: skip


def is_benchmark(folder: str | Path) -> bool:
    """Whether a folder was written by `poise benchmark`, finished or not."""
    try:
        read_benchmark_settings(Path(folder))
    except ConfigError:
        return False
    return True


def load_benchmark_data(folder: str | Path) -> BenchmarkData:
    """A finished benchmark; raises ConfigError, naming the file, for anything else."""
    folder = Path(folder)
    settings = read_benchmark_settings(folder)
    summary = read_summary(folder / SUMMARY)
    path = folder / TRIALS
    again = "run the same poise benchmark again, it writes the file anew without playing a trial"
    columns, rows = read_table(path, f": {again}")
    if columns != COLUMNS:
        raise ConfigError("has other columns than poise benchmark writes", source=path)
    expected = sum(entry["trials"] for entry in summary["controllers"].values())
    if len(rows) != expected:
        raise ConfigError(f"has {len(rows)} trials instead of {expected}: {again}", source=path)
    return BenchmarkData(folder, settings, summary, rows)


def read_summary(path: str | Path) -> dict[str, Any]:
    """A summary.json of a benchmark; raises ConfigError."""
    path = Path(path)
    if not is_file(path):
        raise ConfigError("cannot be read (no such file): not a finished benchmark", source=path)
    summary = read_json(path)
    if summary.get("benchmark") != FORMAT:
        raise ConfigError(f"is not a benchmark's summary of format {FORMAT}", source=path)
    check_form(summary, path)
    return summary


def read_case(line: Mapping[str, str], source: str | Path = TRIALS) -> Case:
    """The case of a line of trials.csv; numbers read back exactly as they were."""
    try:
        data: dict[str, Any] = {
            key: line[key] if key in ("body", "profile") else float(line[key])
            for key in PUSH_COLUMNS
        }
        data["point"] = [data.pop(key) for key in ("point_x", "point_y", "point_z")]
        return Case(
            number=int(line["trial"]),
            seed=int(line["seed"]),
            push=build(Push, data, str(source)),
            limit_fraction=float(line["limit_fraction"]),
            stage=int(line["stage"]),
            part=line["part"],  # type: ignore[arg-type]
            factor=line["factor"] or None,
            level=line["level"] or None,
            friction=float(line["friction"]) if line["friction"] else None,
            delay=float(line["delay"]),
            mass_error=float(line["mass_error"]),
            pushes=int(line["pushes"]),
            interval=float(line["interval"]),
        )
    except ValueError as error:
        raise ConfigError(f"trial {line['trial']} does not parse: {error}", source=source) from None


def player_of(data: BenchmarkData, controller: str) -> BenchmarkPlayer:
    """A controller as it took part; raises ConfigError if it or the robot has changed since."""
    settings = data.settings
    if controller not in settings.controllers:
        raise ConfigError(f"{shown(controller)} took no part", source=data.folder,
                          field="controller", choices=settings.controllers)  # fmt: skip
    robot = load_robot(settings.robot)
    if robot.fingerprint != settings.robot_fingerprint:
        raise ConfigError(f"the robot {shown(settings.robot)} has changed since",
                          source=data.folder, field="robot_fingerprint")  # fmt: skip
    suite = build(BenchmarkSuite, settings.suite, str(data.folder))
    with allowing(source=data.folder / SETTINGS):
        player = load_player(
            controller, robot, duration=suite.duration, pushes=None, noise=suite.noise
        )
    if player.fingerprint != settings.controllers[controller]:
        raise ConfigError(f"the controller {shown(controller)} has changed since",
                          source=data.folder, field="controllers")  # fmt: skip
    return BenchmarkPlayer(player)


def replay_case(
    data: BenchmarkData,
    controller: str,
    trial: int,
    watch: Callable[[BalanceEnv], Any] | None = None,
) -> tuple[Case, Result, Player]:
    """Play a trial again, exactly; `watch(env)` is called after the reset and after every step.

    Returns the case, the result of now, and the player, whose `env` has the world of the case
    (`video.record(player.env, player.act, path, {"seed": case.seed, "options": case.options})`).
    """
    case = read_case(data.row(controller, trial), data.folder / TRIALS)
    player = player_of(data, controller)
    result = play_case(player, case, watch)
    return case, result, player.prepare(case)
