"""What changed between two results: evaluations or benchmarks, with intervals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from poise.configs.errors import ConfigError
from poise.configs.reading import is_file, read_json, read_table, read_yaml
from poise.training.running.files import SETTINGS, SUMMARY, TRIALS
from poise.training.statistics.differences import difference, paired_rates
from poise.training.statistics.rates import mcnemar

from .summary_form import check_compared
from .values import interval, number

IGNORED = ("controllers",)  # of settings: compared one by one


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
        """Whether the interval leaves zero out."""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class Comparison:
    """`settings` are the fields that differ; controllers: in one only, changed, or alike in every
    trial, which have no `changes` then."""

    settings: tuple[str, ...]
    only_a: tuple[str, ...]
    only_b: tuple[str, ...]
    changed: tuple[str, ...]
    identical: tuple[str, ...]
    changes: tuple[Change, ...]


def compare(a: str | Path, b: str | Path) -> Comparison:
    """Compare two folders of one kind, written by `poise benchmark` or `poise evaluate`.

    Rates of trials that both have, alike in seed and push, are compared in pairs (McNemar,
    Newcombe); all else by the intervals of the two figures [Zou08].

    Raises ConfigError for a folder that holds no finished result, or two of different kinds.
    """
    first, second = _Result(Path(a)), _Result(Path(b))
    if first.is_benchmark != second.is_benchmark:
        raise ConfigError("one is a benchmark, the other an evaluation", source=f"{a}, {b}")
    names = [name for name in first.controllers if name in second.controllers]
    identical = tuple(name for name in names if first.outcomes(name) == second.outcomes(name))
    marks_a, marks_b = first.settings["controllers"], second.settings["controllers"]
    return Comparison(
        settings=tuple(
            key
            for key in {**first.settings, **second.settings}
            if key not in IGNORED and first.settings.get(key) != second.settings.get(key)
        ),
        only_a=tuple(name for name in first.controllers if name not in second.controllers),
        only_b=tuple(name for name in second.controllers if name not in first.controllers),
        changed=tuple(name for name in names if marks_a.get(name) != marks_b.get(name)),
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
    for names, text in (
        (found.only_a, f"only in {a}"),
        (found.only_b, f"only in {b}"),
        (found.changed, "another version of the controller"),
        (found.identical, "the same outcome in every trial"),
    ):
        if names:
            console.print(f"{text}: {', '.join(names)}", markup=False)
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


class _Result:
    """A result folder, as far as a comparison needs it."""

    def __init__(self, folder: Path):
        self.folder = folder
        if not is_file(folder / SUMMARY):
            raise ConfigError(
                "cannot be read (no such file): not a finished result", source=folder / SUMMARY
            )
        self.summary = read_json(folder / SUMMARY)
        controllers = self.summary.get("controllers")
        if not isinstance(controllers, dict):
            raise ConfigError("is no summary of a result: it has no controllers",
                              source=folder / SUMMARY)  # fmt: skip
        check_compared(self.summary, folder / SUMMARY)
        self.controllers: dict[str, Any] = controllers
        self.settings = read_yaml(folder / SETTINGS)
        if not isinstance(self.settings.get("controllers"), dict):
            raise ConfigError("must be a mapping", source=folder / SETTINGS, field="controllers")
        self.is_benchmark = "benchmark" in self.summary
        self.trials = self._trials() if is_file(folder / TRIALS) else {}

    def outcomes(self, name: str) -> dict[tuple[str, ...], bool]:
        """The trials of a controller."""
        return {key: won for key, won in self.trials.items() if key[1] == name}

    def _trials(self) -> dict[tuple[str, ...], bool]:
        """What both must share to be a pair → whether it was recovered."""
        columns, rows = read_table(self.folder / TRIALS)
        if "recovered" not in columns:
            raise ConfigError("has no column 'recovered'", source=self.folder / TRIALS)
        shared = columns[: columns.index("recovered")]
        if shared[1:2] != ("controller",):
            raise ConfigError("its second column must be 'controller'", source=self.folder / TRIALS)
        return {tuple(row[c] for c in shared): row["recovered"] == "True" for row in rows}


def _changes(name: str, a: _Result, b: _Result) -> Iterator[Change]:
    one, two = a.controllers[name], b.controllers[name]
    for title, key in (("mean J50 [N·s]", "j50_mean"), ("mean η", "eta_mean")):
        yield from _by_intervals(name, title, one, two, key, f"{key}_ci95")
    if a.is_benchmark:
        if one.get("mix") and two.get("mix"):
            yield from _rates(name, "recovered of the mix", one["mix"], two["mix"], a, b, ("mix",))
        for factor, level, before, after in _levels(one["factors"], two["factors"]):
            yield from _rates(name, f"{factor} {level}", before, after, a, b,
                              ("factors", factor, level))  # fmt: skip
    else:
        yield from _rates(name, "recovered", one, two, a, b, ())
    angles: dict[float, Mapping] = {d["direction"]: d for d in two.get("directions", ())}
    for before in one.get("directions", ()):
        other = angles.get(before["direction"])
        if other is not None:
            title = f"J50 at {before['direction']:g}° [N·s]"
            yield from _by_intervals(name, title, before, other, "j50", "j50_ci95")


def _by_intervals(
    name: str, title: str, one: Mapping, two: Mapping, key: str, ends: str
) -> Iterator[Change]:
    """A figure with an interval of its own in both."""
    where = f"controllers.{name}"
    before, after = (number(entry, key, where) for entry in (one, two))
    around = [interval(entry, ends, where) for entry in (one, two)]
    if before is None or after is None or around[0] is None or around[1] is None:
        return
    change, (low, high) = difference(before, around[0], after, around[1])
    yield Change(name, title, before, after, change, low, high)


def _rates(
    name: str,
    title: str,
    one: Mapping,
    two: Mapping,
    a: _Result,
    b: _Result,
    where: tuple[str, ...],
) -> Iterator[Change]:
    """A recovered rate: in pairs if both played the same trials, else by intervals."""
    counts = _pairs(name, a, b, where)
    rate_a, rate_b = one["recovered_rate"], two["recovered_rate"]
    if counts is None or sum(counts) != one["trials"] or sum(counts) != two["trials"]:
        change, (low, high) = difference(
            rate_a, one["recovered_ci95"], rate_b, two["recovered_ci95"]
        )
        yield Change(name, title, rate_a, rate_b, change, low, high)
        return
    change, (low, high) = paired_rates(*counts)
    p = mcnemar(counts[1], counts[2]).p_value
    note = f"{counts[1]} lost, {counts[2]} won, p = {p:.2g}"
    yield Change(name, title, rate_a, rate_b, change, low, high, note)


def _pairs(
    name: str, a: _Result, b: _Result, where: tuple[str, ...]
) -> tuple[int, int, int, int] | None:
    """Both, only a, only b, neither: of the trials that are alike in a and b.

    `where` are the first of part, factor and level, in a benchmark.
    """
    table = {(x, y): 0 for x in (True, False) for y in (True, False)}
    for key, recovered in a.trials.items():
        if key[1] == name and key[4 : 4 + len(where)] == where and key in b.trials:
            table[recovered, b.trials[key]] += 1
    return tuple(table.values()) if sum(table.values()) else None  # type: ignore[return-value]


def _levels(
    one: Sequence[Mapping], two: Sequence[Mapping]
) -> Iterator[tuple[str, str, Mapping, Mapping]]:
    """Levels of the factors that both have."""
    after = {(f["factor"], level["level"]): level for f in two for level in f["levels"]}
    for factor in one:
        for level in factor["levels"]:
            if (factor["factor"], level["level"]) in after and not level["standard"]:
                yield (factor["factor"], level["level"], level,
                       after[factor["factor"], level["level"]])  # fmt: skip
