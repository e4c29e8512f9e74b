"""Suites that perform motions: their stage, falls and errors by motion and share, J50 in motion."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from poise.baselines.extras import load_extra
from poise.envs.robots.robot import Robot
from poise.training.benchmarking.statistics.bootstrap import EnvelopeFit, mean_over_directions
from poise.training.benchmarking.statistics.differences import ratio
from poise.training.benchmarking.statistics.rates import mean_or_none, wilson_interval
from poise.training.benchmarking.suites.motions import PART, STANDING
from poise.training.benchmarking.suites.suite import Suite
from poise.training.benchmarking.trials.jobs import LONGEST, TrialStage
from poise.training.benchmarking.trials.repertoire import Repertoire, kept
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.running.trial_figures import InMotion, MotionLevel, MotionMeans

from .evaluated import Evaluated, cells, fitted, pushes, trials_of_parts, won

PERFORMS = "a suite that performs motions"
MEANS = tuple(MotionMeans.__annotations__)  # figures of a trial that a level has the mean of


def suite_repertoire(suite: Suite, robot: Robot, folder: Path, overwrite: bool) -> Repertoire:
    """Return the motions of a suite, empty where it has none.

    Raises:
        MissingExtra: poise[motion] is not installed.
        ConfigError: as `load_repertoire` of `training/motion/following/repertoire.py`.
    """
    if suite.motions is None:
        return Repertoire({}, {}, {})
    names, labels = suite.motions.names, suite.motions.labels
    load = load_extra("motions", "repertoire", PERFORMS)
    repertoire: Repertoire = load(names, labels, robot, folder, overwrite)
    return repertoire


def suite_stage(suite: Suite, robot: str | Path, folder: Path) -> TrialStage:
    """What all trials of a suite share, whose results are in `folder`."""
    chosen = suite.motions
    if chosen is None:
        again = suite.get_up_time or (None if suite.get_up is None else 0.0)
        return TrialStage(robot, suite.duration, suite.noise, get_up=again, physics=suite.physics)
    is_clip = load_extra("motions", "is_clip", PERFORMS)
    files = [(label, str(kept(folder.resolve(), label)) if is_clip(name) else name)
             for name, label in zip(chosen.names, chosen.labels, strict=True)]  # fmt: skip
    motions = ((STANDING, STANDING), *files)
    return TrialStage(robot, LONGEST, suite.noise, motions, chosen.tempo, physics=suite.physics)


def motion_levels(evaluated: Evaluated) -> list[MotionLevel]:
    """Every share of J50: each motion, and all of several; [] where nothing is performed."""
    moving = trials_of_parts(evaluated, PART)
    found: dict[tuple[float, str | None], list[tuple[Trial, Outcome]]] = {}
    found |= cells(moving, lambda trial: (trial.share or 0.0, trial.motion))
    if len({trial.motion for trial, _ in moving}) > 1:
        found |= cells(moving, lambda trial: (trial.share or 0.0, None))
    ordered = sorted(found, key=lambda key: (key[0], key[1] is None))
    return [_level(*key, [outcome for _, outcome in found[key]]) for key in ordered]


def _level(share: float, name: str | None, outcomes: Sequence[Outcome]) -> MotionLevel:
    trials, fallen = len(outcomes), sum(outcome.fallen for outcome in outcomes)
    stood = [each for each in outcomes if not each.fallen and each.error is None]
    means = {key: mean_or_none([getattr(each, key) for each in stood]) for key in MEANS}
    return {
        "motion": name,
        "share": share,
        "trials": trials,
        "fallen": fallen,
        "fallen_rate": fallen / trials,
        "fallen_ci95": wilson_interval(fallen, trials),
        "solver_failures": sum(outcome.solver_failures for outcome in outcomes),
        "steps_mean": mean_or_none([each.steps for each in stood]),
        **cast(MotionMeans, means),
    }


def in_motion(evaluated: Evaluated) -> list[InMotion]:
    """J50 in each motion, their mean, and that of standing, as shares of the controller's J50.

    Shares of all directions are fitted together. The ratio of two such shares is that of the J50s,
    since both are of the same one. Its interval comes of those of the two [Zou08].
    """
    moving = trials_of_parts([(t, o) for t, o in evaluated if t.push is not None], PART)
    if not moving:
        return []
    shares = np.array([trial.share for trial, _ in moving], dtype=float)
    names = list(dict.fromkeys(trial.motion for trial, _ in moving))
    fit = mean_over_directions([names.index(t.motion) for t, _ in moving], shares, won(moving))
    standing = _standing(evaluated, moving)
    found: list[InMotion] = []
    if standing is not None:
        found.append(_row(STANDING, fitted(standing.fits[0], "share50"), None))
    found += [
        _row(name, fitted(one, "share50"), standing)
        for name, one in zip(names, fit.fits, strict=True)
    ]
    if len(names) > 1:
        mean = {
            "trials": len(moving),
            "recovered": int(won(moving).sum()),
            "share50": fit.j50_mean,
            "share50_ci95": fit.j50_mean_ci,
            "share50_bound": next((f.fit.bound for f in fit.fits if f.fit.bound), None),
        }
        found.append(_row(None, mean, standing))
    return found


def _standing(evaluated: Evaluated, moving: Evaluated) -> EnvelopeFit | None:
    """Return the fit of the pushes while standing; None without any."""
    stood = trials_of_parts(evaluated, STANDING)
    if not stood:
        return None
    j50 = {t.push.direction: t.push.impulse / t.share for t, _ in moving if t.push and t.share}
    direction, impulse, _ = pushes(stood)
    over = [j / j50[angle] for angle, j in zip(direction, impulse, strict=True)]
    return mean_over_directions(np.zeros(len(over)), over, won(stood))


def _row(name: str | None, figures: dict[str, Any], standing: EnvelopeFit | None) -> InMotion:
    """Return the figures of a motion, and its share over that of standing, if there is one."""
    over, ends = None, None
    if standing is not None:
        here = figures["share50"], figures["share50_ci95"]
        over, ends = ratio(standing.j50_mean, standing.j50_mean_ci, *here)
    row = {"motion": name, **figures, "over_standing": over, "over_standing_ci95": ends}
    return cast(InMotion, row)
