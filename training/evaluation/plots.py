"""The plots of an evaluation."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from poise.training.figures.envelope import fall_probability, polar_envelope
from poise.training.running.files import PLOTS
from poise.training.statistics.bootstrap import EnvelopeFit, mean_over_directions
from poise.training.statistics.fits import fit_logistic
from poise.training.suites.base import Suite
from poise.training.trials.push_limits import PushLimits
from poise.training.trials.step_limits import COUNTS, DRAWN, NStepLimit, groups, line_name
from poise.training.trials.trial import Trial

from .summary import Outcomes, fractions, pushes, sectors, won


def draw_plots(
    folder: Path,
    suite: Suite,
    trials: Sequence[Trial],
    outcomes: Outcomes,
    limits: PushLimits,
    steps: Mapping[str, NStepLimit] | None = None,
) -> list[Path]:
    """Write the plots of an evaluation; returns their paths, none without pushes.

    Suites by direction show what `steps` of the first controller that steps could stop.
    """
    if trials[0].push is None or trials[0].later:
        return []
    polar, fall = (folder / name for name in PLOTS)
    direction, impulse, duration = pushes(trials)
    ankle = np.array([limits.ankle(d, t) for d, t in zip(direction, duration, strict=True)])
    if suite.by_direction:
        fits = {
            name: mean_over_directions(direction, impulse, won(results))
            for name, results in outcomes.items()
        }
        fine = np.arange(0.0, 360.0, 2.0)
        limit = [limits.ankle(d, float(duration[0])) for d in fine]
        lines = _step_lines(steps or {}, fine, float(duration[0]))
        polar_envelope(polar, _bands(fits), ankle_limit=(fine, limit), step_limits=lines)
        share, label = impulse / ankle, None
    else:
        fits = {name: sectors(trials, results) for name, results in outcomes.items()}
        unit = f"of the {limits.scale}"
        title = f"Recovered share of the {limits.scale} by push direction"
        polar_envelope(polar, _bands(fits), title=title, unit=unit)
        share, label = fractions(trials), f"push impulse, as a fraction of the {limits.scale}"
    fall_probability(
        fall,
        {name: (share, won(results)) for name, results in outcomes.items()},
        {name: fit_logistic(share, won(results)) for name, results in outcomes.items()},
        unit="fraction",
        xlabel=label,
    )
    return [polar, fall]


def _step_lines(
    steps: Mapping[str, NStepLimit], fine: np.ndarray, duration: float
) -> dict[str, Any]:
    """Limits of one and two steps, as `polar_envelope` takes them."""
    whose = list(groups(steps).values())
    return {
        line_name(name, whose): (
            fine,
            [steps[whose[0][0]](angle, duration, COUNTS[name]) for angle in fine],
        )
        for name in (DRAWN if steps else ())
    }


def _bands(fits: Mapping[str, EnvelopeFit]) -> dict[str, Any]:
    """Direction, J50 and its interval, as `polar_envelope` takes them."""
    return {
        name: (
            list(fit.directions),
            [f.fit.j50 for f in fit.fits],
            [f.j50_ci.low for f in fit.fits],
            [f.j50_ci.high for f in fit.fits],
        )
        for name, fit in fits.items()
    }
