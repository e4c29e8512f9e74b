"""The leaderboard pages, generated from committed files summary.json."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from poise.configs.errors import ConfigError
from poise.configs.files import write_atomic
from poise.configs.reading import is_folder
from poise.configs.texts import code, markdown_table, plain
from poise.training.benchmarking.evaluation.tables import IN_PAIRS, places, ranked, table_columns
from poise.training.benchmarking.metrics.seed_groups import seed_lines
from poise.training.running.columns import (
    CHATTER,
    ETA_MEAN,
    ETA_WORST,
    J50_KEPT,
    J50_MEAN,
    J50_PER_MASS,
    NONE,
    RECOVERED,
    ROOT,
    TICK,
    Figure,
    known,
)
from poise.training.running.files import SUMMARY
from poise.training.running.summary import Entry, Summary

from .scenario_page import is_of_scenarios, scenario_page
from .summary import read_summary
from .walking_leaderboard import is_of_walks, walking_leaderboard

PAGE, WALKING_PAGE = Path("docs/leaderboard.md"), Path("docs/walking-leaderboard.md")
SCENARIO_PAGE = Path("docs/scenarios.md")
HEAD = """# Leaderboard{of}

<!-- Written by `poise leaderboard {source}`: change the result, not this page. -->

Suite {suite}, robot {robot}, seed {seed}; Poise {poise}, MuJoCo {mujoco}, commit {commit};
{processor}, {cores} cores. Intervals are 95 %; what the columns mean: [benchmark.md](benchmark.md).
`lost, won` and McNemar's p are against {reference} on the {paired}. `root [N]` is the largest
force that a controller took from nowhere: only those with 0 obey physics, the others have no rank.
Equal results share a rank. η is J50 over the robot's own ankle limit. Chatter is how much torques
change, over the motors' limits. Columns of levels of [realism](realism.md) have the recovered rate
of the same pushes.

"""


HUMANOID: Final = "humanoid"  # whose page names no robot
COLUMNS = {"recovered of the mix", *IN_PAIRS, *(each.heading for each in (
    J50_MEAN, ETA_MEAN, ETA_WORST, RECOVERED, ROOT, TICK))}  # fmt: skip
SAME: Final = ("suite", "seed", "robot", "reference")  # of results that may stand in one table


def write_leaderboard(sources: Sequence[str | Path], page: str | Path | None = None) -> Path:
    """Write the page from files summary.json that have J50s, or folders that hold one; returns it.

    Results of a suite that walks make the page of walks, those of scenarios theirs, and results of
    two kinds none. Without a `page` it is the kind's own. Raises ConfigError for another file, or
    of another suite, seed, robot or reference than the first; PoiseError when the page cannot be
    written.
    """
    summaries = {}
    for source in sources:
        path = Path(source)
        path = path / SUMMARY if is_folder(path) else path
        summaries[str(source)] = read_summary(path)
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
        write_atomic(page, walking_leaderboard(summaries))
    else:
        page = Path(page or PAGE)
        write_atomic(page, leaderboard(summaries))
    return page


def merged(summaries: Mapping[str, Summary]) -> tuple[Summary, dict[str, str]]:
    """The first result with the rows of later ones; and whose result each row is.

    A controller of a later result takes the place of an earlier one of its name; the reference
    stays that of the first.
    """
    (first, summary), *later = summaries.items()
    reference = summary["reference"]
    entries, origin = dict(summary["controllers"]), dict.fromkeys(summary["controllers"], first)
    pairs = {pair["b"]: pair for pair in summary["pairs"] if pair["a"] == reference}
    for source, other in later:
        both = _sampled(summary) & _sampled(other)
        for key, own, theirs in zip(SAME, _same(summary, both), _same(other, both), strict=True):
            if own != theirs:
                raise ConfigError(f"is not that of {first}", source=source, field=key)
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


def _sampled(summary: Summary) -> set[float]:
    """Directions in which the ankle limit is told [deg]; later results have its corners, too."""
    return {direction for direction, _ in summary["robot"]["ankle_limit"]}


def _same(summary: Summary, directions: set[float]) -> tuple[object, ...]:
    """What results of one page have in common; of the ankle limit that in these directions."""
    limit = [row for row in summary["robot"]["ankle_limit"] if row[0] in directions]
    alike = {**summary, "robot": {**summary["robot"], "ankle_limit": limit}}
    return tuple(alike[key] for key in SAME)


def _shape(entry: Entry) -> tuple[int, list[int]]:
    """The number of a controller's directions, and of levels of each factor."""
    return len(entry["directions"]), [len(f["levels"]) for f in entry.get("factors", ())]


