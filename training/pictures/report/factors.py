"""Tables that only some suites have: sensitivity to factors, indicators, seeds, errors."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

from poise.training.benchmarking.results.read import Results
from poise.training.pictures.figures.envelope import right_angle
from poise.training.pictures.figures.rates import level_curves, level_text
from poise.training.pictures.figures.series import rate_series
from poise.training.pictures.figures.style import Inline
from poise.training.running.columns import (
    AGAINST,
    MARGINS,
    OVER_SEEDS,
    P_VALUE,
    RECOVERED,
    SWAY,
    TRIED,
    Entry,
    Figure,
)
from poise.training.running.summary import Level

from .cells import CONTROLLER, Cell, Column, Table, Text, cell, entry_table
from .tables import TRIAL

TITLES = {
    "duration": "duration of the push [s]",
    "body": "body that is pushed",
    "height": "height of the push, over that of the CoM",
    "friction": "friction",
    "delay": "delay of the sensors [s]",
    "mass_error": "error of the masses",
    "velocity_noise": "noise of joint velocities [rad/s]",
    "realism": "realism",
    "pushes": "number of pushes",
}


def factor_levels(results: Results) -> list[tuple[str, str, Level]]:
    """Return (controller, factor, level's entry) of all levels in the summary."""
    return [
        (name, factor["factor"], level)
        for name, entry in results.summary["controllers"].items()
        for factor in entry.get("factors", ())
        for level in factor["levels"]
    ]


def factor_plots(results: Results, order: Sequence[str]) -> list[dict[str, str]]:
    """Return a title and a picture of every factor, controllers as in `order`."""
    pictures: list[dict[str, str]] = []
    every = factor_levels(results)
    for factor in dict.fromkeys(factor for _, factor, _ in every):
        entries = [(name, level) for name, other, level in every if other == factor]
        levels = list(dict.fromkeys(level["level"] for _, level in entries))
        standard = [levels.index(level["level"]) for _, level in entries if level["standard"]]
        found = []
        for name in order:
            own = [level for other, level in entries if other == name]
            counts = [(level["recovered"], level["trials"]) for level in own]
            at = [levels.index(level["level"]) for level in own]
            found.append(rate_series(name, results.controllers.index(name), at, counts))
        title = TITLES.get(factor, factor)
        rates = "; ".join(
            f"{s.name} "
            + ", ".join(f"{levels[int(x)]}: {y:.0%}" for x, y in zip(s.x, s.y, strict=True))
            for s in found
        )
        out = Inline(f"Recovery rate over {title}: {rates}.")
        level_curves(out, found, levels, standard[0] if standard else None)
        pictures.append({"title": title[:1].upper() + title[1:], "picture": out.svg})
    return pictures


def factor_table(results: Results) -> Table | None:
    """Return every level of every factor; None without factors."""
    caption = "Recovery rate at every level of every factor, lost and won against the standard."
    columns = (CONTROLLER, Text("factor", "factor"), Text("level", "level"), *TRIED, RECOVERED,
               *AGAINST, P_VALUE)  # fmt: skip
    rows = []
    for name, factor, level in factor_levels(results):
        shown = level_text(level["level"]) + (" (standard)" if level["standard"] else "")
        own = {"controller": name, "factor": factor, "level": Cell(level["level"], shown)}
        rows.append({**level, **own})
    return entry_table("factors", caption, columns, rows)


def sensitivity(results: Results, order: Sequence[str]) -> Table | None:
    """Return the largest loss of each controller by each factor; None without factors."""
    found = factor_levels(results)
    factors = list(dict.fromkeys(factor for _, factor, _ in found))
    texts = [Text(f, f.replace("_", " "), TITLES.get(f, "")) for f in factors]
    rows = []
    for name in order:
        own = [(f, level) for other, f, level in found if other == name]
        base = [level["recovered_rate"] for _, level in own if level["standard"]]
        if not base:
            continue
        row: dict[str, object] = {"controller": name, "standard": base[0]}
        for factor in factors:
            levels = [level for f, level in own if f == factor and not level["standard"]]
            worst = min(levels, key=lambda level: level["recovered_rate"], default=None)
            row[factor] = cell(None) if worst is None else _change(worst, base[0])
        rows.append(row)
    caption = "Change of the recovery rate at the worst level of each factor, in percent points."
    standard = Figure("standard", "standard case", ".0%")
    return entry_table("sensitivity", caption, [CONTROLLER, standard, *texts], rows)


def _change(level: Level, standard: float) -> Cell:
    """Return how much more is recovered at a level than in the standard case [percent points]."""
    change = 100.0 * (level["recovered_rate"] - standard)
    shown = cell(change, "+.0f" if abs(change) >= 0.5 else ".0f")
    return shown._replace(ends_text=f"at {level_text(level['level'])}")


def indicators(results: Results, order: Sequence[str]) -> Table | None:
    """Return EUROBENCH's indicators; None without standard pushes."""
    columns, rows = list(SWAY), []
    for name in order:
        if (found := results.summary["controllers"][name].get("eurobench")) is None:
            continue
        row: dict[str, object] = {**found, "controller": name}
        for margin in found["margins"]:
            place = f"margin_{margin['direction']:g}"
            row |= {f"{place}_{key}": value for key, value in margin.items()}
            columns += [
                replace(each, key=f"{place}_{each.key}", bound=f"{place}_{each.bound}", unit="",
                        name=f"{each.heading}, {right_angle(margin['direction'])}")
                for each in MARGINS
            ]  # fmt: skip
        rows.append(row)
    caption = "Indicators of simulated subjects, as EUROBENCH's protocols define them."
    return entry_table("indicators", caption, (CONTROLLER, *dict.fromkeys(columns)), rows)


def seed_table(results: Results) -> Table | None:
    """Interquartile means over training seeds and the worst seed; None without groups of seeds."""
    columns: list[Column] = [Text("name", "runs"), Figure("seeds", "seeds", ".0f")]
    for each in OVER_SEEDS:
        mean, worst = f"{each.key}_iqm", f"{each.key}_worst"
        columns += [
            replace(each, key=mean, name=f"{each.heading}, IQM", unit="", ends=f"{mean}_ci95",
                    words="interquartile mean over seeds"),
            replace(each, key=worst, name="worst seed", unit="",
                    words="the smallest value of a seed"),
        ]  # fmt: skip
    rows = []
    for group in results.summary["seeds"]:
        row: dict[str, object] = {"name": group["name"], "seeds": len(group["seeds"])}
        for each in OVER_SEEDS:
            figures = cast(Entry, group.get(each.key, {}))
            row |= {f"{each.key}_{key}": value for key, value in figures.items()}
        rows.append(row)
    return entry_table("seeds", "Means over training seeds.", columns, rows)


def error_table(results: Results) -> Table | None:
    """Return trials in which a controller raised; None without any."""
    caption = "Trials in which a controller raised an error; they count as not recovered."
    rows = [
        {**vars(record), "error": record.error,
         "seed": Cell(int(record.line["seed"]), record.line["seed"])}
        for record in results.records
        if record.error
    ]  # fmt: skip
    columns = (CONTROLLER, TRIAL, Text("seed", "seed"), Text("error", "error"))
    return entry_table("errors", caption, columns, rows)
