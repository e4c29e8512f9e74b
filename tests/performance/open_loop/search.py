"""Two searches for a motion's offsets: of the whole by CMA-ES, and window by window by SAMCON."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.extras import needing

from .plant import FALLEN, Plant

SPREAD = 0.06  # [rad] standard deviation of the first samples
SAVED = 0.2  # of SAMCON's samples, that go on
FULL = 200  # numbers up to which CMA-ES learns a whole covariance; beyond, its diagonal


class OpenLoop(NamedTuple):
    """Offsets that a search has found, and how they do.

    Attributes:
        offsets: (windows, m) [rad].
        error: over the motion, as a time integral.
        upright: time until the robot falls, at most the motion's windows [s].
        simulated: time that the search has simulated [s].
    """

    offsets: np.ndarray
    error: float
    upright: float
    simulated: float


def replay(plant: Plant, offsets: np.ndarray, velocity: float = 0.0) -> OpenLoop:
    """Play offsets (windows, m) from standing to the end, or to a fall.

    What is not played after a fall counts as fallen. With a `velocity` [m/s] the whole robot
    begins with that, forward.
    """
    before, state, error, upright = plant.simulated, plant.start(velocity), 0.0, 0.0
    span = plant.steps * plant.dt
    for window, offset in enumerate(offsets):
        played = plant.play(state, window, offset)
        state, error, upright = played.state, error + played.error, upright + played.upright
        if played.upright < span - 1e-9:
            error += FALLEN * span * (len(offsets) - window - 1)
            break
    return OpenLoop(np.array(offsets), error, upright, plant.simulated - before)


def search_whole(plant: Plant, budget: float, seed: int = 0) -> OpenLoop:
    """CMA-ES [Hansen16] over all windows at once; every sample is simulated from the start.

    Ends with the sample that has used up a `budget` of simulated time [s].

    Raises:
        ConfigError: the package `cma` is missing; a budget that is not above 0.
    """
    with needing("dev"):
        import cma
    _check(budget)
    before, shape = plant.simulated, (plant.windows, plant.size)
    best = replay(plant, np.zeros(shape))
    count = plant.windows * plant.size
    options = {"seed": seed + 1, "verbose": -9, "CMA_diagonal": count > FULL}
    strategy = cma.CMAEvolutionStrategy(np.zeros(count), SPREAD, options)
    while plant.simulated - before < budget:
        samples, errors = strategy.ask(), []
        for sample in samples:
            found = replay(plant, sample.reshape(shape))
            errors.append(found.error)
            best = min(best, found, key=lambda each: each.error)
            if plant.simulated - before >= budget:
                break
        if len(errors) < len(samples):
            break
        strategy.tell(samples, errors)
    return best._replace(simulated=plant.simulated - before)


class _Path(NamedTuple):
    """A way through the first windows."""

    error: float
    offsets: tuple[np.ndarray, ...]
    state: np.ndarray


def samcon(plant: Plant, budget: float, seed: int = 0, spread: float = SPREAD) -> OpenLoop:
    """SAMCON [Liu10]: samples of one window, of which the best go on from where they got to.

    Every window has as many samples as a `budget` of simulated time [s] pays for; the samples go
    on from the saved ones in turn, with offsets drawn about those of the window before, half as
    far as those lead away from 0. The best fifth is saved.

    Raises ConfigError for a budget of fewer than two samples a window.
    """
    _check(budget)
    span = plant.steps * plant.dt
    samples = int(budget / (plant.windows * span) + 1e-9)
    if samples < 2:
        raise ConfigError(f"must be {2 * plant.windows * span:.3g} s or more, not {budget:g}",
                          field="budget")  # fmt: skip
    before, rng = plant.simulated, np.random.default_rng(seed)
    saved = [_Path(0.0, (), plant.start())]
    for window in range(plant.windows):
        paths = []
        for k in range(samples):
            path = saved[k % len(saved)]
            middle = 0.5 * path.offsets[-1] if path.offsets else np.zeros(plant.size)
            offset = middle + (spread * rng.normal(size=plant.size) if k else 0.0)
            played = plant.play(path.state, window, offset)
            error = path.error + played.error
            paths.append(_Path(error, (*path.offsets, offset), played.state))
        saved = sorted(paths, key=lambda each: each.error)[: max(1, round(SAVED * samples))]
    spent = plant.simulated - before
    return replay(plant, np.array(saved[0].offsets))._replace(simulated=spent)


def _check(budget: float) -> None:
    if not 0.0 < budget < np.inf:
        raise ConfigError(f"must be above 0, not {budget:g}", field="budget")