def leaderboard(summaries: Mapping[str, Summary]) -> str:
    """The page as Markdown; `summaries` by where they come from."""
    summary, origin = merged(summaries)
    versions, machine = summary["versions"], summary["machine"]
    text = HEAD.format(
        of="" if summary["robot"]["name"] == HUMANOID else f": {code(summary['robot']['name'])}",
        paired=plain(summary["rated"] or "pushes that both met"),
        source=plain(" ".join(summaries)),
        suite=code(summary["suite"]),
        robot=code(summary["robot"]["name"]),
        seed=summary["seed"],
        poise=plain(versions.get("poise")),
        mujoco=plain(versions.get("mujoco")),
        commit=code((summary["commit"] or "unknown")[:10]),
        processor=plain(machine["processor"]),
        cores=machine["cores"],
        reference=code(summary["reference"]),
    )
    for source, other in list(summaries.items())[1:]:
        names = ", ".join(code(name) for name in summary["ranking"] if origin[name] == source)
        text += f"Played later, commit {code((other['commit'] or 'unknown')[:10])}, "
        text += f"{plain(other['machine']['processor'])}, {other['machine']['cores']} cores: "
        text += f"{names}.\n\n"
    text += markdown_table(*_ranked(summary))
    if lines := seed_lines(summary["seeds"]):
        text += "\n" + "\n".join(f"- {line}" for line in lines) + "\n"
    text += "\nη per direction (0° is forward, 90° left):\n\n"
    text += markdown_table(*_directions(summary))
    factors = _factors(summary)
    if factors is not None:
        text += "\nRecovered rate per level of a factor, all else standard:\n\n"
        text += markdown_table(*factors)
    return text


Cells = list[list[str]]


def _ranked(summary: Summary) -> tuple[list[str], Cells]:
    entries = summary["controllers"]
    columns = [
        (heading, text)
        for heading, text in table_columns(summary)
        if heading in COLUMNS and (summary["rated"] or heading != RECOVERED.heading)
    ]  # else each of its own pushes
    columns += [(CHATTER.heading, lambda name: CHATTER.text(entries[name])), *_levels(summary)]
    columns.insert(1, (J50_PER_MASS.unit, lambda name: f"{entries[name]['j50_mean_per_mass']:.2f}"))
    rank = places(entries)
    rows = [[str(rank[name] or NONE), code(name), *(text(name) for _, text in columns)]
            for name in summary["ranking"]]  # fmt: skip
    return ["", "controller", *(heading for heading, _ in columns)], rows


def _levels(summary: Summary) -> Iterator[tuple[str, Callable[[str], str]]]:
    """Columns for each level of realism, the suite's own first: what was recovered of the same
    pushes, and J50 there."""
    entries = summary["controllers"]
    for k, factor in enumerate(entries[summary["ranking"][0]].get("factors", ())):
        levels = enumerate(factor["levels"] if factor["factor"] == "realism" else ())
        for i, level in sorted(levels, key=lambda each: not each[1]["standard"]):

            def rate(name: str, k: int = k, i: int = i) -> str:
                return f"{entries[name]['factors'][k]['levels'][i]['recovered_rate']:.0%}"

            yield code(level["level"]), rate
    others = entries[summary["ranking"][0]].get("levels", [])[1:]
    for i, other in enumerate(others, 1):
        for figure in known([J50_MEAN, J50_KEPT], [other]):

            def text(name: str, i: int = i, figure: Figure = figure) -> str:
                levels = entries[name].get("levels", [])  # of another result there may be none
                return figure.text(levels[i]) if i < len(levels) else NONE

            yield f"{figure.name}, {code(other['level'])}", text


def _directions(summary: Summary) -> tuple[list[str], Cells]:
    entries = summary["controllers"]
    angles = [d["direction"] for d in entries[summary["ranking"][0]]["directions"]]
    rows = [
        [code(name), *(f"{d['eta']:.2f}" for d in entries[name]["directions"])]
        for name in summary["ranking"]
    ]
    limit = {angle: impulse for angle, impulse in summary["robot"]["ankle_limit"]}
    if all(angle in limit for angle in angles):
        rows.insert(0, ["η = 1 at [N·s]", *(f"{limit[angle]:.1f}" for angle in angles)])
    return ["controller", *(f"{angle:g}°" for angle in angles)], rows


def _factors(summary: Summary) -> tuple[list[str], Cells] | None:
    names, entries = summary["ranking"], summary["controllers"]
    rows = []
    for k, factor in enumerate(entries[names[0]].get("factors", ())):
        for i, level in enumerate(factor["levels"]):
            here = [entries[name]["factors"][k]["levels"][i] for name in names]
            mark = " (standard)" if level["standard"] else ""
            rates = (f"{cell['recovered_rate']:.0%}" for cell in here)
            rows.append([plain(factor["factor"]), f"{plain(level['level'])}{mark}", *rates])
    return (["factor", "level", *(code(name) for name in names)], rows) if rows else None
