"""The folder of a finished result, read back and checked."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import cast

from poise.configs.errors import ConfigError, shown
from poise.configs.reading import is_file, is_folder, read_table
from poise.configs.spellings import respelled
from poise.training.benchmarking.diagnosis.diagnosis import COLUMNS as DIAGNOSIS_COLUMNS
from poise.training.benchmarking.diagnosis.words import diagnosis_of, why
from poise.training.benchmarking.evaluation.folder import Settings, read_settings
from poise.training.benchmarking.metrics.evaluated import RATED, WALK_PUSH
from poise.training.benchmarking.suites.plan import LEVEL
from poise.training.benchmarking.trials.table import CASE_COLUMNS, COLUMNS, read_trial
from poise.training.benchmarking.trials.trial import FORMER, Trial
from poise.training.running.files import LOG, SETTINGS, SUMMARY, TRIALS
from poise.training.running.summary import Entry, Summary

from .judged_again import judged_again
from .summary import MARGIN, read_summary

#: columns that older results lack
LATER = (*DIAGNOSIS_COLUMNS, "until", "own_speed_error", "own_turn_error", "last_speed_error",
         "last_turn_error")  # fmt: skip
FLAGS = {"True": True, "False": False}


@dataclass(frozen=True)
class Record:
    """A controller in a trial: a line of trials.csv."""

    trial: int
    controller: str
    recovered: bool
    fallen: bool
    impulse: float  #: of the first push [N·s]; NaN without one, as the next two
    direction: float  #: [deg]
    duration: float  #: [s]
    fraction: float  #: impulse over the limit of the suite; NaN where it has none
    fall_time: float  #: [s] after the reset; NaN without a fall
    start: float | None  #: of the first push [s]; None without one
    #: why it was lost, in words; empty for a recovered trial and in older results
    why: str
    line: Mapping[str, str]  #: all columns of trials.csv, as they are written there

    @property
    def part(self) -> str:
        """The part of the suite."""
        return self.line["part"]

    @property
    def error(self) -> str:
        """The error that the controller raised, or nothing."""
        return self.line["error"]

    @property
    def upright(self) -> bool:
        """Not fallen, and the controller has not raised."""
        return not self.fallen and not self.error

    @property
    def fell_first(self) -> bool:
        """Whether it fell before the first push."""
        return self.start is not None and self.fall_time < self.start

    @property
    def won(self) -> bool:
        """What J50, rankings and pairs count, see `training/benchmarking/trials/trial.py`."""
        return self.upright if self.judged_by_falls else self.recovered

    @property
    def judged_by_falls(self) -> bool:
        """Whether it is a walk on level ground, see `Trial.judged_by_falls`."""
        return bool(self.line.get("commands")) and not self.line.get("terrain")

    @property
    def met_by_all(self) -> bool:
        """Whether it is not one of the second stage of pushed walks."""
        return self.part != WALK_PUSH or self.line["stage"] == "1"

    @cached_property
    def met(self) -> tuple[str, ...]:
        """Key of the trial's content: trials of one number may differ between controllers."""
        return tuple(self.line.get(name, "") for name in CASE_COLUMNS if name != "controller")


@dataclass(frozen=True)
class Results:
    """The content of a result's folder."""

    folder: Path  #: where it was read
    settings: Settings  #: everything that decides the result
    summary: Summary  #: summary.json
    records: tuple[Record, ...]  #: of every trial and controller, as in trials.csv

    @property
    def reference(self) -> str:
        """The controller that others are compared with."""
        return self.summary["reference"]

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts of the suite."""
        return tuple(dict.fromkeys(record.part for record in self.records))

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names, in the order in which they came."""
        return tuple(self.summary["controllers"])

    def of(self, controller: str) -> list[Record]:
        """All trials of a controller."""
        return [record for record in self.records if record.controller == controller]

    def record(self, controller: str, trial: int) -> Record:
        """Return the line of a controller in a trial; raise ConfigError where there is none."""
        if controller not in self.controllers:
            raise ConfigError(f"{shown(controller)} took no part", source=self.folder,
                              field="controller", choices=self.controllers)  # fmt: skip
        numbers = {record.trial: record for record in self.of(controller)}
        if trial not in numbers:
            raise ConfigError(f"no trial {trial}; they are numbered from 0 to {max(numbers)}",
                              source=self.folder / TRIALS, field="trial")  # fmt: skip
        return numbers[trial]

    def trial(self, record: Record) -> Trial:
        """Return the trial of a record, exactly; raise ConfigError where its line does not
        parse."""
        return read_trial(record.line, self.folder / TRIALS)


