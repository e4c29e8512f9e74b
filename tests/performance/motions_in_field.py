"""Motions followed where the world is real: falls and errors at each level of realism.

    python -m tests.performance.motions_in_field --seed 25                # all motions and levels
    python -m tests.performance.motions_in_field squat walk --share 0.5   # pushed by half of J50
    python -m tests.performance.motions_in_field circle --controller walk --levels field

Clips and motions that come with Poise, the script of document 004, and walks, from disturbed starts
as `poise motion follow --realism` plays them, by the controllers of `MOTIONS`. Errors are those of
the true robot and not of what it believes, means over the trials that did not fall: of the bodies
from where the motion has them [mm]; of a sole that lands or, where both stay planted, its way since
it landed [mm]. `caught` is how often the planner of steps took over in a trial. Of walks `walked`
is the way over that told.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from poise.baselines.balance.references.robot_clip import write_robot_clip
from poise.baselines.motion.clips.bvh import read_bvh, write_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.space_time.retarget_clip import retarget_clip
from poise.baselines.motion.synthesis.scripts.library import find_script
from poise.envs.robots.robot import load_robot
from poise.training.motion.following.follow import Followed, follow
from poise.training.motion.following.scripts import open_synthesis, write_motion
from tests.support.captures import CAPTURES, make

#: what is played, and by which controllers: in place, with steps, walks
MOTIONS: dict[str, tuple[str, ...]] = {
    "humanoid_squat": ("momentum-qp",),
    "humanoid_reach_down": ("momentum-qp",),
    "humanoid_reach_up": ("momentum-qp",),
    "humanoid_punch": ("momentum-qp",),
    "humanoid_wave": ("momentum-qp",),
    "kick": ("motion-step",),
    "step_in_place": ("motion-step",),
    "humanoid_walk": ("motion-step",),
    "semakin04": ("motion-step",),
    "circle": ("walk",),
}
LEVELS = ("ideal", "lab", "field")


def motion_of(name: str, folder: Path) -> str:
    """What `follow` plays: a packaged motion's name, or the file of a clip or script, made here."""
    file, robot = folder / f"{name}.npz", load_robot("humanoid")
    if name == "semakin04":
        script = find_script(name)
        write_motion(open_synthesis(None, "humanoid", script=script), script, "humanoid", file)
        return str(file)
    if name in CAPTURES:
        write_bvh(make(name)[0], folder / f"{name}.bvh")
        path = folder / f"{name}.bvh"
    elif name.startswith("humanoid_"):
        path = find_bvh(name)
    else:
        return name
    write_robot_clip(retarget_clip(read_bvh(path).clip, robot).clip, file)
    return str(file)


def row_of(trials: Sequence[Followed]) -> list[str]:
    """Falls, and means over the trials that stayed up."""

    def mean(name: str, scale: float = 1000.0, form: str = ".1f") -> str:
        values = [scale * getattr(trial, name) for trial in trials if not trial.fallen]
        found = np.array(values)[np.isfinite(values)]
        return format(found.mean(), form) if len(found) else ""

    falls = sum(trial.fallen for trial in trials)
    soles = mean("placement_error") or mean("sole_slide")
    walked = mean("walked", 100.0, ".0f")
    errors = ["", ""] if walked else [mean("body_error"), soles]
    return [f"{falls} of {len(trials)}", *errors, mean("interruptions", 1.0), walked]


def main() -> None:
    """A row for each motion, controller and level as it is done."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="of motions; all, but for humanoid_")
    parser.add_argument("--controller", help="instead of those of each motion")
    parser.add_argument("--levels", nargs="+", default=LEVELS)
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--share", type=float, default=0.0, help="of J50, pushed in 16 directions")
    parser.add_argument("--seed", type=int, default=25)
    given = parser.parse_args()
    chosen = [name for name in MOTIONS if not given.names
              or name.removeprefix("humanoid_") in given.names or name in given.names]  # fmt: skip
    print("| motion | by | level | falls | bodies [mm] | soles [mm] | caught | walked [%] |\n"
          + "|---" * 8 + "|")  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="poise-") as temporary:
        for name in chosen:
            motion = motion_of(name, Path(temporary))
            for controller in [given.controller] if given.controller else MOTIONS[name]:
                for level in given.levels:
                    with warnings.catch_warnings():  # means of nothing, where all fall
                        warnings.simplefilter("ignore", RuntimeWarning)
                        trials = follow(
                            motion, controller, starts=given.starts, seed=given.seed,
                            share=given.share, directions=16, realism=level,
                        )  # fmt: skip
                        row = row_of(trials)
                    cells = [name.removeprefix("humanoid_"), controller, level, *row]
                    print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main()
