"""The folder of a finished evaluation or benchmark, read back and checked."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from poise.configs.errors import ConfigError, shown
from poise.configs.reading import is_file, is_folder, read_json, read_table, read_yaml
from poise.training.benchmark.folder import LOG, BenchmarkSettings, read_benchmark_settings
from poise.training.evaluation.folder import Settings, read_settings
from poise.training.running.files import PARTIAL, SETTINGS, SUMMARY, TRIALS

from .flat import flat
from .values import number

NEEDED = ("trial", "controller", "seed", "body", "impulse", "direction", "duration",
          "limit_fraction", "recovered", "fallen", "fall_time")  # fmt: skip
FLAGS = {"True": True, "False": False}


@dataclass(frozen=True)
class Record:
    """How one controller fared in one trial.

    Attributes:
        trial, controller: which.
        recovered, fallen: whether.
        impulse [N·s], direction [deg], duration [s]: of the push; NaN without one.
        fraction: impulse over the limit of the suite; NaN without a push.
        fall_time: [s] after the reset; NaN without a fall.
        part: of a benchmark's suite; empty in an evaluation.
        error: what the controller raised, if it did.
        line: all columns of trials.csv, as they are written there.
    """

    trial: int
    controller: str
    recovered: bool
    fallen: bool
    impulse: float
    direction: float
    duration: float
    fraction: float
    fall_time: float
    line: Mapping[str, str]

    @property
    def part(self) -> str:
        return self.line.get("part", "")

    @property
    def error(self) -> str:
        return self.line.get("error", "")

    @property
    def push(self) -> tuple[str, ...]:
        """Equal for two controllers that met the same: trials of one number may differ."""
        return tuple(self.line[name] for name in ("trial", "seed", "impulse", "direction"))


@dataclass(frozen=True)
class Results:
    """What a folder holds.

    Attributes:
        folder: where it was read.
        settings: everything that decides the result.
        summary: summary.json; of a benchmark in the form of an evaluation's, see `flat`.
        records: of every trial and controller, as in trials.csv.
        source: summary.json as it is.
    """

    folder: Path
    settings: Settings | BenchmarkSettings
    summary: Mapping[str, Any]
    records: tuple[Record, ...]
    source: Mapping[str, Any]

    @property
    def reference(self) -> str:
        """The controller that others are compared with."""
        name = self.summary.get("reference")
        return name if name in self.controllers else self.controllers[0]

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts of a benchmark's suite; none for an evaluation."""
        return tuple(dict.fromkeys(record.part for record in self.records if record.part))

    @property
    def scale(self) -> str:
        """What `fraction` is a fraction of."""
        measured = isinstance(self.settings, Settings) and self.settings.limits is not None
        return "baseline's J50" if measured else "ankle limit"

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names, in the order of the evaluation."""
        return tuple(self.summary["controllers"])

    def of(self, controller: str) -> list[Record]:
        """All trials of a controller."""
        return [record for record in self.records if record.controller == controller]


def load_results(folder: str | Path) -> Results:
    """Read the folder of a finished evaluation or benchmark.

    Raises:
        ConfigError: no folder, no finished evaluation, or files that are cut off, do not parse or
            do not belong together.
    """
    folder = Path(folder)
    if not is_folder(folder):
        raise ConfigError("no such folder", source=folder)
    missing = [name for name in (SETTINGS, SUMMARY, TRIALS) if not is_file(folder / name)]
    if missing:
        stopped = (folder / PARTIAL).exists() or (folder / LOG).exists()
        why = "it was stopped: the command that began it goes on" if stopped else (
            f"holds no finished evaluation or benchmark: {', '.join(missing)} missing"
        )  # fmt: skip
        raise ConfigError(why, source=folder)
    path, records = folder / SUMMARY, _records(folder / TRIALS)
    settings: Settings | BenchmarkSettings
    source = summary = read_json(path)
    if "benchmark" in read_yaml(folder / SETTINGS):
        settings = read_benchmark_settings(folder)
        summary = flat(source, [record.line for record in records], str(path))
    else:
        settings = read_settings(folder)
    _check_summary(summary, path)
    _check(folder, settings, summary, records)
    return Results(folder, settings, summary, records, source)


def _check_summary(summary: Mapping[str, Any], path: Path) -> None:
    for name in ("suite", "robot"):
        if not isinstance(summary.get(name), str):
            raise ConfigError("must be a text", source=path, field=name)
    entries = summary.get("controllers")
    if not isinstance(entries, dict) or not entries:
        raise ConfigError("must be a mapping with an entry for each controller", source=path,
                          field="controllers")  # fmt: skip
    for name, entry in entries.items():
        if not isinstance(entry, dict):
            raise ConfigError("must be a mapping", source=path, field=f"controllers.{name}")
        _check_counts(entry, f"{path}: controllers.{name}")
    pairs = summary.get("pairs", [])
    if not isinstance(pairs, list) or not all(isinstance(pair, dict) for pair in pairs):
        raise ConfigError("must be a list of mappings", source=path, field="pairs")


def _check_counts(entry: Mapping[str, Any], where: str) -> None:
    trials, recovered = (number(entry, key, where, needed=True) for key in ("trials", "recovered"))
    number(entry, "recovered_rate", where, needed=True)
    if not (isinstance(trials, int) and isinstance(recovered, int) and 0 <= recovered <= trials):
        raise ConfigError(f"must be a whole number from 0 to trials, not {shown(recovered)}",
                          source=where, field="recovered")  # fmt: skip
    if trials == 0:
        raise ConfigError("must be at least 1", source=where, field="trials")


def _records(path: Path) -> tuple[Record, ...]:
    columns, lines = read_table(path)
    lacking = [name for name in NEEDED if name not in columns]
    if lacking:
        raise ConfigError(f"lacks the columns {', '.join(lacking)}", source=path)
    return tuple(_record(line, number, path) for number, line in enumerate(lines, 2))


def _record(line: Mapping[str, Any], number: int, path: Path) -> Record:
    try:
        impulse, direction, duration, fraction, fall_time = (
            float(line[name] or "nan")
            for name in ("impulse", "direction", "duration", "limit_fraction", "fall_time")
        )
        recovered, fallen = FLAGS[line["recovered"]], FLAGS[line["fallen"]]
        return Record(
            int(line["trial"]), line["controller"], recovered, fallen, impulse, direction, duration,
            fraction, fall_time, line,
        )  # fmt: skip
    except (ValueError, KeyError) as error:
        raise ConfigError(f"line {number} does not parse: {error}", source=path) from None


def _check(
    folder: Path,
    settings: Settings | BenchmarkSettings,
    summary: Mapping[str, Any],
    records: tuple[Record, ...],
) -> None:
    """The three files must tell of one and the same."""
    entries = summary["controllers"]
    if set(entries) != set(settings.controllers):
        raise ConfigError(f"its controllers are not those of {SETTINGS}", source=folder / SUMMARY,
                          field="controllers")  # fmt: skip
    counts = dict.fromkeys(entries, 0)
    for record in records:
        if record.controller not in counts:
            raise ConfigError(f"{shown(record.controller)} is not in {SUMMARY}",
                              source=folder / TRIALS, field="controller")  # fmt: skip
        counts[record.controller] += 1
    for name, entry in entries.items():
        expected = entry.get("played", entry["trials"])
        if counts[name] != expected:
            raise ConfigError(
                f"has {counts[name]} trials of {shown(name)}, but {SUMMARY} has "
                f"{shown(expected)}: cut off?",
                source=folder / TRIALS,
            )
