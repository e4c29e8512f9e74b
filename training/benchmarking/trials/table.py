"""Trials and outcomes as lines of trials.csv: what is written reads back exactly."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from poise.baselines.walking.schedule import TimedCommand
from poise.configs.errors import ConfigError
from poise.configs.reading import parse_json
from poise.configs.schema import build, to_dict
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.terrain.terrain import make_terrain

from .trial import Conditions, Outcome, Trial

Cell = str | float | bool | None
PUSH_COLUMNS = (
    *("body", "start", "duration", "impulse", "direction", "elevation"),
    *("point_x", "point_y", "point_z", "profile"),
)
CASE_COLUMNS = (
    *("trial", "controller", "seed", "stage", "part", "factor", "level"),
    *(*PUSH_COLUMNS, *Conditions.__dataclass_fields__, "limit_fraction", "later", "commands"),
    *("kicks", "terrain", "motion", "share", "until"),
)
OUTCOME_COLUMNS = tuple(
    "stepped" if name == "foot_displaced" else name for name in Outcome.__dataclass_fields__
)
COLUMNS = (*CASE_COLUMNS, *OUTCOME_COLUMNS)
MANY: dict[str, type] = {"commands": TimedCommand, "kicks": Kick}  # fields of a trial, as JSON


def trial_row(trial: Trial, controller: str, outcome: Outcome) -> dict[str, Cell]:
    """The line of a trial and a controller.

    `later` has the pushes after the first as JSON, `commands` and `kicks` all of these, `terrain`
    its fields.
    """
    later = [asdict(push) for push in trial.pushes[1:]]
    return {
        "trial": trial.number,
        "controller": controller,
        "seed": trial.seed,
        "stage": trial.stage,
        "part": trial.part,
        "factor": trial.factor,
        "level": trial.level,
        **_push_cells(trial.push),
        **asdict(trial.conditions),
        "limit_fraction": trial.limit_fraction,
        "later": json.dumps(later) if later else None,
        **{name: _many(getattr(trial, name)) for name in MANY},
        "terrain": None if trial.terrain is None else json.dumps(to_dict(trial.terrain)),
        "motion": trial.motion,
        "share": trial.share,
        "until": trial.until,
        **outcome_cells(outcome),
    }


def _many(items: Sequence[Any]) -> str | None:
    told = [{k: v for k, v in asdict(item).items() if v is not None} for item in items]
    return json.dumps(told) if told else None


def outcome_cells(outcome: Outcome) -> dict[str, Cell]:
    """The columns of an outcome."""
    return dict(zip(OUTCOME_COLUMNS, asdict(outcome).values(), strict=True))


def _push_cells(push: Push | None) -> dict[str, Cell]:
    if push is None:
        return dict.fromkeys(PUSH_COLUMNS)
    cells = asdict(push)
    cells.update(zip(("point_x", "point_y", "point_z"), cells.pop("point"), strict=True))
    return {name: cells[name] for name in PUSH_COLUMNS}


def read_trial(line: Mapping[str, str], path: Path) -> Trial:
    """The trial of a line that has all `COLUMNS`; raises ConfigError where it does not parse."""
    try:
        later = parse_json(line["later"]) if line["later"] else []
        pushes = [_read_push(line)] if line["body"] else []
        many: dict[str, tuple[Any, ...]] = {
            name: tuple(build(kind, item, str(path)) for item in parse_json(line[name] or "[]"))
            for name, kind in MANY.items()
        }
        return Trial(
            number=int(line["trial"]),
            seed=int(line["seed"]),
            pushes=tuple(build(Push, push, str(path)) for push in [*pushes, *later]),
            conditions=Conditions(
                friction=_number(line["friction"]),
                delay=float(line["delay"]),
                mass_error=float(line["mass_error"]),
                velocity_noise=float(line.get("velocity_noise") or 0.0),
                realism=line.get("realism") or None,
            ),
            limit_fraction=_number(line["limit_fraction"]),
            part=line["part"],
            stage=int(line["stage"]),
            factor=line["factor"] or None,
            level=line["level"] or None,
            commands=many["commands"],
            kicks=many["kicks"],
            terrain=make_terrain(parse_json(line["terrain"]), str(path))
            if line["terrain"]
            else None,
            motion=line["motion"] or None,
            share=_number(line["share"]),
            until=_number(line.get("until", "")),
        )
    except (ValueError, TypeError) as error:
        raise ConfigError(f"trial {line['trial']} does not parse: {error}", source=path) from None


def _read_push(line: Mapping[str, str]) -> dict[str, object]:
    texts = ("body", "profile")
    data: dict[str, object] = {
        key: line[key] if key in texts else float(line[key]) for key in PUSH_COLUMNS
    }
    data["point"] = [data.pop(key) for key in ("point_x", "point_y", "point_z")]
    return data


def _number(text: str) -> float | None:
    return float(text) if text else None
