"""Judge walks of older results again, by falls."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

from poise.configs.errors import ConfigError, PoiseError, PoiseWarning
from poise.configs.schema import build
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.evaluation.folder import Settings
from poise.training.benchmarking.evaluation.tables import ranked
from poise.training.benchmarking.metrics.entry import controller_entry
from poise.training.benchmarking.metrics.evaluated import Evaluated
from poise.training.benchmarking.metrics.pairs import pair_figures
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.table import read_outcome, read_trial
from poise.training.running.files import SETTINGS, TRIALS, plain
from poise.training.running.summary import Entry, Summary

#: figures of an entry that do not come from its trials
KEPT = ("tick_us", "fingerprint", "timesteps")


def judged_again(
    folder: Path, settings: Settings, summary: Summary, lines: Sequence[Mapping[str, str]]
) -> Summary:
    """Return the summary, in which the walks of an older result are judged by falls.

    Such a result counted walks as lost that stayed upright, but differed from their command by more
    than 0.05 m/s or 5°. Its columns contain the falls: J50, ranking and pairs are computed again
    from `lines` of trials.csv. The rate of `recovered` stays as it was judged, since older columns
    have no error of the last strides. Figures over training seeds and over the limits of steps are
    left out. A `PoiseWarning` reports this, or why it failed.
    """
    known = summary["controllers"].values()
    if not any("walks" in entry and "criterion" not in entry for entry in known):
        return summary
    suite = build(Suite, settings.suite, str(folder / SETTINGS))
    try:
        robot = load_robot(settings.robot)
        if robot.fingerprint != settings.robot_fingerprint:
            raise ConfigError("the robot has changed since")
        plan = TrialPlan(suite, PushLimits(robot, settings.limits), settings.seed,
                    tuple(summary["controllers"]))  # fmt: skip
    except PoiseError as error:
        warnings.warn(f"{folder}: walks of an older result count as lost where they differ from "
                      f"their command; not judged again: {error}",
                      PoiseWarning, stacklevel=2)  # fmt: skip
        return summary
    path = folder / TRIALS
    evaluated: dict[str, Evaluated] = {
        name: [(read_trial(line, path), read_outcome(line, path)) for line in lines
               if line["controller"] == name]
        for name in summary["controllers"]
    }  # fmt: skip
    entries: dict[str, Entry] = {name: _entry(entry, evaluated[name], plan)
                                 for name, entry in summary["controllers"].items()}  # fmt: skip
    whole: Summary = {
        **summary,
        "controllers": entries,
        "ranking": ranked(entries),
        "pairs": [pair_figures(p["a"], p["b"], evaluated, entries) for p in summary["pairs"]],
        "seeds": [],
    }
    warnings.warn(f"{folder}: walks of an older result are judged again, J50 and the order by "
                  "falls; as commanded is still within 0.05 m/s and 5° of the command",
                  PoiseWarning, stacklevel=2)  # fmt: skip
    return plain(whole)


def _entry(before: Entry, evaluated: Evaluated, plan: TrialPlan) -> Entry:
    entry = controller_entry(evaluated, plan)
    kept = {key: before[key] for key in KEPT if key in before}  # type: ignore[literal-required]
    return {**entry, **kept}  # type: ignore[typeddict-item]
