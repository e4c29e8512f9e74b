"""The plots of a report, from results."""

from collections.abc import Sequence
from typing import cast

import numpy as np
from markupsafe import Markup

from poise.training.benchmarking.evaluation.tables import judged_by_falls
from poise.training.benchmarking.metrics.evaluated import DIRECTIONAL, WALK_PUSH
from poise.training.benchmarking.results.read import Results
from poise.training.benchmarking.statistics.fits import fit_logistic, trial_bins
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.benchmarking.trials.step_limits import DRAWN, line_name
from poise.training.pictures.figures.envelope import LIMIT, polar_envelope, step_dashes
from poise.training.pictures.figures.palette import GREY, INK
from poise.training.pictures.figures.rates import BINS, fall_probability, forest
from poise.training.pictures.figures.series import SIDES, Series, series
from poise.training.pictures.figures.style import INLINE, Inline, look, sample
from poise.training.running.columns import J50_MEAN, Entry
from poise.training.running.summary import both_ends

from .cells import Download, cells_csv, download

SMALL = 2.2  # width of one controller's own picture [in]
PARTS = {"envelope": "Standard pushes", "grid": "Grid of pushes", "random": "Random pushes",
         "mix": "Random mix", "walk_push": "Pushes while it walks"}  # fmt: skip
CURVES = ("part", "controller", "push_share", "not_recovered", "trials", "rate_low", "rate_high",
          "fit_half_at", "fit_bound", "fit_scale")  # fmt: skip
NONE = (np.nan, np.nan)


def swatch(index: int) -> Markup:
    """Return how series number `index` looks, for a legend."""
    return sample(*look(index))


def forests(results: Results) -> list[Markup]:
    """J50, where it was measured, and the rates of recovered trials and of those without a fall of
    all controllers, the best first."""
    order, entries = results.controllers, results.summary["controllers"]
    j50: list[Series] = []
    recovered: list[Series] = []
    upright: list[Series] = []
    for name in results.summary["ranking"]:
        entry, index = entries[name], order.index(name)
        if "j50_mean" in entry:
            ends = both_ends(entry["j50_mean_ci95"]) or NONE
            j50.append(series(name, index, [(0.0, entry["j50_mean"], *ends)]))
        count, of = entry["recovered"], entry["trials"]
        ends = wilson_interval(count, of)
        recovered.append(series(name, index, [100.0 * np.array([0.0, count / of, *ends])]))
        if (rate := entry.get("never_fell_rate")) is not None:
            ends = both_ends(entry.get("never_fell_ci95")) or NONE
            upright.append(series(name, index, [100.0 * np.array([0.0, rate, *ends])]))
    pictures = []
    titled = [(recovered, "recovered trials [%]"), (upright, "trials without a fall [%]")]
    if judged_by_falls(entries):
        titled = [titled[1], (recovered, "trials that go on as commanded [%]")]
    for found, title in ((j50, J50_MEAN.heading), *titled):
        if found:
            out = Inline(f"{title}: {'; '.join(s.text(0, '.1f') for s in found)}.")
            forest(out, found, title, ".1f")
            pictures.append(out.svg)
    return pictures


def envelopes(results: Results) -> tuple[Markup | None, list[tuple[str, Markup]]]:
    """Return all envelopes in one picture, and each in one of its own, the best first.

    None and nothing where no suite measured directions.
    """
    unit, found, limit = _envelopes(results)
    steps = step_lines(results)
    if not found:
        return None, []

    def draw(shown: Sequence[Series], width: float, marked: str | None = None) -> Markup:
        what = spans(f"Recovered impulse [{unit}] by push direction", shown, ".3g")
        out = Inline(what, width)
        polar_envelope(out, found, ankle_limit=limit, unit=unit, marked=marked,
                       step_limits=None if marked else steps)  # fmt: skip
        return out.svg

    alone = found if len(found) > 1 else []
    return draw(found, INLINE), [(s.name, draw([s], SMALL, s.name)) for s in alone]


def spans(what: str, found: Sequence[Series], form: str) -> str:
    """Return a description of a plot: the least and the largest value of each series."""
    ranges = [f"{s.name} {np.nanmin(s.y):{form}} to {np.nanmax(s.y):{form}}" for s in found]
    return f"{what}: {'; '.join(ranges)}."


