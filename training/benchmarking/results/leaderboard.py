"""The leaderboard pages, generated from committed files summary.json."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.reading import is_file, is_folder
from poise.configs.texts import code, plain
from poise.training.benchmarking.evaluation.tables import (
    IN_PAIRS,
    ranked,
    shared_ranks,
    table_cells,
)
from poise.training.benchmarking.metrics.seed_groups import seed_lines
from poise.training.running.columns import (
    CHATTER,
    ETA_MEAN,
    ETA_WORST,
    J50_KEPT,
    J50_MEAN,
    J50_PER_MASS,
    NONE,
    NOT_FALLEN,
    RECOVERED,
    ROOT,
    TICK,
    known,
)
from poise.training.running.files import SETTINGS, SUMMARY, TRIALS
from poise.training.running.summary import Entry, Summary

from .pages import Table, check_alike, page_of
from .read import load_results
from .scenario_page import is_of_scenarios, scenario_page
from .summary import read_summary
from .walking_leaderboard import is_of_walks, walking_leaderboard

PAGE, WALKING_PAGE = Path("docs/leaderboard.md"), Path("docs/walking-leaderboard.md")
SCENARIO_PAGE = Path("docs/scenarios.md")
COLUMNS = {"recovered, mix", *IN_PAIRS, *(each.heading for each in (
    J50_MEAN, ETA_MEAN, ETA_WORST, RECOVERED, NOT_FALLEN, ROOT, TICK))}  # fmt: skip
MOST_COLUMNS = 8  # controllers beside each other in a page's table of factors
SAME: Final = ("suite", "seed", "robot", "reference")  # of results that may stand in one table


def write_leaderboard(sources: Sequence[str | Path], page: str | Path | None = None) -> Path:
    """Write the page from files summary.json that have J50s, or folders of them; returns it.

    Results of a suite that walks make the page of walks, those of scenarios theirs, and results of
    two kinds none. Without a `page` it is the kind's own. Raises ConfigError for another file, or
    of another suite, seed, robot or reference than the first; PoiseError when the page cannot be
    written.
    """
    summaries = {str(path): _summary(path) for source in sources for path in _results(Path(source))}
    kinds = {source: (is_of_walks(summary), is_of_scenarios(summary))
             for source, summary in summaries.items()}  # fmt: skip
    walks, scenarios = next(iter(kinds.values()))
    for source, kind in kinds.items():
        if kind != (walks, scenarios):
            of = "scenarios" if kind[1] != scenarios else "walks"
            raise ConfigError(f"is not of {of} as the first is, or the other way round",
                              source=source, field="suite")  # fmt: skip
    if scenarios:
        page = Path(page or SCENARIO_PAGE)
        write_atomic(page, scenario_page(summaries, str(page)))
    elif walks:
        page = Path(page or WALKING_PAGE)
        write_atomic(page, walking_leaderboard(summaries, [str(source) for source in sources]))
    else:
        page = Path(page or PAGE)
        write_atomic(page, leaderboard(summaries))
    return page


def _results(source: Path) -> list[Path]:
    """Of a folder that is no result itself the .json files in it, by name."""
    if not is_folder(source) or is_file(source / SUMMARY):
        return [source]
    return sorted(source.glob("*.json")) or [source]


def _summary(path: Path) -> Summary:
    """Of a file, or of a folder, where older walks are judged again if it has their trials."""
    if not is_folder(path):
        return read_summary(path)
    whole = is_file(path / TRIALS) and is_file(path / SETTINGS)
    return load_results(path).summary if whole else read_summary(path / SUMMARY)


def leaderboard(summaries: Mapping[str, Summary]) -> str:
    """Return the page as Markdown; `summaries` by where they come from."""
    summary, origin = merged(summaries)
    (_, first), *later = summaries.items()
    return page_of(
        "leaderboard.md.j2",
        source=" ".join(summaries),
        first=first,
        robot=first["robot"]["name"],
        later=[(other, [name for name in summary["ranking"] if origin[name] == source])
               for source, other in later],
        ranking=_ranking(summary),
        seeds=seed_lines(summary["seeds"]),
        factors=_factors(summary),
    )  # fmt: skip


def merged(summaries: Mapping[str, Summary]) -> tuple[Summary, dict[str, str]]:
    """Return the first result with the rows of later ones, and the source of each row.

    A controller of a later result takes the place of an earlier one of its name; the reference
    stays that of the first.
    """
    (first, summary), *later = summaries.items()
    for source, other in later:
        common = _angles(summary) & _angles(other)  # later results have the limit's corners, too
        check_alike({first: summary, source: other}, partial(_shared, common))
    reference = summary["reference"]
    entries, origin = dict(summary["controllers"]), dict.fromkeys(summary["controllers"], first)
    pairs = {pair["b"]: pair for pair in summary["pairs"] if pair["a"] == reference}
    for source, other in later:
        for name in other["controllers"]:
            if name != reference:
                entries[name], origin[name] = other["controllers"][name], source
                pairs.pop(name, None)
        pairs |= {pair["b"]: pair for pair in other["pairs"] if pair["a"] == reference}
    for name, entry in entries.items():
        if not entry.get("directions"):
            raise ConfigError("does not measure J50", source=origin[name],
                              field=f"controllers.{name}")  # fmt: skip
        if _shape(entry) != _shape(entries[reference]):
            raise ConfigError(f"has other directions or levels than {first}", source=origin[name],
                              field=f"controllers.{name}")  # fmt: skip
    whole: Summary = {**summary, "controllers": entries, "pairs": list(pairs.values()),
                      "ranking": ranked(entries)}  # fmt: skip
    return whole, origin


def _angles(summary: Summary) -> set[float]:
    """Return the directions in which the ankle limit is listed [deg]."""
    return {angle for angle, _ in summary["robot"]["ankle_limit"]}


def _shared(angles: set[float], summary: Summary) -> dict[str, object]:
    """What results of one page have in common; of the ankle limit that at these `angles`."""
    limit = [row for row in summary["robot"]["ankle_limit"] if row[0] in angles]
    alike = {**summary, "robot": {**summary["robot"], "ankle_limit": limit}}
    return {key: alike[key] for key in SAME}


def _shape(entry: Entry) -> tuple[list[float], list[int]]:
    """Return a controller's directions, and the number of levels of each factor."""
    angles = [direction["direction"] for direction in entry["directions"]]
    return angles, [len(factor["levels"]) for factor in entry.get("factors", ())]


