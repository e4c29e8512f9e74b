"""What only a benchmark has: sensitivity to factors, indicators, training seeds, errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from poise.configs.errors import ConfigError
from poise.training.results.read import Results
from poise.training.results.values import interval, number
from poise.training.statistics.rates import wilson_interval
from poise.training.statistics.seeds import FIGURES

from .cells import Cell, Column, Table, cell, name_cell, p_cell
from .charts import Series, level_curves, level_text
from .svg import right_angle

TITLES = {
    "duration": "duration of the push [s]",
    "body": "body that is pushed",
    "height": "height of the push, over that of the CoM",
    "friction": "friction",
    "delay": "delay of the sensors [s]",
    "mass_error": "error of the masses",
    "pushes": "number of pushes",
}


def factor_levels(results: Results) -> list[tuple[str, str, Mapping[str, Any], str]]:
    """(controller, factor, level's entry, where) of all levels in the summary."""
    found = []
    for name, entry in results.summary["controllers"].items():
        where = f"{results.folder}: summary.json: controllers.{name}.factors"
        for factor in _mappings(entry.get("factors"), where):
            levels = _mappings(factor.get("levels"), where)
            for level in levels:
                if not isinstance(level.get("level"), str):
                    raise ConfigError("must be a text", source=where, field="level")
                for key in ("trials", "recovered", "recovered_rate"):
                    number(level, key, where, needed=True)
                found.append((name, str(factor.get("factor")), level, where))
    return found


def factor_plots(results: Results, order: Sequence[str]) -> list[dict[str, Any]]:
    """A picture of every factor, controllers as in `order`."""
    pictures = []
    found = factor_levels(results)
    for factor in dict.fromkeys(factor for _, factor, _, _ in found):
        entries: dict[str, list[Mapping[str, Any]]] = {}
        for name, own, level, _ in found:
            if own == factor:
                entries.setdefault(name, []).append(level)
        levels = list(dict.fromkeys(e["level"] for own in entries.values() for e in own))
        standard = [levels.index(e["level"]) for own in entries.values() for e in own
                    if e.get("standard")]  # fmt: skip
        series = []
        for name in order:
            own_levels = entries.get(name, [])
            ends = [wilson_interval(e["recovered"], e["trials"]) for e in own_levels]
            low, high = np.array(ends, dtype=float).reshape(-1, 2).T
            x = np.array([levels.index(e["level"]) for e in own_levels], dtype=float)
            y = np.array([e["recovered_rate"] for e in own_levels], dtype=float)
            series.append(Series(name, results.controllers.index(name), x, y, low, high))
        title = TITLES.get(factor, factor)
        picture = level_curves(series, levels, title, standard[0] if standard else None)
        pictures.append({"title": title[:1].upper() + title[1:], "picture": picture})
    return pictures


def factor_table(results: Results) -> Table | None:
    """Every level of every factor; None without factors."""
    columns = [
        Column("controller", "Controller"),
        Column("factor", "Factor"),
        Column("level", "Level"),
        Column("trials", "Trials"),
        Column("recovered", "Recovered"),
        Column("recovered_rate", "Rate", interval=True),
        Column("lost", "Lost", "against the standard case"),
        Column("won", "Won", "against the standard case"),
        Column("p_mcnemar", "p", "McNemar's exact test"),
    ]
    rows = [
        [
            name_cell(name, results.controllers.index(name)),
            Cell(factor, factor),
            Cell(level["level"], level_text(level["level"])
                 + (" (standard)" if level.get("standard") else "")),
            cell(number(level, "trials", where), "g"),
            cell(number(level, "recovered", where), "g"),
            cell(number(level, "recovered_rate", where), ".0%",
                 interval(level, "recovered_ci95", where)),
            cell(number(level, "lost", where), "g"),
            cell(number(level, "won", where), "g"),
            p_cell(number(level, "p_mcnemar", where)),
        ]
        for name, factor, level, where in factor_levels(results)
    ]  # fmt: skip
    caption = "Recovered share at every level of every factor."
    return Table("factors", caption, columns, rows) if rows else None


def sensitivity(results: Results, order: Sequence[str]) -> Table | None:
    """The largest loss of each controller by each factor; None without factors."""
    found = factor_levels(results)
    factors = list(dict.fromkeys(factor for _, factor, _, _ in found))
    columns = [Column("controller", "Controller"), Column("standard", "Standard case")]
    columns += [Column(f, f.replace("_", " "), TITLES.get(f, "")) for f in factors]
    rows = []
    for name in order:
        own = [(f, level) for other, f, level, _ in found if other == name]
        base = [level["recovered_rate"] for _, level in own if level.get("standard")]
        if not base:
            continue
        row = [name_cell(name, results.controllers.index(name)), cell(base[0], ".0%")]
        for factor in factors:
            levels = [level for f, level in own if f == factor and not level.get("standard")]
            worst = min(levels, key=lambda level: level["recovered_rate"], default=None)
            if worst is None:
                row.append(cell(None))
                continue
            change = 100.0 * (worst["recovered_rate"] - base[0])
            shown = cell(change, "+.0f" if abs(change) >= 0.5 else ".0f")
            row.append(shown._replace(ends_text=f"at {level_text(worst['level'])}"))
        rows.append(row)
    caption = "Change of the recovered share at the worst level of each factor, in percent points."
    return Table("sensitivity", caption, columns, rows) if rows else None


def indicators(results: Results, order: Sequence[str]) -> Table | None:
    """EUROBENCH's indicators; None where the folder has none."""
    entries, rows = results.summary["controllers"], []
    angles: dict[float, None] = {}
    margins: dict[str, dict[float, Mapping[str, Any]]] = {}
    for name in order:
        where = f"{results.folder}: summary.json: controllers.{name}.eurobench"
        found = entries[name].get("eurobench")
        if not isinstance(found, dict):
            return None
        for entry in _mappings(found.get("margins"), where):
            angle = number(entry, "direction", where, needed=True)
            assert angle is not None
            angles[angle] = None
            margins.setdefault(name, {})[angle] = entry
    columns = [
        Column("controller", "Controller"),
        Column("body_sway_mean", "Body sway [rad]", "mean over recovered standard pushes"),
        Column("recovery_time_mean", "Recovery time [s]", "until the sway stays below 0.015 rad/s"),
        Column("recovery_time_trials", "of trials", "that came to rest by this measure"),
    ]
    for angle in angles:
        to, key = right_angle(angle), f"margin_{angle:g}"
        columns += [
            Column(f"{key}_force", f"Margin {to} [N]", "largest with < 30 % falls in 10 runs"),
            Column(f"{key}_force_normalised", "at human size [N]", f"margin {to}, normalised"),
            Column(f"{key}_energy_normalised", "energy [J]", f"margin {to}, normalised"),
        ]
    for name in order:
        where = f"{results.folder}: summary.json: controllers.{name}.eurobench"
        found = entries[name]["eurobench"]
        row = [
            name_cell(name, results.controllers.index(name)),
            cell(number(found, "body_sway_mean", where), ".3f"),
            cell(number(found, "recovery_time_mean", where), ".2f"),
            cell(number(found, "recovery_time_trials", where), "g"),
        ]
        for angle in angles:
            entry = margins.get(name, {}).get(angle, {})
            sign = "≥ " if entry.get("largest_tried") else ""
            for key in ("force", "force_normalised", "energy_normalised"):
                row.append(cell(number(entry, key, where), ".1f" if "energy" in key else ".0f",
                                sign=sign))  # fmt: skip
        rows.append(row)
    caption = "Indicators of simulated subjects, as EUROBENCH's protocols define them."
    return Table("indicators", caption, columns, rows).without_empty()


def seed_table(results: Results) -> Table | None:
    """Interquartile means over training seeds and the worst seed; None without groups of seeds."""
    columns = [Column("name", "Runs"), Column("seeds", "Seeds")]
    for key, title, _ in FIGURES:
        columns += [
            Column(f"{key}_iqm", f"{title}, IQM", "interquartile mean over seeds", interval=True),
            Column(f"{key}_worst", "worst seed", "the smallest value of a seed"),
        ]
    rows = []
    where = f"{results.folder}: summary.json: seeds"
    for group in _mappings(results.source.get("seeds"), where):
        name = str(group.get("name", ", ".join(str(member) for member in group.get("members", []))))
        row = [Cell(name, name), cell(len(group.get("seeds", [])), "d")]
        for key, _, form in FIGURES:
            found = group.get(key) or {}
            row.append(cell(number(found, "iqm", where), form, interval(found, "iqm_ci95", where)))
            row.append(cell(number(found, "worst", where), form))
        rows.append(row)
    if not rows:
        return None
    return Table("seeds", "Means over training seeds.", columns, rows).without_empty()


def error_table(results: Results) -> Table | None:
    """Trials in which a controller raised; None without any."""
    columns = [
        Column("controller", "Controller"),
        Column("trial", "Trial"),
        Column("seed", "Seed"),
        Column("error", "Error"),
    ]
    rows = [
        [
            name_cell(record.controller, results.controllers.index(record.controller)),
            cell(record.trial, "d"),
            Cell(int(record.line["seed"]), record.line["seed"]),
            Cell(record.error, record.error),
        ]
        for record in results.records
        if record.error
    ]
    caption = "Trials in which a controller raised an error; they count as not recovered."
    return Table("errors", caption, columns, rows) if rows else None


def _mappings(value: Any, where: str) -> list[Mapping[str, Any]]:
    """A list of mappings; nothing where there is none."""
    if value is None:
        return []
    if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
        raise ConfigError("must be a list of mappings", source=where)
    return value
