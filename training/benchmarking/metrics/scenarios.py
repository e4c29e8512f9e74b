"""Figures of scenarios: how many trials each ends on its feet, and how."""

from collections.abc import Callable, Sequence

from poise.training.benchmarking.suites.scenarios import PART
from poise.training.benchmarking.trials.trial import Outcome
from poise.training.running.summary import Counts, ScenarioFigures

from .played import Played, part


def scenario_figures(
    played: Played, counts: Callable[[Sequence[Outcome]], Counts]
) -> list[ScenarioFigures]:
    """Of each scenario that a controller has played, in the order of the suite."""
    cells: dict[str, list[Outcome]] = {}
    for trial, outcome in part(played, PART):
        cells.setdefault(str(trial.level), []).append(outcome)
    found: list[ScenarioFigures] = []
    for name, outcomes in cells.items():
        figures: ScenarioFigures = {"scenario": name, **counts(outcomes)}
        if speeds := [o.speed_ahead for o in outcomes if o.speed_ahead is not None]:
            figures["speed_ahead"] = sum(speeds) / len(speeds)
        found.append(figures)
    return found
