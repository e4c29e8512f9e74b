"""The page of the controllers that walk, generated from committed files summary.json."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from poise.configs.errors import ConfigError
from poise.configs.texts import code, plain
from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.evaluation.tables import assisted, j50_mean_text, shared_ranks
from poise.training.running.columns import (
    COSTS,
    FALLS,
    FOLLOWED,
    J50_MEAN,
    NONE,
    STEPS,
)
from poise.training.running.summary import Entry, Summary
from poise.training.running.trial_figures import NOT_FALLEN, WalkLevel

from .pages import Table, check_alike, page_of

OF_J50 = ("j50", "j90", "eta", "directions")  # how the keys of J50's figures begin
UNPUSHED, PUSHED, KICKED = "walk", "walk_push", "walk_kick"


def is_of_walks(summary: Summary) -> bool:
    """Return whether this is the result of a suite that walks as commanded, without a push."""
    return any(_levels(entry, UNPUSHED) for entry in summary["controllers"].values())


def walking_leaderboard(
    summaries: Mapping[str, Summary], sources: Sequence[str] | None = None
) -> str:
    """Return the page as Markdown; `summaries` by where they come from, of one suite, seed and
    robot. `sources` are what the page names as its own: files, or folders of them.

    Each realism level has tables of its own. A controller of a later result takes the place of an
    earlier one of its name and level. The order is that of the mean J50 [N·s], those without one
    last. Raises ConfigError for results of another suite, seed, robot or engine than the first,
    and for a controller without walks of the first one's commands.
    """
    check_alike(summaries, lambda of: {
        "suite": of["suite"], "seed": of["seed"],
        "robot.name": of["robot"]["name"], "robot.mass": of["robot"]["mass"],
    })  # fmt: skip
    first, *_ = summaries.values()
    levels: dict[str, dict[str, Summary]] = {}
    for source, summary in summaries.items():
        levels.setdefault(summary.get("realism", IDEAL), {})[source] = summary
    return page_of(
        "walks.md.j2",
        sources=sources or list(summaries),
        first=first,
        levels={
            level: _of_level(levels[level])
            for level in sorted(levels, key=lambda level: level != IDEAL)
        },
    )


def _of_level(summaries: Mapping[str, Summary]) -> dict[str, Any]:
    """Return what the page says of the results of one realism level."""
    first, *_ = summaries
    entries: dict[str, Entry] = {}
    origin: dict[str, str] = {}
    for source, summary in summaries.items():
        entries |= summary["controllers"]
        origin |= dict.fromkeys(summary["controllers"], source)
    entries = _by_one_verdict(entries)
    commands = [level["level"] for level in _levels(next(iter(entries.values())), UNPUSHED)]
    for name, entry in entries.items():
        if not commands or [each["level"] for each in _levels(entry, UNPUSHED)] != commands:
            raise ConfigError(f"has no walks of the commands of {first}", source=origin[name],
                              field=f"controllers.{name}")  # fmt: skip
    names = sorted(entries, key=lambda name: _order(entries[name]))
    older = [name for name in names if entries[name].get("criterion") != NOT_FALLEN]
    return {
        "j50": _pushed(entries),
        "older": older if len(older) < len(names) else [],
        "by_falls": len(older) < len(names),
        "ranking": _ranking(entries, names),
        "commands": {command: _walks(entries, names, command) for command in commands},
        "results": _by_machine(summaries, origin),
    }  # fmt: skip


def _by_machine(
    summaries: Mapping[str, Summary], origin: Mapping[str, str]
) -> list[tuple[Summary, list[str]]]:
    """Return a result of each commit and machine, and the controllers that were evaluated there."""
    found: dict[tuple[object, ...], tuple[Summary, list[str]]] = {}
    for source, summary in summaries.items():
        key = summary["commit"], summary["machine"]["processor"], summary["machine"]["cores"]
        names = found.setdefault(key, (summary, []))[1]
        names += [name for name in summary["controllers"] if origin[name] == source]
    return list(found.values())


def _pushed(entries: Mapping[str, Entry]) -> str:
    """Return a sentence on the pushes of J50: the command of the walks and the duration of a push,
    as far as the results have them."""
    commands = {level["level"] for entry in entries.values() for level in _levels(entry, PUSHED)}
    known = {name: each["push_duration"] for name, each in entries.items()
             if "push_duration" in each}  # fmt: skip
    text = "J50 is of pushes while it walks" + (
        f" ({plain(', '.join(sorted(commands)))})" if commands else ""
    )
    for duration in sorted(set(known.values())):
        names = [code(name) for name, its in known.items() if its == duration]
        whose = "" if len(names) == sum("j50_mean" in each for each in entries.values()) else (
            f" for {', '.join(names)}")  # fmt: skip
        text += f", of {duration:g} s{whose}"
    return text + "."


def _levels(entry: Entry, part: str) -> list[WalkLevel]:
    return [level for level in entry.get("walks", ()) if level["part"] == part]


def _stands(entry: Entry) -> bool:
    """Whether it takes no stride where it is commanded to walk: its J50 is that of standing."""
    return all(level["step_length"] is None and not level["fallen"]
               for level in _levels(entry, UNPUSHED))  # fmt: skip


def _order(entry: Entry) -> tuple[bool, bool, float]:
    j50 = entry.get("j50_mean")
    return assisted(entry) or _stands(entry), j50 is None, -(j50 or 0.0)


def _by_one_verdict(entries: Mapping[str, Entry]) -> dict[str, Entry]:
    """Return the entries without the J50 of older results that count walks off their command as
    lost, where others count falls: the two do not compare."""
    older = {name for name, entry in entries.items() if entry.get("criterion") != NOT_FALLEN}
    if len(older) == len(entries):
        return dict(entries)
    kept: dict[str, Entry] = {}
    for name, entry in entries.items():
        keys = [key for key in entry if name not in older or not key.startswith(OF_J50)]
        kept[name] = {key: entry[key] for key in keys}  # type: ignore[assignment,literal-required]
    return kept


def _ranking(entries: Mapping[str, Entry], names: Sequence[str]) -> Table:
    kicks = list(dict.fromkeys(
        level["level"] for name in names for level in _levels(entries[name], KICKED)))  # fmt: skip
    head = ["", "controller", J50_MEAN.heading, "worst direction",
            "not fallen, pushed", "as commanded again", *(f"kicked {kick}" for kick in kicks),
            "fell unpushed", "as commanded, unpushed"]  # fmt: skip
    walking = {name: entry for name, entry in entries.items() if not _stands(entry)}
    rank, rows = shared_ranks(walking, ("j50_mean", ".1f")), []
    for name in names:
        entry, walks = entries[name], _levels(entries[name], UNPUSHED)
        fallen, trials = sum(w["fallen"] for w in walks), sum(w["trials"] for w in walks)
        followed = sum(w["recovered"] for w in walks)
        kicked = {level["level"]: level for level in _levels(entry, KICKED)}
        rows.append([str(rank.get(name) or NONE), code(name), *_j50(entry), *_pushes(entry),
                     *(_upright(kicked.get(kick)) for kick in kicks),
                     f"{fallen}/{trials}", f"{followed}/{trials}"])  # fmt: skip
    return head, rows


def _j50(entry: Entry) -> tuple[str, str]:
    if "j50_mean" not in entry:
        return NONE, NONE
    worst = min(entry["directions"], key=lambda each: each["j50"])
    return (
        j50_mean_text(entry),
        f"{worst['j50']:.1f} ({worst['direction']:g}°)",
    )


def _pushes(entry: Entry) -> tuple[str, str]:
    """How many pushed walks stayed upright, and how many went on as commanded."""
    levels = _levels(entry, PUSHED)
    if not levels:
        return NONE, NONE
    trials = sum(w["trials"] for w in levels)
    upright = trials - sum(w["fallen"] for w in levels)
    return f"{upright}/{trials}", f"{sum(w['recovered'] for w in levels)}/{trials}"


def _upright(level: WalkLevel | None) -> str:
    return f"{level['trials'] - level['fallen']}/{level['trials']}" if level else NONE


#: of a command; a page has room for two digits of steps
WALKS = (FALLS[1], FOLLOWED[0], FOLLOWED[3], replace(STEPS[2], form=".2f"),
         replace(STEPS[4], form=".2f"), *COSTS[:3])  # fmt: skip


def _walks(entries: Mapping[str, Entry], names: Sequence[str], command: str) -> Table:
    rows = []
    for name in names:
        (level,) = (w for w in _levels(entries[name], UNPUSHED) if w["level"] == command)
        rows.append([code(name), *(each.text(level) for each in WALKS)])
    return ["controller", *(each.heading for each in WALKS)], rows
