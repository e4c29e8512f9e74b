"""An evaluation for people: plots, and tables in the terminal."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .bootstrap import EnvelopeFit, mean_over_directions
from .files import PLOTS
from .fits import fit_logistic
from .limits import PushLimits
from .plots import fall_probability, polar_envelope
from .seed_groups import seed_lines
from .step_limits import COUNTS, DRAWN, NStepLimit, groups, line_name
from .suite import Suite
from .summary import Outcomes, fractions, pushes, sectors, won
from .trials import Trial


def draw_plots(
    folder: Path,
    suite: Suite,
    trials: Sequence[Trial],
    outcomes: Outcomes,
    limits: PushLimits,
    steps: Mapping[str, NStepLimit] | None = None,
) -> list[Path]:
    """Write the plots of an evaluation; returns their paths, none without pushes.

    Suites by direction show what `steps` of the first controller that steps could stop.
    """
    if trials[0].push is None or trials[0].later:
        return []
    polar, fall = (folder / name for name in PLOTS)
    direction, impulse, duration = pushes(trials)
    ankle = np.array([limits.ankle(d, t) for d, t in zip(direction, duration, strict=True)])
    if suite.by_direction:
        fits = {
            name: mean_over_directions(direction, impulse, won(results))
            for name, results in outcomes.items()
        }
        fine = np.arange(0.0, 360.0, 2.0)
        limit = [limits.ankle(d, float(duration[0])) for d in fine]
        lines = _step_lines(steps or {}, fine, float(duration[0]))
        polar_envelope(polar, _bands(fits), ankle_limit=(fine, limit), step_limits=lines)
        share, label = impulse / ankle, None
    else:
        fits = {name: sectors(trials, results) for name, results in outcomes.items()}
        unit = f"of the {limits.scale}"
        title = f"Recovered share of the {limits.scale} by push direction"
        polar_envelope(polar, _bands(fits), title=title, unit=unit)
        share, label = fractions(trials), f"push impulse, as a fraction of the {limits.scale}"
    fall_probability(
        fall,
        {name: (share, won(results)) for name, results in outcomes.items()},
        {name: fit_logistic(share, won(results)) for name, results in outcomes.items()},
        unit="fraction",
        xlabel=label,
    )
    return [polar, fall]


def _step_lines(
    steps: Mapping[str, NStepLimit], fine: np.ndarray, duration: float
) -> dict[str, Any]:
    """Limits of one and two steps, as `polar_envelope` takes them."""
    whose = list(groups(steps).values())
    return {
        line_name(name, whose): (
            fine,
            [steps[whose[0][0]](angle, duration, COUNTS[name]) for angle in fine],
        )
        for name in (DRAWN if steps else ())
    }


def _bands(fits: Mapping[str, EnvelopeFit]) -> dict[str, Any]:
    """Direction, J50 and its interval, as `polar_envelope` takes them."""
    return {
        name: (
            list(fit.directions),
            [f.fit.j50 for f in fit.fits],
            [f.j50_ci.low for f in fit.fits],
            [f.j50_ci.high for f in fit.fits],
        )
        for name, fit in fits.items()
    }


def print_summary(summary: Mapping[str, Any], console: Console) -> None:
    """Tables of the controllers and of the pairs, a line per group of training seeds."""
    title = escape(f"{summary['suite']} · {summary['robot']} · seed {summary['seed']}")
    console.print(_controllers(summary, title))
    if summary["pairs"]:
        console.print(_pairs(summary))
    for line in seed_lines(summary["seeds"]):
        console.print(line, markup=False, highlight=False)


def _controllers(summary: Mapping[str, Any], title: str) -> Table:
    entries = summary["controllers"]
    first = next(iter(entries.values()))
    table = Table(title=title, title_justify="left")
    table.add_column("controller", overflow="fold", min_width=_room(entries, 16))
    columns: list[tuple[str, Any]] = [
        ("recovered", lambda e: f"{e['recovered']}/{e['trials']}"),
        ("rate [95 %]", lambda e: _with_range(e, "recovered_rate", "recovered_ci95", ".1%")),
    ]
    if "j50_mean" in first:
        columns += [
            ("mean J50 [N·s]", lambda e: _with_range(e, "j50_mean", "j50_mean_ci95", ".1f")),
            ("worst J50", lambda e: f"{e['j50_min']:.1f}{_open(e)}"),
            ("η mean, min", lambda e: f"{e['eta_mean']:.2f}, {e['eta_min']:.2f}"),
        ]
    if "fraction50" in first:
        columns.append((f"half at, of {first['fraction_of']}", _half))
    if "j50_mean" not in first and "fraction50" not in first:
        rate = ("never_fell_rate", "never_fell_ci95", ".1%")
        columns.append(("never fell [95 %]", lambda e: _with_range(e, *rate)))
    if any(entry["com_drift_max"] is not None for entry in entries.values()):
        columns.append(("CoM drift [mm]", lambda e: _milli(e["com_drift_max"])))
    if any(entry["steps_max"] for entry in entries.values()):
        columns.append(("steps, mean", lambda e: _number(e["steps_mean"], ".1f")))
    if any("step_share_1_mean" in entry for entry in entries.values()):
        columns.append(("of one-step limit", _step_share))
    columns += [
        ("solver failures", lambda e: f"{e['solver_failures']}"),
        ("mean |action|", lambda e: _number(e["mean_abs_action"], ".3f")),
    ]
    for name, _ in columns:
        table.add_column(name, justify="right", overflow="fold")
    for name, entry in entries.items():
        table.add_row(escape(name), *(text(entry) for _, text in columns))
    return table


def _pairs(summary: Mapping[str, Any]) -> Table:
    table = Table()
    titles = [f"{pair['b']} against {pair['a']}" for pair in summary["pairs"]]
    table.add_column("b against a", overflow="fold", min_width=_room(titles, 34))
    names = ["both", "only a (lost)", "only b (won)", "neither", "McNemar p"]
    gain = "j50_gain" in summary["pairs"][0]
    for name in names + (["J50 gain [95 %]"] if gain else []):
        table.add_column(name, justify="right")
    for title, pair in zip(titles, summary["pairs"], strict=True):
        cells = [str(pair[key]) for key in ("both", "only_a", "only_b", "neither")]
        cells.append(f"{pair['p_mcnemar']:.2g}")
        if gain:
            cells.append(_with_range(pair, "j50_gain", "j50_gain_ci95", "+.1%"))
        table.add_row(escape(title), *cells)
    return table


def _room(names: Iterable[str], most: int) -> int:
    """Width of a column of names that are not to be cut, but for those longer than `most`."""
    return min(max(len(name) for name in names), most)


def _step_share(entry: Mapping[str, Any]) -> str:
    """J50 over the one-step limit, mean over the directions; others are in summary.json."""
    return _number(entry.get("step_share_1_mean"), ".2f")


def _half(entry: Mapping[str, Any]) -> str:
    sign = {None: "", "lower": "≥ ", "upper": "≤ "}[entry["fraction50_bound"]]
    return f"{sign}{entry['fraction50']:.2f}"


def _open(entry: Mapping[str, Any]) -> str:
    """A remark where the pushes did not reach from recovery to fall in every direction."""
    return f" ({entry['j50_bounded']} only bounds)" if entry["j50_bounded"] else ""


def _with_range(entry: Mapping[str, Any], value: str, interval: str, form: str) -> str:
    low, high = (_number(end, form) for end in entry[interval])
    return f"{_number(entry[value], form)} [{low}, {high}]"


def _number(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _milli(value: float | None) -> str:
    return "–" if value is None else f"{1000 * value:.1f}"
