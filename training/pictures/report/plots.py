"""The plots of a report, from results."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from markupsafe import Markup

from poise.training.benchmarking.metrics.played import DIRECTIONAL
from poise.training.benchmarking.results.read import Record, Results
from poise.training.benchmarking.statistics.fits import fit_logistic, trial_bins
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.benchmarking.trials.step_limits import DRAWN, line_name
from poise.training.running.summary import Interval, both_ends

from .cells import Download, csv_text, download
from .charts import Series, fall_curves, forest, polar, rate_series
from .tables import bound_of, per_direction

BINS = 8
PARTS = {"envelope": "Standard pushes", "grid": "Grid of pushes", "random": "Random pushes",
         "mix": "Random mix"}  # fmt: skip
CURVES = ("part", "controller", "push_share", "not_recovered", "trials", "rate_low", "rate_high",
          "fit_half_at", "fit_bound", "fit_scale")  # fmt: skip
NONE = (np.nan, np.nan)


def forests(results: Results) -> list[Markup]:
    """J50, where it was measured, and the recovery rate of all controllers, the best first."""
    order, entries = results.controllers, results.summary["controllers"]
    j50, rates = [], []
    for name in results.summary["ranking"]:
        entry, index = entries[name], order.index(name)
        if "j50_mean" in entry:
            j50.append(
                _one(name, index, entry["j50_mean"], both_ends(entry["j50_mean_ci95"]) or NONE)
            )
        count, of = entry["recovered"], entry["trials"]
        rates.append(_one(name, index, count / of, wilson_interval(count, of)))
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

    Those of the first controller that steps.
    """
    found = results.summary["step_limits"]
    whose = [entry["controllers"] for entry in found]
    if not found:
        return {}
    curves = cast(dict[str, list[float]], found[0]["curves"])
    return {line_name(name, whose): (curves["directions"], curves[name]) for name in DRAWN}


def falls(results: Results) -> tuple[list[tuple[str, Markup]], Download | None]:
    """Fraction of trials that were not recovered over the push, with a title, and its bins as CSV.

    There is a picture of each part whose pushes are measured by a limit.
    """
    pictures: list[tuple[str, Markup]] = []
    lines: list[tuple[object, ...]] = []
    for part in (part for part in results.parts if part in PARTS):
        picture, own = _falls(results, part)
        pictures.append((PARTS[part], picture))
        lines += own
    return pictures, download("fall_curves.csv", csv_text(CURVES, lines)) if lines else None


def _falls(results: Results, part: str) -> tuple[Markup, list[tuple[object, ...]]]:
    fraction, title = limit_fractions(results, part)
    series, fits = [], {}
    lines: list[tuple[object, ...]] = []
    for index, name in enumerate(results.controllers):
        mine = [k for k, record in enumerate(results.records)
                if record.controller == name and np.isfinite(fraction[k])]  # fmt: skip
        recovered = np.array([results.records[k].recovered for k in mine])
        fits[name] = fit_logistic(fraction[mine], recovered)
        bins = trial_bins(fraction[mine], recovered, BINS)
        series.append(rate_series(name, index, [b[0] for b in bins], [b[1:] for b in bins]))
        own, fit = series[-1], fits[name]
        lines += [
            (part, name, *bins[k], own.low[k], own.high[k], fit.j50, fit.bound, fit.scale)
            for k in range(len(bins))
        ]
    tried = fraction[np.isfinite(fraction)]
    picture = fall_curves(series, fits, title, (float(tried.min()), float(tried.max())))
    return picture, lines


def limit_fractions(results: Results, part: str) -> tuple[np.ndarray, str]:
    """Every record's push over the limit, NaN for those of other parts, and what of.

    Pushes by direction are measured by the ankle limit, as the summary has it.
    """
    limits = {
        direction["direction"]: direction["ankle_limit"]
        for entry in results.summary["controllers"].values()
        for direction in (entry.get("directions", ()) if part in DIRECTIONAL else ())
    }

    def fraction(record: Record) -> float:
        if record.part != part:
            return np.nan
        limit = limits.get(record.direction)
        return record.impulse / limit if limit else record.fraction

    what = "ankle limit" if limits else results.summary["scale"]
    found = np.array([fraction(record) for record in results.records])
    return found, f"push, in fractions of the {what}"


def _envelopes(
    results: Results,
) -> tuple[str, list[Series], tuple[Sequence[float], Sequence[float]] | None]:
    """Unit, series, and the ankle limit where J50 was measured."""
    rows: dict[tuple[str, int], list[tuple[float, ...]]] = {}
    measured = False
    for name, index, entry in per_direction(results):
        measured = measured or "j50" in entry
        key = "j50" if measured else "fraction50"
        value, around = cast(float, entry.get(key)), cast(Interval, entry.get(f"{key}_ci95"))
        side = {"lower": 1.0, "upper": -1.0}.get(bound_of(entry) or "", 0.0)
        row = (entry["direction"], value, *(both_ends(around) or NONE), side)
        rows.setdefault((name, index), []).append(row)
    order = results.summary["ranking"]
    series = [
        Series(name, index, *np.array(sorted(points)).T)
        for (name, index), points in sorted(rows.items(), key=lambda item: order.index(item[0][0]))
    ]
    if not measured:
        return f"of the {results.summary['scale']}", series, None
    angles, limit = zip(*results.summary["robot"]["ankle_limit"], strict=True)
    return "N·s", series, (angles, limit)


def _one(name: str, index: int, value: float, around: Sequence[float]) -> Series:
    return Series(name, index, np.zeros(1), *(np.array([v]) for v in (value, *around)))
