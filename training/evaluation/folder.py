"""The folder of an evaluation: its settings, its finished trials, and what is left of a stop.

- settings.yaml: everything that decides the result
- trials.partial.jsonl: a line for each finished trial, while the evaluation runs
- trials.csv: a line for each trial and controller, at the end
- summary.json: written last; with it, the evaluation is finished
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.reading import exists, is_folder
from poise.configs.schema import build, read_yaml, to_yaml
from poise.envs.pushes.sampler import LimitTable
from poise.training.running.files import FILES, PARTIAL, REPORT, SETTINGS, SUMMARY, TRIALS, csv_text
from poise.training.running.folder_lock import FolderLock
from poise.training.running.log import TrialLog, read_log
from poise.training.trials.trial import COLUMNS, Outcome


@dataclass(frozen=True)
class Settings:
    """Everything that decides an evaluation's result, but for the machine.

    Attributes:
        suite_name: as the user wrote it; `suite` holds its fields.
        robot: name or path, as the user wrote it; `robot_fingerprint` of what was loaded.
        controllers: name → fingerprint, in the user's order.
        seed: of the trials.
        limits: what the suite's pushes are measured by; None: the ankle limit.
        versions: of what computes the result.
    """

    suite_name: str
    suite: dict[str, Any]
    robot: str
    robot_fingerprint: str
    controllers: dict[str, str]
    seed: int = field(metadata={"min": 0})
    limits: LimitTable | None
    versions: dict[str, str]


class EvaluationFolder:
    """Opens a new or an interrupted evaluation.

    `finished` holds the outcomes that an interrupted one has left, by trial number.

    Args:
        path: the folder; made if missing.
        settings: of this evaluation.
        overwrite: remove what an earlier evaluation has left there.

    Raises:
        ConfigError: the folder holds another or a finished evaluation, and `overwrite` is off.
        PoiseError: the folder cannot be written, or another process writes there.
    """

    def __init__(self, path: Path, settings: Settings, overwrite: bool = False):
        self.path, self.settings = path, settings
        self.finished: dict[int, list[Outcome]] = {}
        self._partial: TrialLog | None = None
        if exists(path) and not is_folder(path):
            raise ConfigError("is not a folder", source=path, field="out")
        self._lock = FolderLock(path)
        try:
            self._open(overwrite)
        except BaseException:
            self._lock.release()
            raise

    def _open(self, overwrite: bool) -> None:
        path = self.path
        if overwrite:
            for name in (*FILES, REPORT):
                (path / name).unlink(missing_ok=True)
        elif any(exists(path / name) for name in FILES):
            self._check()
            self._read_partial()
        write_atomic(path / SETTINGS, to_yaml(self.settings))
        entries = {number: _plain(outcomes) for number, outcomes in self.finished.items()}
        self._partial = TrialLog(path / PARTIAL, entries)

    def append(self, number: int, outcomes: list[Outcome]) -> None:
        """Keep the outcome of a trial, in the order of the controllers."""
        assert self._partial is not None
        self._partial.append(number, _plain(outcomes))
        self.finished[number] = outcomes

    def close(self) -> None:
        """Stop; what is finished stays."""
        if self._partial is not None:
            self._partial.close()
        self._lock.release()

    def finish(self, rows: Sequence[dict[str, Any]], summary: dict[str, Any]) -> None:
        """Write the trials and, last, the summary."""
        write_atomic(self.path / TRIALS, csv_text(rows, COLUMNS))
        write_atomic(self.path / SUMMARY, json.dumps(summary, indent=1, allow_nan=False) + "\n")
        (self.path / PARTIAL).unlink(missing_ok=True)
        self.close()

    def _check(self) -> None:
        """Refuse to go on from anything but an interrupted evaluation with equal settings."""
        advice = "choose another folder, or replace it by --overwrite"
        path = self.path
        if (path / SUMMARY).exists() or not (path / SETTINGS).exists():
            raise ConfigError(f"already holds an evaluation: {advice}", source=path, field="out")
        before = read_settings(path)
        names = Settings.__dataclass_fields__
        changed = [n for n in names if getattr(before, n) != getattr(self.settings, n)]
        if changed:
            raise ConfigError(
                f"holds an interrupted evaluation with other settings ({', '.join(changed)}): "
                f"{advice}",
                source=path / SETTINGS,
                field=changed[0],
            )

    def _read_partial(self) -> None:
        """Outcomes of all whole lines: a kill may have cut off the last one."""
        path = self.path / PARTIAL
        for number, outcomes in read_log(path)[0]:
            try:
                self.finished[number] = [build(Outcome, o, str(path)) for o in outcomes]
            except (TypeError, ConfigError):
                continue


def read_settings(folder: Path) -> Settings:
    """The settings of an evaluation; raises ConfigError where there are none."""
    path = folder / SETTINGS
    return build(Settings, read_yaml(path), str(path))


def _plain(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    return [asdict(outcome) for outcome in outcomes]
