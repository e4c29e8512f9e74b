"""Tables that only some suites have: sensitivity to factors, indicators, seeds, errors."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypedDict, cast

from markupsafe import Markup

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
)
from poise.training.running.summary import Level, MarginFigures

from .cells import Cell, Column, Table, cell, figure_cell, figure_column, name_cell, p_cell

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


class FactorPlot(TypedDict):
    """A picture with its title."""

    title: str
    picture: Markup


def factor_levels(results: Results) -> list[tuple[str, str, Level]]:
    """(controller, factor, level's entry) of all levels in the summary."""
    return [
        (name, factor["factor"], level)
        for name, entry in results.summary["controllers"].items()
        for factor in entry.get("factors", ())
        for level in factor["levels"]
    ]


def factor_plots(results: Results, order: Sequence[str]) -> list[FactorPlot]:
    """A picture of every factor, controllers as in `order`."""
    pictures: list[FactorPlot] = []
    every = factor_levels(results)
    for factor in dict.fromkeys(factor for _, factor, _ in every):
        entries: dict[str, list[Level]] = {}
        for name, own_factor, level in every:
            if own_factor == factor:
                entries.setdefault(name, []).append(level)
        levels = list(dict.fromkeys(e["level"] for each in entries.values() for e in each))
        standard = [levels.index(e["level"]) for each in entries.values() for e in each
                    if e["standard"]]  # fmt: skip
        found = []
        for name in order:
            own = entries.get(name, [])
            counts = [(e["recovered"], e["trials"]) for e in own]
            at = [levels.index(e["level"]) for e in own]
            found.append(rate_series(name, results.controllers.index(name), at, counts))
        title = TITLES.get(factor, factor)
        told = "; ".join(
            f"{s.name} "
            + ", ".join(f"{levels[int(x)]}: {y:.0%}" for x, y in zip(s.x, s.y, strict=True))
            for s in found
        )
        out = Inline(f"Recovery rate over {title}: {told}.")
        level_curves(out, found, levels, standard[0] if standard else None)
        pictures.append({"title": title[:1].upper() + title[1:], "picture": out.svg})
    return pictures


def factor_table(results: Results) -> Table | None:
    """Every level of every factor; None without factors."""
    figures = (*TRIED, RECOVERED, *AGAINST)
    columns = [
        Column("controller", "controller"),
        Column("factor", "factor"),
        Column("level", "level"),
        *map(figure_column, (*figures, P_VALUE)),
    ]
    rows = [
        [
            name_cell(name, results.controllers.index(name)),
            Cell(factor, factor),
            Cell(level["level"], level_text(level["level"])
                 + (" (standard)" if level["standard"] else "")),
            *(figure_cell(each, level) for each in figures),
            p_cell(level["p_mcnemar"]),
        ]
        for name, factor, level in factor_levels(results)
    ]  # fmt: skip
    caption = "Recovery rate at every level of every factor, lost and won against the standard."
    return Table("factors", caption, columns, rows) if rows else None


def sensitivity(results: Results, order: Sequence[str]) -> Table | None:
    """The largest loss of each controller by each factor; None without factors."""
    found = factor_levels(results)
    factors = list(dict.fromkeys(factor for _, factor, _ in found))
    columns = [Column("controller", "controller"), Column("standard", "standard case")]
    columns += [Column(f, f.replace("_", " "), TITLES.get(f, "")) for f in factors]
    rows = []
    for name in order:
        own = [(f, level) for other, f, level in found if other == name]
        base = [level["recovered_rate"] for _, level in own if level["standard"]]
        if not base:
            continue
        row = [name_cell(name, results.controllers.index(name)), cell(base[0], ".0%")]
        for factor in factors:
            levels = [level for f, level in own if f == factor and not level["standard"]]
            worst = min(levels, key=lambda level: level["recovered_rate"], default=None)
            if worst is None:
                row.append(cell(None))
                continue
            change = 100.0 * (worst["recovered_rate"] - base[0])
            shown = cell(change, "+.0f" if abs(change) >= 0.5 else ".0f")
            row.append(shown._replace(ends_text=f"at {level_text(worst['level'])}"))
        rows.append(row)
    caption = "Change of the recovery rate at the worst level of each factor, in percent points."
    return Table("sensitivity", caption, columns, rows) if rows else None


def indicators(results: Results, order: Sequence[str]) -> Table | None:
    """EUROBENCH's indicators; None where no standard pushes were played."""
    entries = results.summary["controllers"]
    order = [name for name in order if "eurobench" in entries[name]]
    margins: dict[str, dict[float, MarginFigures]] = {
        name: {margin["direction"]: margin for margin in entries[name]["eurobench"]["margins"]}
        for name in order
    }
    angles = list(dict.fromkeys(angle for own in margins.values() for angle in own))
    columns = [
        Column("controller", "controller"),
        *map(figure_column, SWAY),
    ]
    for angle in angles:
        columns += [
            Column(
                f"margin_{angle:g}_{each.key}", f"{each.heading}, {right_angle(angle)}", each.words
            )
            for each in MARGINS
        ]
    rows = []
    for name in order:
        found = entries[name]["eurobench"]
        row = [
            name_cell(name, results.controllers.index(name)),
            *(figure_cell(each, found) for each in SWAY),
        ]
        for angle in angles:
            margin = margins[name].get(angle, MarginFigures(direction=angle))
            row += [figure_cell(each, margin) for each in MARGINS]
        rows.append(row)
    caption = "Indicators of simulated subjects, as EUROBENCH's protocols define them."
    return Table("indicators", caption, columns, rows).without_empty() if rows else None


def seed_table(results: Results) -> Table | None:
    """Interquartile means over training seeds and the worst seed; None without groups of seeds."""
    columns = [Column("name", "runs"), Column("seeds", "seeds")]
    figures = {each.key: (
        replace(each, key="iqm", name=f"{each.heading}, IQM", unit="", ends="iqm_ci95",
                words="interquartile mean over seeds", csv=f"{each.key}_iqm"),
        replace(each, key="worst", name="worst seed", unit="", words="the smallest value of a seed",
                csv=f"{each.key}_worst"),
    ) for each in OVER_SEEDS}  # fmt: skip
    columns += [figure_column(each) for pair in figures.values() for each in pair]
    rows = []
    for group in results.summary["seeds"]:
        row = [Cell(group["name"], group["name"]), cell(len(group["seeds"]), "d")]
        for key, pair in figures.items():
            row += [figure_cell(each, cast(Entry, group.get(key, {}))) for each in pair]
        rows.append(row)
    if not rows:
        return None
    return Table("seeds", "Means over training seeds.", columns, rows).without_empty()


def error_table(results: Results) -> Table | None:
    """Trials in which a controller raised; None without any."""
    columns = [
        Column("controller", "controller"),
        Column("trial", "trial"),
        Column("seed", "seed"),
        Column("error", "error"),
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
