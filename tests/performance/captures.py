"""Captures performed: at what share of their speed, and how often without a fall.

    python -m tests.performance.captures                       # 15 captures, 20 starts each
    python -m tests.performance.captures walk cmu02_jump --starts 5
    python -m tests.performance.captures mine.bvh yours.bvh      # files
    python -m tests.performance.captures --robot unitree_g1      # another robot

Five of others, found by name as `poise motion import` finds them (POISE_CLIPS, see
docs/motions.md), and the ten that `tests.support.captures` makes. Each is imported as that command
does it, and followed as `poise motion follow --seed 21` by what the import names where a planner
walks it (`walk`, `walk-fast` or `residual-walk-fast`), else by `motion-step`. Its speed is its way
times its tempo, as shares of the clip's; where it walks, `reached` is that times the way that it
went over the clip's, mean. `caught` is how often the planner of steps took over in a trial, mean.
`steps` are those that the clip's foot took within 0.1 s, after the `delay` of a walk; `joints` the
RMS error [°], of a walk of trunk and arms. Both are means over trials.
Bar: 80 % at 0.7 of their speed without a fall, and with 90 % of the steps of those that step.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references.robot_clip import RobotClip, write_robot_clip
from poise.baselines.motion.clips.bvh import read_bvh, write_bvh
from poise.baselines.motion.clips.library import captured_clips
from poise.baselines.motion.space_time.retarget_clip import RetargetedClip, retarget_clip
from poise.envs.robots.robot import load_robot
from poise.training.motion.following.follow import follow
from poise.training.motion.following.rehearsal import rehearsal
from tests.support.captures import CAPTURES, make

OTHERS = ("cmu02_jump", "cmu_12_01_walk", "cmu_jumping_jacks", "fair1_jumping", "makehuman_walk1")
SPEED, STEPS, SHARE = 0.7, 0.9, 0.8  # of a clip's speed, of its steps, of the clips: the bars


class Row(NamedTuple):
    """What came of one capture: shares of the clip's way, tempo and time in the air at a time."""

    name: str
    how: str
    way: float
    tempo: float
    flight: float
    went: float
    falls: int
    caught: float
    refused: str
    steps: float = np.nan
    delay: float = np.nan
    joints: float = np.nan

    @property
    def speed(self) -> float:
        return self.way * self.tempo

    @property
    def reached(self) -> float:
        return self.speed * self.went

    @property
    def moves(self) -> bool:
        return not self.refused and self.falls == 0 and self.speed >= SPEED - 5e-3

    @property
    def steps_kept(self) -> bool:
        return bool(np.isnan(self.steps) or self.steps >= STEPS - 5e-3)

    @property
    def verdict(self) -> str:
        if self.refused:
            return self.refused
        steps = "" if self.steps_kept else "other steps"
        return "met" if self.moves and not steps else steps if self.moves else "missed"


def kind_of(clip: RobotClip) -> str:
    """How a motion is performed."""
    if clip.commands is not None:
        return "walk"
    if clip.planted is None:
        return "stands"
    return "steps" if clip.planted.any(axis=1).all() else "jumps"


def judge(path: Path, starts: int, seed: int, folder: Path, robot: str) -> Row:
    """Import a capture, and perform it from disturbed starts."""
    body = load_robot(robot)
    made: RetargetedClip = retarget_clip(read_bvh(path).clip, body, holds=rehearsal(body))
    how, reason = kind_of(made.clip), made.clip.about.unperformed
    row = Row(path.stem, how, made.stride, made.tempo, made.flight, 1.0, 0, 0.0, reason)
    if reason:
        return row._replace(how="refused")
    file = folder / f"{path.stem}.npz"
    write_robot_clip(made.clip, file)
    trials = follow(file, made.walker or "motion-step", robot=robot, starts=starts, seed=seed)
    caught = float(np.nan_to_num(np.mean([trial.interruptions for trial in trials])))
    walked = np.array([trial.walked for trial in trials])  # NaN: falls before the clip begins
    went = 1.0 if np.isnan(walked).all() else made.asked * float(np.nan_to_num(walked).mean())
    falls = sum(trial.fallen for trial in trials)
    steps, delay, joints = (
        float(np.mean([getattr(trial, name) for trial in trials]))
        for name in ("footsteps_kept", "footstep_delay", "joint_rms")
    )
    return row._replace(falls=falls, caught=caught, went=went, steps=steps, delay=delay,
                        joints=np.degrees(joints))  # fmt: skip


def summary(rows: list[Row]) -> str:
    """How many move as the clip, how many of them reach its speed, and how many take its steps."""
    moving = [row for row in rows if row.moves]
    fast = sum(row.reached >= SPEED - 5e-3 for row in moving)
    stepping = [row for row in moving if not np.isnan(row.steps)]
    kept = sum(row.steps_kept for row in stepping)
    return (f"{sum(row.verdict == 'met' for row in rows)} of {len(rows)} met (bar {SHARE:.0%}): "
            f"{len(moving)} at {SPEED} of their speed or more without a fall, {fast} of them reach "
            f"it; {kept} of {len(stepping)} that step keep {STEPS:.0%} of the steps; "
            f"{sum(bool(row.refused) for row in rows)} refused")  # fmt: skip


def main() -> None:
    """A line for each capture as it is done, and how many meet the bar."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="of captures, or .bvh files; all")
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--seed", type=int, default=21)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="poise-") as temporary:
        folder = Path(temporary)
        for name in CAPTURES:
            write_bvh(make(name)[0], folder / f"{name}.bvh")
        known = captured_clips()
        paths = [known[name] for name in OTHERS if name in known]
        paths += [folder / f"{name}.bvh" for name in CAPTURES]
        files = [Path(name) for name in given.names if name.endswith(".bvh")]
        named = [path for path in paths if path.stem in given.names]
        print("| capture | as | way | tempo | in the air | speed | reached | falls | caught "
              "| steps | delay | joints | |\n" + "|---" * 13 + "|")  # fmt: skip
        rows = []
        for path in [*named, *files] if given.names else paths:
            row = judge(path, given.starts, given.seed, folder, given.robot)
            rows.append(row)
            shares = (row.way, row.tempo, row.flight, row.speed, row.reached)
            figures = " | ".join(f"{share:.2f}" for share in shares)
            figures += f" | {row.falls} of {given.starts} | {row.caught:.1f} | {row.steps:.0%}"
            figures += f" | {row.delay:.2f} | {row.joints:.1f}"
            print(f"| {row.name} | {row.how} | " + (" | " * 9 if row.refused else figures)
                  + f" | {row.verdict} |", flush=True)  # fmt: skip
    print(summary(rows))


if __name__ == "__main__":
    main()