def _ranking(summary: Summary) -> Table:
    entries, names = summary["controllers"], summary["ranking"]
    cells = {
        heading: texts
        for heading, texts in table_cells(summary).items()
        if heading in COLUMNS and (summary["rated"] or heading != RECOVERED.heading)
    }  # else each of its own pushes
    per_mass = [f"{entries[name]['j50_mean_per_mass']:.2f}" for name in names]
    cells = {J50_MEAN.heading: cells.pop(J50_MEAN.heading), J50_PER_MASS.unit: per_mass, **cells}
    cells[CHATTER.heading] = [CHATTER.text(entries[name]) for name in names]
    at_levels = [dict(_realism(entries[name])) for name in names]
    cells |= {level: [own.get(level, NONE) for own in at_levels] for level in at_levels[0]}
    rank = shared_ranks(entries)
    rows = [
        [str(rank[name] or NONE), code(name), *texts]
        for name, texts in zip(names, zip(*cells.values(), strict=True), strict=True)
    ]
    return ["", "controller", *cells], rows


def _realism(entry: Entry) -> Iterator[tuple[str, str]]:
    """Yield heading and cell of each realism level, the suite's own first: the recovered rate of
    the same pushes, and J50."""
    for factor in entry.get("factors", ()):
        levels = factor["levels"] if factor["factor"] == "realism" else []
        for level in sorted(levels, key=lambda each: not each["standard"]):
            yield code(level["level"]), f"{level['recovered_rate']:.0%}"
    for other in entry.get("levels", [])[1:]:
        for figure in known([J50_MEAN, J50_KEPT], [other]):
            yield f"{figure.name}, {code(other['level'])}", figure.text(other)


def _factors(summary: Summary) -> Table:
    """Return the recovered rates at each level: the standard's once, since its trials are those of
    every factor, and no realism levels, which are columns of the ranking. The first controllers
    only: the results have all."""
    names = summary["ranking"][:MOST_COLUMNS]
    found = [summary["controllers"][name].get("factors", []) for name in names]
    standard: dict[tuple[str, ...], list[str]] = {}
    rows = []
    for factors in zip(*found, strict=True):
        for levels in zip(*(factor["levels"] for factor in factors), strict=True):
            factor, level = plain(factors[0]["factor"]), plain(levels[0]["level"])
            rates = tuple(f"{level['recovered_rate']:.0%}" for level in levels)
            if levels[0]["standard"]:
                standard.setdefault(rates, []).append(f"{factor} {level}")
            elif factors[0]["factor"] != "realism":
                rows.append([factor, level, *rates])
    first = [["standard", ", ".join(where), *rates] for rates, where in standard.items()]
    return ["factor", "level", *(code(name) for name in names)], [*first, *rows]
