"""The sub-command `gait`: reference models of a walk beside each other."""

from pathlib import Path
from typing import Annotated

import tyro

from poise.training.running.terminal import terminal

from .arguments import Allow, Switch


def gait(
    *,
    compare: Annotated[tuple[str, ...], tyro.conf.arg(metavar="MODEL …")],
    out: Path,
    speeds: tuple[float, ...] = (0.5, 0.8),
    starts: int = 4,
    duration: float = 20.0,
    robot: str = "humanoid",
    seed: int = 21,
    human: str = "knee-moment",
    push: Switch = False,
    push_suite: str = "walk-push",
    workers: int | None = None,
    allow: Allow = (),
) -> None:
    """Compare how reference models walk: speed, cost, the stance knee beside a human's.

    Args:
        compare: lip, rigid, spring, double, or controllers that walk.
        out: folder to write gaits.json and stance_knee.png to.
        speeds: ahead [m/s].
        starts: walks at each speed, a little disturbed.
        duration: of a walk [s].
        robot: a packaged robot (see poise list) or a .yaml description.
        seed: of the starts.
        human: a packaged band of the human knee's moment or a .yaml file of one.
        push: find J50, too; by the suite walk-push at 0.5 m/s, an hour and more.
        push_suite: another suite with a part walk_push, or a .yaml file of one.
        workers: processes of that suite; all cores if not given.
    """
    from poise.training.gaits.compare import compare_gaits
    from poise.training.gaits.tables import print_gaits

    figures = compare_gaits(
        compare, out=out, speeds=speeds, starts=starts, duration=duration, robot=robot, seed=seed,
        human=human, pushed=push, push_suite=push_suite, workers=workers, say=_say, allow=allow,
    )  # fmt: skip
    print_gaits(figures, terminal())
    for name in ("gaits.json", "stance_knee.png"):
        print(out / name)


def _say(line: str) -> None:
    print(line, flush=True)
