"""Compare two results, with intervals."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from poise.training.benchmarking.evaluation.folder import Settings
from poise.training.benchmarking.metrics.pairs import counted
from poise.training.benchmarking.statistics.differences import difference
from poise.training.running.columns import (
    AS_COMMANDED,
    ETA_MEAN,
    J50_MEAN,
    NOT_FALLEN,
    RECOVERED,
    Figure,
)
from poise.training.running.summary import Entry, Level, both_ends
from poise.training.running.trial_figures import Interval, Rate

from .read import Results, load_results


@dataclass(frozen=True)
class Change:
    """A figure in both results: b − a with its 95 % interval."""

    controller: str
    figure: str
    a: float
    b: float
    change: float
    low: float
    high: float
    note: str = ""

    @property
    def certain(self) -> bool:
        """True if the interval leaves zero out."""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class Comparison:
    """The differing `settings`; controllers in one result only, changed, or identical in all trials
    (these have no `changes`)."""

    settings: tuple[str, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    changed: tuple[str, ...]
    identical: tuple[str, ...]
    changes: tuple[Change, ...]


def compare(a: str | Path, b: str | Path) -> Comparison:
    """Compare two folders written by `poise evaluate` or `poise benchmark`.

    Rates of common trials are compared in pairs (McNemar, Newcombe), all other figures by their
    intervals [Zou08].

    Raises ConfigError for a folder that holds no finished result.
    """
    first, second = load_results(a), load_results(b)
    names = [name for name in first.controllers if name in second.controllers]
    identical = tuple(name for name in names if _outcomes(first, name) == _outcomes(second, name))
    marks = first.settings.controllers, second.settings.controllers
    compared = (f.name for f in fields(Settings) if f.name != "controllers")
    return Comparison(
        settings=tuple(
            key for key in compared if getattr(first.settings, key) != getattr(second.settings, key)
        ),
        only_a=tuple(name for name in first.controllers if name not in second.controllers),
        only_b=tuple(name for name in second.controllers if name not in first.controllers),
        changed=tuple(name for name in names if marks[0][name] != marks[1][name]),
        identical=identical,
        changes=tuple(
            change
            for name in names
            if name not in identical
            for change in _changes(name, first, second)
        ),
    )


def print_comparison(found: Comparison, a: str | Path, b: str | Path, console: Console) -> None:
    """The comparison as a table; changes whose interval leaves zero out are marked."""
    for key in found.settings:
        console.print(f"settings differ: {key}", markup=False)
    if found.settings:
        console.print("so the trials are not the same: figures are compared by their intervals, "
                      "not in pairs", soft_wrap=True)  # fmt: skip
    for names, text in (
        (found.only_a, f"only in {a}"),
        (found.only_b, f"only in {b}"),
        (found.changed, "another version of the controller"),
        (found.identical, "the same outcome in every trial"),
    ):
        if names:
            console.print(f"{text}: {', '.join(names)}", markup=False)
    if not (found.changes or found.identical):
        console.print("nothing to compare: the two results have no controller and figure in common")
    if not found.changes:
        return
    table = Table(title=escape(f"{b} against {a}"), title_justify="left")
    table.add_column("controller", overflow="fold")
    table.add_column("figure", overflow="fold")
    for name in ("a", "b", "b − a [95 %]"):
        table.add_column(name, justify="right")
    table.add_column("")
    for c in found.changes:
        change = f"{c.change:+.3g} [{c.low:+.3g}, {c.high:+.3g}]"
        mark = "" if not c.certain else "more" if c.change > 0 else "less"
        note = ", ".join(text for text in (mark, c.note) if text)
        table.add_row(escape(c.controller), c.figure, f"{c.a:.4g}", f"{c.b:.4g}", change, note)
    console.print(table)


def _outcomes(results: Results, name: str) -> dict[tuple[str, ...], tuple[bool, bool]]:
    """Return key of a paired trial → its outcome."""
    return {record.met: (record.recovered, record.upright) for record in results.of(name)}


def _changes(name: str, a: Results, b: Results) -> Iterator[Change]:
    one, two = (results.summary["controllers"][name] for results in (a, b))
    if "j50_mean" in one and "j50_mean" in two:
        yield from _by_intervals(name, J50_MEAN.heading, (one["j50_mean"], one["j50_mean_ci95"]),
                                 (two["j50_mean"], two["j50_mean_ci95"]))  # fmt: skip
        yield from _by_intervals(name, ETA_MEAN.heading, (one["eta_mean"], one["eta_mean_ci95"]),
                                 (two["eta_mean"], two["eta_mean_ci95"]))  # fmt: skip
    if a.summary["rated"] == b.summary["rated"]:
        rated = a.summary["rated"]
        walked = one.get("criterion") == two.get("criterion") == "not fallen"
        for figure in (NOT_FALLEN, AS_COMMANDED) if walked else (RECOVERED, NOT_FALLEN):
            title = f"{figure.name}, {rated}" if rated else figure.name
            yield from _rates(name, title, figure, one, two, a, b, part=rated)
    for (factor, level), before, after in _levels(one, two):
        title = f"{factor} {level}"
        yield from _rates(name, title, RECOVERED, before, after, a, b, factor, level)
    angles = {d["direction"]: d for d in two.get("directions", ())}
    for d in one.get("directions", ()):
        if (other := angles.get(d["direction"])) is not None:
            title = f"J50 at {d['direction']:g}° [N·s]"
            pair = (d["j50"], d["j50_ci95"]), (other["j50"], other["j50_ci95"])
            yield from _by_intervals(name, title, *pair)


Estimate = tuple[float, Interval]


def _by_intervals(name: str, title: str, before: Estimate, after: Estimate) -> Iterator[Change]:
    """Yield a figure with an interval of its own in both; none where an interval is open."""
    around = both_ends(before[1]), both_ends(after[1])
    if around[0] is not None and around[1] is not None:
        change, (low, high) = difference(before[0], around[0], after[0], around[1])
        yield Change(name, title, before[0], after[0], change, low, high)


def _rates(
    name: str,
    title: str,
    figure: Figure,
    one: Rate,
    two: Rate,
    a: Results,
    b: Results,
    factor: str | None = None,
    level: str | None = None,
    *,
    part: str | None = None,
) -> Iterator[Change]:
    """Yield the change of the recovered rate, or of that without a fall.

    It is paired where both results have the same trials, else by intervals; none where an older
    result lacks the rate.
    """
    before, after = figure.value(one), figure.value(two)
    if before is None or after is None:
        return
    which = 1 if figure is NOT_FALLEN else 0
    required = {"factor": factor, "level": level, "part": part}
    others = _outcomes(b, name)
    pairs = [
        ((record.recovered, record.upright)[which], others[record.met][which])
        for record in a.of(name)
        if record.met in others
        and record.met_by_all
        and all(value is None or record.line[key] == value for key, value in required.items())
    ]
    found = counted(pairs)
    ends = None if found is None else both_ends(found["rate_gain_ci95"])
    if found is None or ends is None or not len(pairs) == one["trials"] == two["trials"]:
        intervals = figure.interval(one), figure.interval(two)
        if intervals[0] is not None and intervals[1] is not None:
            pair = (before, intervals[0]), (after, intervals[1])
            yield from _by_intervals(name, title, *pair)
        return
    note = f"{found['only_a']} lost, {found['only_b']} won, p = {found['p_mcnemar']:.2g}"
    yield Change(name, title, before, after, found["rate_gain"], *ends, note)


def _levels(one: Entry, two: Entry) -> Iterator[tuple[tuple[str, str], Level, Level]]:
    """Levels of the factors that both have, but for the standard case."""
    before, after = (
        {(factor["factor"], level["level"]): level
         for factor in entry.get("factors", ()) for level in factor["levels"]}
        for entry in (one, two)
    )  # fmt: skip
    for key, level in before.items():
        if key in after and not level["standard"]:
            yield key, level, after[key]