def limit_keys(results: Results) -> dict[str, Markup]:
    """name → look of the lines of limits, for a legend."""
    measured = any("eta_mean" in entry for entry in results.summary["controllers"].values())
    keys = {"ankle limit": sample(INK, LIMIT)} if measured else {}
    for k, name in enumerate(step_lines(results)):
        keys[name] = sample(GREY, step_dashes(k))
    return keys


def step_lines(results: Results) -> dict[str, tuple[list[float], list[float]]]:
    """Return name → (directions, step limit [N·s]); empty if no controller steps.

    Those of the first controller that steps.
    """
    found = results.summary["step_limits"]
    whose = [entry["controllers"] for entry in found]
    if not found:
        return {}
    curves = cast(dict[str, list[float]], found[0]["curves"])
    return {line_name(name, whose): (curves["directions"], curves[name]) for name in DRAWN}


def falls(results: Results) -> tuple[list[tuple[str, Markup]], Download | None]:
    """Fraction of trials that were not recovered (of walks: that fell) over the push, with a title,
    and its bins as CSV.

    There is a picture of each part whose pushes are measured by a limit.
    """
    pictures: list[tuple[str, Markup]] = []
    lines: list[tuple[object, ...]] = []
    for part in (part for part in results.parts if part in PARTS):
        picture, own = _falls(results, part)
        pictures.append((PARTS[part], picture))
        lines += own
    return pictures, download("fall_curves.csv", cells_csv(CURVES, lines)) if lines else None


def _falls(results: Results, part: str) -> tuple[Markup, list[tuple[object, ...]]]:
    """Return the picture of a part, and the bins of each controller.

    Pushes by direction are measured by the ankle limit, as the summary has it.
    """
    limits = {
        direction["direction"]: direction["ankle_limit"]
        for entry in results.summary["controllers"].values()
        for direction in (entry.get("directions", ()) if part in DIRECTIONAL else ())
    }
    title = f"push, in fractions of the {'ankle limit' if limits else results.summary['scale']}"
    trials, fits = {}, {}
    lines: list[tuple[object, ...]] = []
    for name in results.controllers:
        own = [record for record in results.of(name) if record.part == part]
        shares = np.array([record.impulse / limits[record.direction]
                           if limits.get(record.direction) else record.fraction for record in own],
                          dtype=float)  # fmt: skip
        known = np.isfinite(shares)
        trials[name] = shares[known], np.array([record.won for record in own])[known]
        fits[name] = fit = fit_logistic(*trials[name])
        lines += [
            (part, name, *found, *wilson_interval(*found[1:]), fit.j50, fit.bound, fit.scale)
            for found in trial_bins(*trials[name], BINS)
        ]
    j50s = "; ".join(f"{name} {'J50' if fit.bound is None else 'J50, only a bound,'} {fit.j50:.2f}"
                     for name, fit in fits.items())  # fmt: skip
    lost = "fallen" if part == WALK_PUSH else "not recovered"
    out = Inline(f"Fraction of trials {lost}, over the {title}: {j50s}.")
    fall_probability(out, trials, fits, xlabel=title, lost=lost)
    return out.svg, lines


def _envelopes(
    results: Results,
) -> tuple[str, list[Series], tuple[Sequence[float], Sequence[float]] | None]:
    """Unit, series, and the ankle limit where J50 was measured; else they are of sectors."""
    own: dict[str, Sequence[Entry]] = {}
    for name in results.summary["ranking"]:
        entry = results.summary["controllers"][name]
        if aims := entry.get("directions") or entry.get("sectors"):
            own[name] = cast(Sequence[Entry], aims)
    measured = any("j50" in each for entries in own.values() for each in entries)
    key = "j50" if measured else "fraction50"

    def point(entry: Entry) -> tuple[float, ...]:
        ends, side = both_ends(entry.get(f"{key}_ci95")) or NONE, SIDES[entry.get(f"{key}_bound")]
        return entry["direction"], entry.get(key, np.nan), *ends, side

    found = [
        series(name, results.controllers.index(name), sorted(map(point, entries)))
        for name, entries in own.items()
    ]
    if not measured:
        return f"× {results.summary['scale']}", found, None
    angles, limit = zip(*results.summary["robot"]["ankle_limit"], strict=True)
    return "N·s", found, (angles, limit)
