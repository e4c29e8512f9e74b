"""The plots of an evaluation."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from poise.training.benchmarking.metrics.evaluated import (
    DIRECTIONAL,
    Evaluated,
    by_falls,
    fractions,
    limits_of_pushes,
    pushes,
    sectors,
    trials_of_parts,
    won,
)
from poise.training.benchmarking.statistics.bootstrap import (
    DirectionFit,
    EnvelopeFit,
    mean_over_directions,
)
from poise.training.benchmarking.statistics.fits import fit_logistic
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.trials.step_limits import (
    COUNTS,
    DRAWN,
    NStepLimit,
    groups,
    line_name,
)
from poise.training.learning.policy_files import KEPT
from poise.training.pictures.figures.envelope import Curve, polar_envelope
from poise.training.pictures.figures.learning_curve import Point, learning_curve
from poise.training.pictures.figures.rates import fall_probability
from poise.training.pictures.figures.series import SIDES, Series, series
from poise.training.running.files import CURVE, PLOTS

FEWEST = 5  # trials of a direction whose J50 is plotted


def draw_plots(
    folder: Path,
    plan: TrialPlan,
    evaluated: Mapping[str, Evaluated],
    steps: Mapping[str, NStepLimit] | None = None,
    timesteps: Mapping[str, int | None] | None = None,
) -> list[Path]:
    """Write the plots of a result; return their paths, none without pushes that have a limit.

    Plots of J50 by direction include the N-step limits of the first stepping controller; otherwise
    the random pushes are shown. For several checkpoints of a training run, J50 is also plotted
    over `timesteps`.
    """
    polar, fall = (folder / name for name in PLOTS)
    limits = plan.limits
    shown = {name: trials_of_parts(own, *DIRECTIONAL) for name, own in evaluated.items()}
    directional = all(shown.values())
    if not directional:
        shown = {name: trials_of_parts(own, "random") for name, own in evaluated.items()}
        if not all(shown.values()):
            return []
    label = "push impulse, as a fraction of the ankle limit"
    if directional:
        fits = {name: mean_over_directions(*pushes(own)[:2], won(own))
                for name, own in shown.items()}  # fmt: skip
        fraction = {
            name: pushes(own)[1] / limits_of_pushes(own, limits) for name, own in shown.items()
        }
        fine, duration = np.arange(0.0, 360.0, 2.0), plan.suite.push_duration
        around = limits.around(2.0)
        limit = [limits.ankle(d, duration) for d in around]
        lines = _step_lines(steps or {}, fine, duration)
        polar_envelope(polar, _series(fits), ankle_limit=(around, limit), step_limits=lines,
                       note=_left_out(fits))  # fmt: skip
    else:
        fits = {name: sectors(own) for name, own in shown.items()}
        fraction = {name: fractions(own) for name, own in shown.items()}
        unit = f"× {limits.scale}"
        title = f"Recovered fraction of the {limits.scale} by push direction"
        polar_envelope(polar, _series(fits), title=title, unit=unit, note=_left_out(fits))
        label = f"push impulse, as a fraction of the {limits.scale}"
    fall_probability(
        fall,
        {name: (fraction[name], won(own)) for name, own in shown.items()},
        {name: fit_logistic(fraction[name], won(own)) for name, own in shown.items()},
        xlabel=label,
        lost="fallen" if all(map(by_falls, shown.values())) else "not recovered",
    )
    curve = _draw_curve(folder / CURVE, fits, timesteps or {}) if directional else []
    return [polar, fall, *curve]


def _draw_curve(
    path: Path, fits: Mapping[str, EnvelopeFit], timesteps: Mapping[str, int | None]
) -> list[Path]:
    """Draw mean J50 over environment steps, if a run has kept more policies than one."""
    runs: dict[str, list[Point]] = {}
    kept = []
    for name, fit in fits.items():
        parent, learned_from = Path(name).parent, timesteps.get(name)
        if parent.name == KEPT and learned_from is not None:
            kept.append(name)
            point = (learned_from, fit.j50_mean, *fit.j50_mean_ci)
            runs.setdefault(str(parent.parent), []).append(point)
    if not any(len(points) > 1 for points in runs.values()):
        return []
    bounded = any(fits[name].bounded for name in kept)
    note = "In some directions J50 is only a bound." if bounded else ""
    others = {name: fit.j50_mean for name, fit in fits.items() if name not in kept}
    learning_curve(path, runs, others, note=note)
    return [path]


def _step_lines(
    steps: Mapping[str, NStepLimit], fine: np.ndarray, duration: float
) -> dict[str, Curve]:
    """Limits of one and two steps, as `polar_envelope` takes them."""
    whose = list(groups(steps).values())
    return {
        line_name(name, whose): (
            fine,
            [steps[whose[0][0]](angle, duration, COUNTS[name]) for angle in fine],
        )
        for name in (DRAWN if steps else ())
    }


def _series(fits: Mapping[str, EnvelopeFit]) -> list[Series]:
    """Direction, J50 and its interval, and whether it is a bound; NaN of too few trials."""
    nothing = (np.nan,) * 3
    return [
        series(name, index, [
            (direction, *((f.fit.j50, *f.j50_ci) if _enough(f) else nothing), SIDES[f.fit.bound])
            for direction, f in zip(fit.directions, fit.fits, strict=True)
        ])
        for index, (name, fit) in enumerate(fits.items())
    ]  # fmt: skip


def _left_out(fits: Mapping[str, EnvelopeFit]) -> str:
    """Return a note on missing directions; empty where all are plotted."""
    enough = [_enough(f) for fit in fits.values() for f in fit.fits]
    if not any(enough):
        return f"Nothing is drawn: no direction has {FEWEST} trials."
    return "" if all(enough) else f"Not drawn: directions with fewer than {FEWEST} trials."


def _enough(direction: DirectionFit) -> bool:
    return direction.fit.trials >= FEWEST
