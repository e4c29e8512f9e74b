"""Figures of a suite's parts at each level of realism."""

from collections.abc import Callable, Sequence
from pathlib import Path

from poise.training.benchmarking.statistics.bootstrap import mean_over_directions
from poise.training.benchmarking.statistics.differences import relative_gain
from poise.training.benchmarking.suites.plan import at_level
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.trial import Outcome
from poise.training.running.summary import Counts, Interval, RealismLevel, both_ends

from .played import DIRECTIONAL, Played, part, pushes, won

RATED = ("random", "mix")  # parts that rates are of, where a suite has one


def level_figures(
    played: Played, suite: Suite, counts: Callable[[Sequence[Outcome]], Counts]
) -> list[RealismLevel]:
    """Of the suite's own level, then of each of its `levels`; `counts` of outcomes."""

    def named(names: Sequence[str], level: str | None) -> Played:
        return part(played, *(n if level is None else at_level(n, level) for n in names))

    found: list[RealismLevel] = []
    for level in (None, *suite.levels):
        every = named([name for name in suite.parts if name != "factors"], level)
        counted = counts([outcome for _, outcome in named(RATED, level) or every])
        here: RealismLevel = {
            "level": Path(level or suite.realism).stem,
            "trials": counted["trials"],
            "recovered": counted["recovered"],
            "recovered_rate": counted["recovered_rate"],
            "recovered_ci95": counted["recovered_ci95"],
            "torque_variation_median": counted["torque_variation_median"],
            "energy_median": counted["energy_median"],
        }
        if quiet := named(["quiet"], level):
            stood = [not outcome.fallen and outcome.error is None for _, outcome in quiet]
            here["stood"], here["unpushed"] = sum(stood), len(stood)
        if aimed := named(DIRECTIONAL, level):
            direction, impulse, _ = pushes(aimed)
            fit = mean_over_directions(direction, impulse, won(aimed))
            here["j50_mean"], here["j50_mean_ci95"] = fit.j50_mean, fit.j50_mean_ci
            if found:
                here["j50_kept"], here["j50_kept_ci95"] = _kept(found[0], here)
        found.append(here)
    return found


def _kept(first: RealismLevel, here: RealismLevel) -> tuple[float | None, Interval | None]:
    """J50 over that of the first level; None where an end of an interval is open or not > 0."""
    one, two = both_ends(first["j50_mean_ci95"]), both_ends(here["j50_mean_ci95"])
    if one is None or two is None:
        return None, None
    gain, around = relative_gain(first["j50_mean"], one, here["j50_mean"], two)
    if gain is None or around is None:
        return None, None
    return 1.0 + gain, (1.0 + around[0], 1.0 + around[1])
