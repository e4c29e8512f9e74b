"""Largest speed factor of a motion at which a controller does not fall."""

from collections.abc import Callable
from pathlib import Path

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.envs.robots.robot import Robot

from .follow import Followed, follow

STEP = 0.05  # resolution of the reported tempo
STARTS = 5
MOST = 4.0  # times as fast, at most


def fastest(
    motion: str | Path | ReferenceMotion,
    controller: str = "momentum-qp",
    *,
    robot: str | Path | Robot = "humanoid",
    starts: int = STARTS,
    seed: int = 0,
    say: Callable[[float, list[Followed]], object] = lambda tempo, trials: None,
) -> float:
    """Return the largest tempo, in steps of 0.05 and up to 4, at which no trial of `starts` falls.

    It is bisected between tempos of which the one is followed and the other is not, as if there
    were one limit: that nothing between falls is not tried. 0 if the motion falls at a tenth of
    its own tempo. `say` is called with each tempo and its trials.

    Raises ConfigError as `follow`.
    """

    def stands(steps: int) -> bool:
        tempo = round(steps * STEP, 10)
        trials = follow(motion, controller, robot=robot, starts=starts, seed=seed, speed=tempo,
                        patient=False)  # fmt: skip
        say(tempo, trials)
        return not any(trial.fallen for trial in trials)

    most = round(MOST / STEP)
    good, step = round(1.0 / STEP), round(0.5 / STEP)
    if not stands(good):
        low, bad = round(0.1 / STEP), good
        if not stands(low):
            return 0.0
        good = low
    else:
        bad = good + step
        while bad <= most and stands(bad):
            good, bad = bad, bad + step
        if bad > most:
            return round(good * STEP, 10)
    while bad - good > 1:
        middle = (good + bad) // 2
        good, bad = (middle, bad) if stands(middle) else (good, middle)
    return round(good * STEP, 10)


def find_fastest(motion: str, controller: str, robot: str, starts: int, seed: int) -> float:
    """Return the same with a line for each tempo and one for what was found."""

    def say(tempo: float, trials: list[Followed]) -> None:
        fallen = sum(trial.fallen for trial in trials)
        print(f"tempo {tempo:.2f}: {fallen} of {len(trials)} fell", flush=True)

    found = fastest(motion, controller, robot=robot, starts=starts, seed=seed, say=say)
    print(f"{Path(motion).stem} by {controller} on {robot}: followed up to {found:.2f} times its "
          f"tempo, 0 of {starts} falls" if found else "not followed at any tempo")  # fmt: skip
    return found