def load_results(folder: str | Path) -> Results:
    """Read the folder of a finished result of `evaluate` or `benchmark`.

    Where controllers are being added, or this was stopped, it is that of those that are finished.
    Walks of an older result are judged again, see `judged_again`.

    Raises:
        ConfigError: no folder, no finished result, one of another format, or files that are cut
            off, do not parse or do not belong together.
    """
    folder = Path(folder)
    if not is_folder(folder):
        raise ConfigError("no such folder", source=folder)
    missing = [name for name in (SETTINGS, SUMMARY, TRIALS) if not is_file(folder / name)]
    if missing:
        why = f"holds no finished result: {', '.join(missing)} missing"
        why += "; run the command that began it to continue" if is_file(folder / LOG) else ""
        raise ConfigError(why, source=folder)
    settings, summary = read_settings(folder), read_summary(folder / SUMMARY)
    added = settings.controllers.keys() - summary["controllers"].keys()  # not yet finished
    records = tuple(r for r in _records(folder / TRIALS) if r.controller not in added)
    _check(folder, settings, summary, records)
    summary = judged_again(folder, settings, summary, [record.line for record in records])
    marks = {name: mark for name, mark in settings.controllers.items() if name not in added}
    return Results(folder, replace(settings, controllers=marks), summary, records)


def _records(path: Path) -> tuple[Record, ...]:
    columns, lines = read_table(path, ": run the same command again, it rewrites the file "
                                "without running a trial")  # fmt: skip
    lines = respelled(lines, FORMER, path)
    columns = tuple(FORMER.get(name, name) for name in columns)
    lacking = [name for name in COLUMNS if name not in (*columns, *LATER)]
    if lacking:
        raise ConfigError(f"lacks the columns {', '.join(lacking)}", source=path)
    return tuple(_record(line, number, path) for number, line in enumerate(lines, 2))


def _record(line: Mapping[str, str], number: int, path: Path) -> Record:
    try:
        impulse, direction, duration, fraction, fall_time = (
            float(line[name] or "nan")
            for name in ("impulse", "direction", "duration", "limit_fraction", "fall_time")
        )
        recovered, fallen = FLAGS[line["recovered"]], FLAGS[line["fallen"]]
        start = float(line["start"]) if line["start"] else None
        if start is not None and not math.isfinite(start):
            raise ValueError(f"start: must be finite, not {start}")
        reason = why(diagnosis_of(line), fall_time if math.isfinite(fall_time) else None)
        int(line["seed"])  # a report prints it
        return Record(
            int(line["trial"]), line["controller"], recovered, fallen, impulse, direction, duration,
            fraction, fall_time, start, reason, line,
        )  # fmt: skip
    except (ValueError, KeyError) as error:
        raise ConfigError(f"line {number} does not parse: {error}", source=path) from None


def _check(folder: Path, settings: Settings, summary: Summary, records: tuple[Record, ...]) -> None:
    """Raise ConfigError unless the three files belong to one result."""
    entries = summary["controllers"]
    if not entries.keys() <= settings.controllers.keys():
        raise ConfigError(f"its controllers are not those of {SETTINGS}", source=folder / SUMMARY,
                          field="controllers")  # fmt: skip
    counts = dict.fromkeys(entries, 0)
    for record in records:
        if record.controller not in counts:
            raise ConfigError(f"{shown(record.controller)} is not in {SUMMARY}",
                              source=folder / TRIALS, field="controller")  # fmt: skip
        counts[record.controller] += 1
    if summary["seed"] != settings.seed:
        raise ConfigError(f"is {summary['seed']}, but {SETTINGS} has {settings.seed}",
                          source=folder / SUMMARY, field="seed")  # fmt: skip
    for name, entry in entries.items():
        if counts[name] != entry["evaluated"]:
            raise ConfigError(
                f"has {counts[name]} trials of {shown(name)}, but {SUMMARY} has "
                f"{entry['evaluated']}: cut off?",
                source=folder / TRIALS,
            )
        _check_rate(folder, name, entry, [r for r in records if r.controller == name])


def _check_rate(folder: Path, name: str, entry: Entry, records: Sequence[Record]) -> None:
    """Raise ConfigError unless the counts of a controller are those of its trials."""
    own = [r for r in records if LEVEL not in r.part and r.met_by_all]
    own = [r for r in own if r.part in RATED] or own
    counted = {
        "trials": len(own),
        "recovered": sum(r.recovered for r in own),
        "fallen": sum(r.fallen for r in own),
        "never_fell_rate": sum(r.upright for r in own) / max(len(own), 1),
    }
    for key, found in counted.items():
        written = cast("float | None", entry.get(key))  # older results lack some
        if written is not None and abs(written - found) > MARGIN:
            why = f"is {written:.6g}, but {TRIALS} has {found:.6g}"
            raise ConfigError(why, source=folder / SUMMARY, field=f"controllers.{name}.{key}")
