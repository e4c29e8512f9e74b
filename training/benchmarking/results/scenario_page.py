"""The page of scenarios, a table for each robot and level, from committed files summary.json."""

from collections.abc import Mapping

from poise.configs.errors import ConfigError
from poise.configs.texts import code, markdown_table, plain
from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.evaluation.tables import assisted
from poise.training.benchmarking.evaluation.walk_tables import scenario_cell, scenario_names
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.running.columns import CHATTER, ENERGY, NONE, SPEED, STEPS_TAKEN
from poise.training.running.summary import Entry, Summary
from poise.training.running.trial_figures import ScenarioFigures

HEAD = """# Scenarios

<!-- Written by `poise leaderboard {source} --page {page}`: change the results, not this page. -->

What else happens to a robot that stands. Cells are the share of trials without a fall, with 95 %
intervals. A controller that takes no command has no `walk`. The state is known exactly and at once
where no [level](realism.md#levels) is named.

- `quiet`: 12 s without a push.
- `repeated`: 24 s with a push of 0.3 to 0.8 N·s/kg every 2 to 4 s.
- `in-step`: a push of 1.2 to 2 times what ankles hold. 0.15 to 0.4 s after it comes a second one of
  0.2 to 0.6 times such a push.
- `push`: one of 0.3 to 1.5 N·s/kg.
- `arms`: the same pushes. [Somebody else](realism.md#arms-and-hands) moves the arms at random.
- `payload`: the same pushes with 3 to 9 % of the mass in one hand, of which nobody is told.
- `walk`: a push of 0.3 to 1.2 N·s/kg while it is told to walk at 0.5 m/s. Its speed, push included,
  is in a column of its own: who stays far below does not walk.

`together` has all but `walk`; it is the order. Energy (median) and steps (mean) are those of
`push`, chatter (median) is that of `repeated`. Energy and chatter are of recovered trials.
[How it is played](benchmark.md#scenarios).
"""
WALK = "walk"  # the scenario that only some play
Figures = Mapping[str, object]


def is_of_scenarios(summary: Summary) -> bool:
    """Return whether this is the result of a suite of scenarios."""
    return any(entry.get("scenarios") for entry in summary["controllers"].values())


def scenario_page(summaries: Mapping[str, Summary], page: str) -> str:
    """The page as Markdown; `summaries` by where they come from, `page` where it is written.

    A controller of a later result of a robot and a level takes the place of an earlier one of its
    name. Raises ConfigError for results of another suite or seed, and for controllers of other
    scenarios.
    """
    (first, summary), *_ = summaries.items()
    names = scenario_names(summary)
    tables: dict[tuple[str, str], dict[str, Entry]] = {}
    for source, other in summaries.items():
        for key, own, theirs in (("suite", summary["suite"], other["suite"]),
                                 ("seed", summary["seed"], other["seed"])):  # fmt: skip
            if own != theirs:
                raise ConfigError(f"is not that of {first}", source=source, field=key)
        for name, entry in other["controllers"].items():
            if not {each["scenario"] for each in entry.get("scenarios", ())} <= set(names):
                raise ConfigError(f"has other scenarios than {first}", source=source,
                                  field=f"controllers.{name}")  # fmt: skip
        of = other["robot"]["name"], other.get("realism", IDEAL)
        tables.setdefault(of, {}).update(other["controllers"])
    text = HEAD.format(source=plain(" ".join(summaries)), page=plain(page))
    for (robot, level), entries in tables.items():
        at = "" if level == IDEAL else f", {code(level)}"
        text += f"\n## {code(robot)}{at}\n\n" + _table(entries, names)
    return text + "\n" + "".join(_played(*each) for each in summaries.items())


def _table(entries: Mapping[str, Entry], names: list[str]) -> str:
    head = ["controller", *(code(name) for name in names), "together",
            SPEED.heading, ENERGY.heading, CHATTER.heading, "steps"]  # fmt: skip
    rows = []
    for name in sorted(entries, key=lambda name: _order(entries[name])):
        own = {each["scenario"]: each for each in entries[name].get("scenarios", ())}
        pushed: Figures = own.get("push", {})
        repeated: Figures = own.get("repeated", {})
        walked: Figures = own.get(WALK, {})
        mark = " (took a force from nowhere)" if assisted(entries[name]) else ""
        rows.append([code(name) + mark, *(scenario_cell(own.get(each)) for each in names),
                     _together(entries[name]), SPEED.text(walked), ENERGY.text(pushed),
                     CHATTER.text(repeated), STEPS_TAKEN.text(pushed)])  # fmt: skip
    return markdown_table(head, rows)


def _stood(entry: Entry) -> tuple[int, int]:
    """Trials without a fall, and all, of those that all controllers play."""
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


def _played(source: str, summary: Summary) -> str:
    machine, mujoco = summary["machine"], plain(summary["versions"].get("mujoco"))
    return (f"- {plain(source)}: suite {code(summary['suite'])}, seed {summary['seed']}, commit "
            f"{code((summary['commit'] or 'unknown')[:10])}, MuJoCo {mujoco}, "
            f"{plain(machine['processor'])}.\n")  # fmt: skip
