"""Trials and outcomes as lines of trials.csv, which are read back exactly."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_type_hints

from poise.configs.errors import ConfigError, shown
from poise.configs.reading import parse_json
from poise.configs.schema import build, to_dict
from poise.envs.physics.pushes.push import Push

from .trial import Conditions, Outcome, Trial

Cell = str | float | bool | None
POINT = ("point_x", "point_y", "point_z")
PUSH_COLUMNS = (
    *("body", "start", "duration", "impulse", "direction", "elevation"),
    *(*POINT, "profile"),
)
CONDITIONS = tuple(Conditions.__dataclass_fields__)
CASE_COLUMNS = (
    *("trial", "controller", "seed", "stage", "part", "factor", "level"),
    *(*PUSH_COLUMNS, *CONDITIONS, "limit_fraction", "later", "commands"),
    *("kicks", "terrain", "motion", "share", "until", "start_posture", "get_up"),
)
OUTCOME_COLUMNS = tuple(
    "stepped" if name == "foot_displaced" else name for name in Outcome.__dataclass_fields__
)
COLUMNS = (*CASE_COLUMNS, *OUTCOME_COLUMNS)
TEXTS = ("controller", "part", "factor", "level", "body", "profile", "realism", "motion")
WHOLE = ("trial", "seed", "stage", "start_posture")
REQUIRED = ("trial", "seed", "stage", "delay", "mass_error")  # columns without empty cells
AS_JSON = ("later", "commands", "kicks", "terrain")  # of all other columns a cell is a number


def trial_row(trial: Trial, controller: str, outcome: Outcome) -> dict[str, Cell]:
    """Return the line of a trial and a controller.

    `later` has the pushes after the first as JSON, `commands` and `kicks` all of these, `terrain`
    its fields.
    """
    cells = {
        "trial": trial.number,
        "controller": controller,
        **_push_cells(trial.push),
        **asdict(trial.conditions),
        "later": _many(trial.pushes[1:]),
        "commands": _many(trial.commands),
        "kicks": _many(trial.kicks),
        "start_posture": trial.start,
        "terrain": None if trial.terrain is None else json.dumps(to_dict(trial.terrain)),
    }
    case = {name: cells[name] if name in cells else getattr(trial, name) for name in CASE_COLUMNS}
    return case | outcome_cells(outcome)


def _many(items: Sequence[Any]) -> str | None:
    fields = [{k: v for k, v in asdict(item).items() if v is not None} for item in items]
    return json.dumps(fields) if fields else None


def outcome_cells(outcome: Outcome) -> dict[str, Cell]:
    """Return the columns of an outcome."""
    return dict(zip(OUTCOME_COLUMNS, asdict(outcome).values(), strict=True))


def read_outcome(line: Mapping[str, str], path: Path) -> Outcome:
    """Return the outcome of a line; raise ConfigError where it does not parse. A column that older
    results lack is a field's default, and so is an empty cell."""
    cells: dict[str, Any] = {}
    for column, (name, hint) in zip(OUTCOME_COLUMNS, get_type_hints(Outcome).items(), strict=True):
        text = line.get(column)
        if not text:
            continue
        try:
            cells[name] = _FROM_TEXT.get(hint, str)(text)
        except (ValueError, KeyError):
            raise ConfigError(f"trial {line['trial']}: {column} does not parse: {shown(text)}",
                              source=path) from None  # fmt: skip
    return build(Outcome, cells, f"{path}: trial {line['trial']}")


#: type of a field → what reads it; others are texts
_FROM_TEXT: dict[Any, Callable[[str], Any]] = {
    bool: {"True": True, "False": False}.__getitem__,
    int: int,
    int | None: int,
    float: float,
    float | None: float,
}


def _push_cells(push: Push | None) -> dict[str, Cell]:
    if push is None:
        return dict.fromkeys(PUSH_COLUMNS)
    cells = asdict(push)
    cells.update(zip(POINT, cells.pop("point"), strict=True))
    return cells


def read_trial(line: Mapping[str, str], path: Path) -> Trial:
    """Return the trial of a line; raise ConfigError where it does not parse.

    A missing column of older results or an empty cell is the field's default, except for
    `REQUIRED` and the columns of a push.
    """
    try:
        for name in (*REQUIRED, *(PUSH_COLUMNS if line["body"] else ())):
            if not line[name]:
                raise ValueError(f"{name} is empty")
        cells = {name: _read(name, line[name]) for name in CASE_COLUMNS if line.get(name)}
        push = {name: cells.pop(name) for name in PUSH_COLUMNS if name in cells}
        if push:
            push["point"] = [push.pop(name, 0.0) for name in POINT]
        conditions = {name: cells.pop(name) for name in CONDITIONS if name in cells}
        pushes = [*([push] if push else []), *cells.pop("later", [])]
    except (ValueError, TypeError) as error:
        raise ConfigError(f"trial {line['trial']} does not parse: {error}", source=path) from None
    cells["number"] = cells.pop("trial", None)
    cells["start"] = cells.pop("start_posture", None)
    cells.pop("controller", None)
    source = f"{path}: trial {line['trial']}"
    return build(Trial, {"pushes": pushes, "conditions": conditions, **cells}, source)


def _read(column: str, text: str) -> Any:
    if column in TEXTS:
        return text
    if column in AS_JSON:
        return parse_json(text)
    return int(text) if column in WHOLE else float(text)
