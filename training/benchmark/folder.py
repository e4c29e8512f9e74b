"""The folder of a benchmark: settings, finished trials, and at the end figures.

- settings.yaml: everything that decides the result
- trials.jsonl: a line for each finished trial; kept, so that controllers can be added later
- trials.csv: the same as a table, at the end
- summary.json: written last
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from poise.configs.errors import ConfigError, shown
from poise.configs.files import write_atomic
from poise.configs.reading import exists, is_folder
from poise.configs.schema import build, read_yaml, to_yaml
from poise.training.running.files import REPORT, SETTINGS, SUMMARY, TRIALS, csv_text
from poise.training.running.folder_lock import FolderLock
from poise.training.running.log import TrialLog, read_log

from .case import COLUMNS, Result

LOG = "trials.jsonl"
FILES = (SUMMARY, SETTINGS, LOG, TRIALS)
FORMAT = 1  # of the folder; a reader refuses others
ADVICE = "choose another folder, or replace it by --overwrite"
Key = tuple[str, int]  # controller, number of the case


@dataclass(frozen=True)
class BenchmarkSettings:
    """Everything that decides a benchmark's result, but for the machine.

    Attributes:
        benchmark: format of the folder.
        suite_name: as the user wrote it; `suite` holds its fields.
        robot: name or path, as the user wrote it; `robot_fingerprint` of what was loaded.
        seed: of the cases.
        versions: of what computes the result.
        controllers: name → fingerprint, in the order in which they came.
    """

    benchmark: int
    suite_name: str
    suite: dict[str, Any]
    robot: str
    robot_fingerprint: str
    seed: int = field(metadata={"min": 0})
    versions: dict[str, str]
    controllers: dict[str, str]


class BenchmarkFolder:
    """Opens a new, an interrupted or a finished benchmark.

    `finished` holds the results that were there, by controller and number; `settings` the given
    ones, with the controllers that the folder has besides; `damaged` counts unreadable lines.

    Args:
        path: the folder; made if missing.
        settings: of this benchmark.
        overwrite: remove what an earlier benchmark has left there.

    Raises:
        ConfigError: the folder holds something else, and `overwrite` is off; nothing is written.
        PoiseError: the folder cannot be written.
    """

    def __init__(self, path: Path, settings: BenchmarkSettings, overwrite: bool = False):
        self.path, self.settings, self.damaged = path, settings, 0
        self.finished: dict[Key, Result] = {}
        if exists(path) and not is_folder(path):
            raise ConfigError("is not a folder", source=path, field="out")
        self._lock = FolderLock(path)
        try:
            self._open(overwrite)
        except BaseException:
            self._lock.release()
            raise

    def _open(self, overwrite: bool) -> None:
        path, settings = self.path, self.settings
        if overwrite:
            for name in (*FILES, REPORT):
                (path / name).unlink(missing_ok=True)
        elif any(exists(path / name) for name in FILES):
            before = self._check()
            self.settings = replace(
                settings, controllers={**before.controllers, **settings.controllers}
            )
            self.finished, self.damaged = read_results(path)
        write_atomic(path / SETTINGS, to_yaml(self.settings))
        entries = {key: asdict(result) for key, result in self.finished.items()}
        self._log = TrialLog(path / LOG, entries)

    def append(self, controller: str, number: int, result: Result) -> None:
        """Keep the result of a trial; raises PoiseError when the disk refuses."""
        self._log.append((controller, number), asdict(result))
        self.finished[controller, number] = result

    def close(self) -> None:
        """Stop; what is finished stays."""
        self._log.close()
        self._lock.release()

    def finish(self, rows: Sequence[dict[str, Any]], summary: dict[str, Any]) -> None:
        """Write the trials and, last, the summary."""
        write_atomic(self.path / TRIALS, csv_text(rows, COLUMNS))
        write_atomic(self.path / SUMMARY, json.dumps(summary, indent=1, allow_nan=False) + "\n")
        self.close()

    def _check(self) -> BenchmarkSettings:
        """Refuse to go on from anything but this benchmark; returns its settings."""
        path = self.path
        if not (path / SETTINGS).exists():
            raise ConfigError(f"holds files of something else: {ADVICE}", source=path, field="out")
        before = read_benchmark_settings(path)
        names = [n for n in BenchmarkSettings.__dataclass_fields__ if n != "controllers"]
        for name in names:
            old, new = getattr(before, name), getattr(self.settings, name)
            if old != new:
                raise ConfigError(
                    f"holds a benchmark with {_difference(name, old, new)}: {ADVICE}",
                    source=path / SETTINGS, field=name,
                )  # fmt: skip
        for name, mark in self.settings.controllers.items():
            if before.controllers.get(name, mark) != mark:
                raise ConfigError(
                    f"holds trials of another {shown(name)}, which has changed since: {ADVICE}",
                    source=path / SETTINGS, field="controllers",
                )  # fmt: skip
        if (path / SUMMARY).exists() and not (path / LOG).exists():
            raise ConfigError(f"is missing, and with it the trials: {ADVICE}", source=path / LOG)
        return before


def read_results(folder: Path) -> tuple[dict[Key, Result], int]:
    """Results by controller and number, and how many lines could not be read."""
    path = folder / LOG
    entries, damaged = read_log(path)
    finished: dict[Key, Result] = {}
    for key, value in entries:
        try:
            controller, number = key
            finished[str(controller), int(number)] = build(Result, value, str(path))
        except (ValueError, TypeError, ConfigError):
            damaged += 1
    return finished, damaged


def read_benchmark_settings(folder: Path) -> BenchmarkSettings:
    """The settings of a benchmark; raises ConfigError where there are none, or of another kind."""
    path = folder / SETTINGS
    data = read_yaml(path)
    if "benchmark" not in data:
        raise ConfigError("is not of poise benchmark", source=path)
    if data["benchmark"] != FORMAT:
        raise ConfigError(
            f"is of format {data['benchmark']}, this version of Poise reads {FORMAT}",
            source=path, field="benchmark",
        )  # fmt: skip
    return build(BenchmarkSettings, data, str(path))


def _difference(name: str, old: Any, new: Any) -> str:
    """What differs, in words."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [k for k in {**old, **new} if old.get(k) != new.get(k)]
        what = ", ".join(f"{k} {old.get(k)}, not {new.get(k)}" for k in keys)
        return f"other {name} ({what if name == 'versions' else ', '.join(keys)})"
    return f"{name} {shown(old)}, not {shown(new)}"
