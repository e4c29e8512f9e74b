"""The page of scenarios, a table for each robot and level, from committed files summary.json."""

from collections.abc import Mapping

from poise.configs.errors import ConfigError
from poise.configs.texts import code
from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.evaluation.tables import assisted
from poise.training.benchmarking.evaluation.walk_tables import scenario_cell, scenario_names
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.running.columns import CHATTER, ENERGY, NONE, SPEED, STEPS_TAKEN
from poise.training.running.summary import Entry, Summary
from poise.training.running.trial_figures import ScenarioFigures

from .pages import Table, check_alike, page_of

WALK = "walk"  # the scenario with a command
Figures = Mapping[str, object]


def is_of_scenarios(summary: Summary) -> bool:
    """Return whether this is the result of a suite of scenarios."""
    return any(entry.get("scenarios") for entry in summary["controllers"].values())


def scenario_page(summaries: Mapping[str, Summary], page: str) -> str:
    """Return the page as Markdown; `summaries` by where they come from, `page` where it is written.

    A controller of a later result of a robot and a level takes the place of an earlier one of its
    name. Raises ConfigError for results of another suite or seed, and for controllers of other
    scenarios.
    """
    check_alike(summaries, lambda of: {"suite": of["suite"], "seed": of["seed"]})
    first, *_ = summaries
    names = scenario_names(summaries[first])
    tables: dict[tuple[str, str], dict[str, Entry]] = {}
    for source, summary in summaries.items():
        for name, entry in summary["controllers"].items():
            if not {each["scenario"] for each in entry.get("scenarios", ())} <= set(names):
                raise ConfigError(f"has other scenarios than {first}", source=source,
                                  field=f"controllers.{name}")  # fmt: skip
        of = summary["robot"]["name"], summary.get("realism", IDEAL)
        tables.setdefault(of, {}).update(summary["controllers"])
    return page_of(
        "scenarios.md.j2",
        source=" ".join(summaries),
        page=page,
        tables={of: _table(entries, names) for of, entries in tables.items()},
        summaries=summaries,
    )


def _table(entries: Mapping[str, Entry], names: list[str]) -> Table:
    head = ["controller", *(code(name) for name in names), "together",
            SPEED.heading, ENERGY.heading, CHATTER.heading, "steps"]  # fmt: skip
    rows = []
    for name in sorted(entries, key=lambda name: _order(entries[name])):
        own = {each["scenario"]: each for each in entries[name].get("scenarios", ())}
        pushed: Figures = own.get("push", {})
        repeated: Figures = own.get("repeated", {})
        walked: Figures = own.get(WALK, {})
        mark = " (external force at a soft root)" if assisted(entries[name]) else ""
        rows.append([code(name) + mark, *(scenario_cell(own.get(each)) for each in names),
                     _together(entries[name]), SPEED.text(walked), ENERGY.text(pushed),
                     CHATTER.text(repeated), STEPS_TAKEN.text(pushed)])  # fmt: skip
    return head, rows


def _stood(entry: Entry) -> tuple[int, int]:
    """Return the trials without a fall, and all trials, of the scenarios common to all."""
    found: list[ScenarioFigures] = [each for each in entry.get("scenarios", ())
                                    if each["scenario"] != WALK]  # fmt: skip
    kept = (round((each.get("never_fell_rate") or 0.0) * each["trials"]) for each in found)
    return sum(kept), sum(each["trials"] for each in found)


def _order(entry: Entry) -> tuple[bool, float]:
    stood, trials = _stood(entry)
    return assisted(entry), -stood / max(trials, 1)


def _together(entry: Entry) -> str:
    stood, trials = _stood(entry)
    if not 0 <= stood <= trials or trials == 0:
        return NONE
    low, high = wilson_interval(stood, trials)
    return f"{stood} of {trials} [{low:.0%}, {high:.0%}]"
