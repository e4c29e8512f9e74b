"""A trial of a result, simulated again as `poise replay` does, as frames to scrub through."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from poise.baselines.allowance import listed
from poise.configs.errors import ConfigError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.termination import has_diverged
from poise.envs.physics.collapse import DURATION as FALLING
from poise.envs.physics.collapse import Collapse
from poise.training.benchmarking.diagnosis.words import why
from poise.training.benchmarking.results.read import load_results
from poise.training.benchmarking.results.replay import replay
from poise.training.benchmarking.trials.trial import Outcome

from .frames import Frame, FrameMaker
from .live import Frames, Recorded
from .spec import MOST, TrialSpec


class Recorder:
    """Keeps the frames of a trial; hand it to `replay`."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.env: BalanceEnv | None = None
        self._observer: FrameMaker | None = None

    def __call__(self, env: BalanceEnv) -> None:
        if self._observer is None:
            self.env, self._observer = env, FrameMaker(env)
        self.frames.append(self._observer(env.simulation.time if env.fallen else None))

    def fall(self) -> None:
        """Add the way of a robot that fell to the ground, when its trial is over."""
        if self.env is None or self._observer is None or not self.env.fallen:
            return
        if has_diverged(self.env.simulation.views):
            return
        end, collapse = self.env.simulation.time, Collapse(self.env.simulation)
        while self.env.simulation.time < end + FALLING:
            collapse.step(self.env.substeps)
            self.frames.append(self._observer(end))


def recorded_trial(
    folder: Path, trial: int, controllers: Sequence[str] = (), allow: str | Iterable[str] = ()
) -> tuple[Recorded, list[str]]:
    """Return a trial by up to three of the controllers that took part, side by side.

    A trial that a robot fell in is over for it; it goes to the ground, and stays as it lies there.

    Args:
        folder: written by `evaluate` or `benchmark`.
        trial: its number in trials.csv.
        controllers: of those that took part; none: the last one, as `replay`.
        allow: external controllers that may run.

    Returns:
        the trial, and a line about each controller.

    Raises:
        ConfigError: as `replay`; more than three controllers.
    """
    if len(controllers) > MOST:
        raise ConfigError(f"at most {MOST} stand side by side", field="controllers")
    results = load_results(folder)
    names = list(controllers) or [results.controllers[-1]]
    for name in names:  # before the first is simulated
        results.record(name, trial)
    recorders, lines = [Recorder() for _ in names], []
    reasons: dict[str, str] = {}
    for name, recorder in zip(names, recorders, strict=True):
        done = replay(results, trial, name, watch=recorder, allow=allow)
        recorder.fall()
        differs = "differs from the record" if done.differences else "exactly as recorded"
        lines.append(f"trial {trial}, {name}: {_end(done.outcome)}, {differs}")
        if reason := why(done.outcome, done.outcome.fall_time):
            reasons[name] = reason
            lines.append(f"  {reason}")
    envs = [recorder.env for recorder in recorders if recorder.env is not None]
    period = min(env.config.policy_period for env in envs)

    def film(name: str, path: Path) -> None:
        replay(results, trial, name, video=path, allow=allow)

    history = _side_by_side([recorder.frames for recorder in recorders], period)
    spec = TrialSpec(str(folder), trial, tuple(names), tuple(listed(allow)))
    return Recorded(spec, envs[0].robot, history, period, film, reasons), lines


def _end(outcome: Outcome) -> str:
    if outcome.loss == "off command":
        return "upright, not as commanded"
    return "recovered" if outcome.recovered else "fell" if outcome.fallen else "not quiet"


def _side_by_side(films: Sequence[Sequence[Frame]], period: float) -> list[Frames]:
    """Frames every `period` [s], of each film the last one until then: their steps may differ."""
    count = round(max(film[-1].time for film in films) / period) + 1
    moments = period * np.arange(count) + 1e-9
    places = [np.searchsorted([f.time for f in film], moments, "right") - 1 for film in films]
    pairs = list(zip(films, places, strict=True))
    return [tuple(film[place[k]] for film, place in pairs) for k in range(count)]
