"""The plots of a report, from results."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from poise.configs.errors import ConfigError
from poise.training.results.read import Record, Results
from poise.training.results.values import interval, number, numbers
from poise.training.statistics.fits import fit_logistic, trial_bins
from poise.training.statistics.rates import wilson_interval
from poise.training.trials.step_limits import DRAWN, line_name

from .cells import Download, csv_text, download
from .charts import Series, fall_curves, forest, polar, rate_series
from .tables import per_direction, ranked

BINS = 8
PARTS = {"envelope": "Standard pushes", "mix": "Random mix"}
CURVES = ("part", "controller", "push_share", "not_recovered", "trials", "rate_low", "rate_high",
          "fit_half_at", "fit_bound", "fit_scale")  # fmt: skip
NONE = (np.nan, np.nan)


def forests(results: Results) -> list[Markup]:
    """J50, where it was measured, and the recovered share of all controllers, the best first."""
    order, entries = results.controllers, results.summary["controllers"]
    j50, rates = [], []
    for name in ranked(results):
        where = f"{results.folder}: summary.json: controllers.{name}"
        value = number(entries[name], "j50_mean", where)
        if value is not None:
            ends = interval(entries[name], "j50_mean_ci95", where) or NONE
            j50.append(_one(name, order.index(name), value, ends))
        count, of = entries[name]["recovered"], entries[name]["trials"]
        rates.append(_one(name, order.index(name), count / of, wilson_interval(count, of)))
    pictures = [forest(j50, "mean J50 [N·s]", ".1f")] if j50 else []
    return [*pictures, forest(rates, "recovered trials [%]", ".1f", 100.0)]


def envelopes(results: Results) -> tuple[Markup | None, list[tuple[str, Markup]]]:
    """All envelopes in one picture, and each in one of its own, the best first.

    None and nothing where no suite measured directions.
    """
    unit, series, limit = _envelopes(results)
    steps = step_lines(results)
    if not series:
        return None, []
    alone = series if len(series) > 1 else []
    picture = polar(series, unit, limit, steps=steps)
    return picture, [(s.name, polar(series, unit, limit, s)) for s in alone]


def step_lines(results: Results) -> dict[str, tuple[list[float], list[float]]]:
    """name → (directions, limit [N·s]) of what steps can stop; nothing where nobody steps.

    Those of the first controller that steps. Raises ConfigError for a summary of another form.
    """
    where = f"{results.folder}: summary.json"
    found = results.source.get("step_limits", [])
    if not isinstance(found, list):
        raise ConfigError("must be a list", source=where, field="step_limits")
    whose, lines = [], {}
    for k, entry in enumerate(found):
        names = entry.get("controllers") if isinstance(entry, dict) else None
        if not isinstance(names, list) or not names or not set(names) <= set(results.controllers):
            raise ConfigError("must name controllers", source=where, field=f"step_limits.{k}")
        whose.append(names)
    for name in DRAWN if found else ():
        curves, place = found[0].get("curves"), f"{where}: step_limits.0.curves"
        curves = curves if isinstance(curves, dict) else {}
        angles, limit = numbers(curves, "directions", place), numbers(curves, name, place)
        if not angles or len(angles) != len(limit):
            raise ConfigError("must be as long as directions", source=place, field=name)
        lines[line_name(name, whose)] = (angles, limit)
    return lines


def falls(results: Results) -> tuple[list[tuple[str, Markup]], Download | None]:
    """Share of trials that were not recovered over the push, with a title, and its bins as CSV.

    A benchmark has a picture of the standard pushes and one of the random mix; without pushes there
    is nothing.
    """
    pictures, lines = [], []  # type: tuple[list[tuple[str, Markup]], list[tuple[object, ...]]]
    for part, title in PARTS.items() if results.parts else (("", ""),):
        picture, own = _falls(results, part)
        if picture is not None:
            pictures.append((title, picture))
        lines += own
    return pictures, download("fall_curves.csv", csv_text(CURVES, lines)) if lines else None


def _falls(results: Results, part: str) -> tuple[Markup | None, list[tuple[object, ...]]]:
    share, title = shares(results)
    share[[record.part != part for record in results.records]] = np.nan
    if not np.isfinite(share).any():
        return None, []
    series, fits = [], {}
    lines: list[tuple[object, ...]] = []
    for index, name in enumerate(results.controllers):
        mine = [k for k, record in enumerate(results.records)
                if record.controller == name and np.isfinite(share[k])]  # fmt: skip
        recovered = np.array([results.records[k].recovered for k in mine])
        fits[name] = fit_logistic(share[mine], recovered)
        bins = trial_bins(share[mine], recovered, BINS)
        series.append(rate_series(name, index, [b[0] for b in bins], [b[1:] for b in bins]))
        own, fit = series[-1], fits[name]
        lines += [
            (part, name, *bins[k], own.low[k], own.high[k], fit.j50, fit.bound, fit.scale)
            for k in range(len(bins))
        ]
    tried = share[np.isfinite(share)]
    picture = fall_curves(series, fits, title, (float(tried.min()), float(tried.max())))
    return picture, lines


def shares(results: Results) -> tuple[np.ndarray, str]:
    """Every record's push over the limit, NaN without one, and what it is a share of.

    Evaluations by direction are measured by the ankle limit, as their summary has it.
    """
    limits = (
        {}
        if results.parts
        else {
            number(entry, "direction", where): number(entry, "ankle_limit", where)
            for _, _, entry, where in per_direction(results)
            if entry.get("ankle_limit")
        }
    )

    def share(record: Record) -> float:
        limit = limits.get(record.direction)
        return record.impulse / limit if limit else record.fraction

    what = "ankle limit" if limits else results.scale
    return np.array([share(record) for record in results.records]), f"push, in shares of the {what}"


def _envelopes(
    results: Results,
) -> tuple[str, list[Series], tuple[Sequence[float], Sequence[float]] | None]:
    """Unit, series, and the ankle limit where the summary has it."""
    found = per_direction(results)
    key = "j50" if any("j50" in entry for _, _, entry, _ in found) else "fraction50"
    rows: dict[tuple[str, int], list[tuple[float, ...]]] = {}
    limit: dict[float, float] = {}
    for name, index, entry, where in found:
        angle, value = number(entry, "direction", where), number(entry, key, where)
        if angle is None or value is None:
            continue
        ends = interval(entry, f"{key}_ci95", where) or NONE
        rows.setdefault((name, index), []).append((angle, value, *ends))
        ankle = number(entry, "ankle_limit", where)
        if ankle is not None:
            limit[angle] = ankle
    order = ranked(results)
    series = [
        Series(name, index, *np.array(sorted(points)).T)
        for (name, index), points in sorted(rows.items(), key=lambda item: order.index(item[0][0]))
    ]
    unit = "N·s" if key == "j50" else f"of the {results.scale}"
    limit = _fine_limit(results) or limit
    angles = sorted(limit)
    return unit, series, (angles, [limit[a] for a in angles]) if angles else None


def _fine_limit(results: Results) -> dict[float, float]:
    """direction → ankle limit, where a benchmark has it in small steps."""
    robot, where = results.source.get("robot"), f"{results.folder}: summary.json: robot"
    rows = robot.get("ankle_limit") if isinstance(robot, dict) else None
    found = {}
    for row in rows if isinstance(rows, list) else []:
        ends = interval({"ankle_limit": row}, "ankle_limit", where)
        if ends is not None:
            found[ends[0]] = ends[1]
    return found


def _one(name: str, index: int, value: float, ends: Sequence[float]) -> Series:
    return Series(name, index, np.zeros(1), *(np.array([v]) for v in (value, *ends)))
