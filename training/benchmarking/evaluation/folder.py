"""The folder of a result: settings, finished trials, and at the end figures.

- settings.yaml: everything that decides the result
- trials.jsonl: a line for each finished trial; kept, so that controllers can be added later
- trials.csv: the same as a table, at the end
- summary.json: written last; with it, the result is finished
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from poise.configs.errors import ConfigError, shown
from poise.configs.files import write_atomic
from poise.configs.outputs import check_out_folder
from poise.configs.reading import exists
from poise.configs.schema import build, read_yaml, to_yaml
from poise.configs.spellings import respelled
from poise.configs.texts import check_shown
from poise.envs.physics.pushes.sampler import LimitTable
from poise.training.benchmarking.trials.table import COLUMNS
from poise.training.benchmarking.trials.trial import FORMER, Outcome
from poise.training.running.files import FILES, LOG, REPORT, SETTINGS, SUMMARY, TRIALS, csv_text
from poise.training.running.folder_lock import FolderLock
from poise.training.running.log import TrialLog, read_log
from poise.training.running.summary import Summary, check_format

ADVICE = "choose another folder, or replace it by --overwrite"
Key = tuple[str, int]  # controller, number of the trial


@dataclass(frozen=True)
class Settings:
    """Everything that determines a result, except the machine."""

    format: int  #: of the folder
    suite_name: str  #: as typed by the user
    suite: dict[str, Any]  #: its fields
    robot: str  #: name or path, as typed by the user
    robot_fingerprint: str  #: of the loaded robot
    seed: int = field(metadata={"min": 0})  #: of the trials
    limits: LimitTable | None  #: reference impulses of pushes; None: the ankle limit
    versions: dict[str, str]  #: of Python and the libraries
    controllers: dict[str, str]  #: name → fingerprint, in order of addition
    #: name → hash of the motions that are performed
    motions: dict[str, str] = field(default_factory=dict, metadata={"omit": "default"})


class ResultFolder:
    """Open a new, an interrupted or a finished result.

    `finished` holds the outcomes found in the folder by controller and number, `settings` the given
    ones with the folder's other controllers, `damaged` the number of unreadable lines.

    Args:
        path: the folder; made if missing.
        settings: of this result.
        overwrite: remove what an earlier result has left there.
        closed: whether no controllers can be added, as trials depend on the set of controllers.
        ready: called with the settings of the whole folder before anything is written; what it
            raises leaves the folder unchanged.

    Raises:
        ConfigError: the folder holds something else, and `overwrite` is off; nothing is written.
        PoiseError: the folder cannot be written, or another process writes there.
    """

    def __init__(
        self, path: Path, settings: Settings, overwrite: bool = False, closed: bool = False,
        ready: Callable[[Settings], object] | None = None,
    ):  # fmt: skip
        self.path, self.settings, self.damaged = path, settings, 0
        self.finished: dict[Key, Outcome] = {}
        check_out_folder(path)
        self._lock = FolderLock(path)
        try:
            if overwrite:
                for name in (*FILES, REPORT):
                    (path / name).unlink(missing_ok=True)
            elif holds_files(path):
                controllers = {**self._check(closed).controllers, **settings.controllers}
                self.settings = replace(settings, controllers=controllers)
                self.finished, self.damaged = read_outcomes(path)
            if ready is not None:
                ready(self.settings)
            write_atomic(path / SETTINGS, to_yaml(self.settings))
            entries = {key: asdict(outcome) for key, outcome in self.finished.items()}
            self._log = TrialLog(path / LOG, entries)
        except BaseException:
            self._lock.release()
            raise

    def append(self, controller: str, number: int, outcome: Outcome) -> None:
        """Keep the outcome of a trial; raises PoiseError when the disk refuses."""
        self._log.append((controller, number), asdict(outcome))
        self.finished[controller, number] = outcome

    def close(self) -> None:
        """Close the folder; finished trials stay."""
        self._log.close()
        self._lock.release()

    def finish(self, rows: Sequence[Mapping[str, object]], summary: Summary) -> None:
        """Write the trials, then the summary."""
        write_atomic(self.path / TRIALS, csv_text(rows, COLUMNS))
        write_atomic(self.path / SUMMARY, json.dumps(summary, indent=1, allow_nan=False) + "\n")
        self.close()

    def _check(self, closed: bool) -> Settings:
        """Raise ConfigError unless the folder holds this result; return its settings."""
        path = self.path
        fixed = [name for name in Settings.__dataclass_fields__ if closed or name != "controllers"]
        before = _check_same(path, {name: getattr(self.settings, name) for name in fixed})
        for name, mark in self.settings.controllers.items():
            if before.controllers.get(name, mark) != mark:
                raise ConfigError(
                    f"holds trials of another {shown(name)}, which has changed since: {ADVICE}",
                    source=path / SETTINGS, field="controllers",
                )  # fmt: skip
        if (path / SUMMARY).exists() and not (path / LOG).exists():
            raise ConfigError(f"is missing, and with it the trials: {ADVICE}", source=path / LOG)
        return before


def check_folder(path: Path, known: Mapping[str, object], overwrite: bool) -> None:
    """Raise the errors of `ResultFolder` for the settings `known`, before anything is loaded.

    Raises ConfigError and PoiseError as `ResultFolder`.
    """
    check_out_folder(path)
    if not overwrite and holds_files(path):
        _check_same(path, known)


def holds_files(path: Path) -> bool:
    """Return whether a folder holds files of the names that a result has."""
    return any(exists(path / name) for name in FILES)


def _check_same(path: Path, known: Mapping[str, object]) -> Settings:
    """Raise ConfigError unless the result has the settings `known`; return all of them."""
    if not (path / SETTINGS).exists():
        raise ConfigError(f"holds files of something else: {ADVICE}", source=path, field="out")
    before = read_settings(path)
    for name, new in known.items():
        if (old := getattr(before, name)) != new:
            raise ConfigError(
                f"holds a result with {_difference(name, old, new)}: {ADVICE}",
                source=path / SETTINGS, field=name,
            )  # fmt: skip
    return before


def read_outcomes(folder: Path) -> tuple[dict[Key, Outcome], int]:
    """Return outcomes by controller and number, and how many lines could not be read."""
    path = folder / LOG
    entries, damaged = read_log(path)
    values = respelled([value for _, value in entries], FORMER, path)
    finished: dict[Key, Outcome] = {}
    for (key, _), value in zip(entries, values, strict=True):
        try:
            controller, number = key
            finished[str(controller), int(number)] = build(Outcome, value, str(path))
        except (ValueError, TypeError, ConfigError):
            damaged += 1
    return finished, damaged


def read_settings(folder: Path) -> Settings:
    """Return the settings of a result; raise ConfigError where they are missing or of another
    format."""
    path = folder / SETTINGS
    data = read_yaml(path)
    check_format(data.get("format"), path)
    settings = build(Settings, data, str(path))
    for name in settings.controllers:
        check_shown(name, path, "controllers")
    return settings


def _difference(name: str, old: object, new: object) -> str:
    """Return the difference in words."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = [k for k in {**old, **new} if old.get(k) != new.get(k)]
        what = ", ".join(f"{k} {old.get(k)}, not {new.get(k)}" for k in keys)
        return f"other {name} ({what if name == 'versions' else ', '.join(keys)})"
    if name == "limits":
        return "other limits"
    return f"{name} {shown(old)}, not {shown(new)}"
