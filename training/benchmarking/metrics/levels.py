"""Figures of a suite's parts at each level of realism."""

from collections.abc import Sequence
from pathlib import Path

from poise.training.benchmarking.statistics.bootstrap import mean_over_directions
from poise.training.benchmarking.statistics.differences import ratio
from poise.training.benchmarking.suites.plan import at_level
from poise.training.benchmarking.suites.suite import Suite
from poise.training.running.summary import RealismLevel

from .played import DIRECTIONAL, Played, counts, part, pushes, won

RATED = ("random", "mix")  # parts that rates are of, where a suite has one


def level_figures(played: Played, suite: Suite) -> list[RealismLevel]:
    """Of the suite's own level, then of each of its `levels`; J50 also over that of the first."""

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
                first = found[0]["j50_mean"], found[0]["j50_mean_ci95"]
                kept = ratio(*first, fit.j50_mean, fit.j50_mean_ci)
                here["j50_kept"], here["j50_kept_ci95"] = kept
        found.append(here)
    return found
