"""Verdicts of a result's pushes from other starts, in another engine, by other options.

    python -m tests.performance.verdicts RESULT CONTROLLER [--robot NAME] [--starts 0 1 2 3]
        [--trials 2 6] [--variants mujoco limits=limits:0.002,step:0.001 drake=engine:drake]

RESULT is a folder of `poise evaluate`: its trials with one push, or none. A start is a number added
to the seed of a trial; 0 is its own. A variant has fields of `Physics` (docs/physics.md), or
options of MuJoCo: `limits` and `contacts`, the time constants of joint limits and of contacts [s],
`step`, the physics step [s], `cone`, 1 for elliptic. `#` is a recovered trial.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

from poise.envs.physics.engines.config import Physics, load_physics
from poise.envs.physics.pushes.push import Push
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.robots.variants import coarser_robot
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.trial import Trial

WORDS = ("engine", "contact")  # fields of `Physics` that are text


def variant(text: str, robot: str) -> tuple[str, Robot, Physics]:
    """The name, the robot and the engine of ``NAME=key:value,key:value``."""
    name, _, rest = text.partition("=")
    given = dict(each.split(":") for each in rest.split(",") if each)
    step = given.pop("step", None)
    made = load_robot(robot)
    if step is not None:
        made = coarser_robot(made, float(step))
    if "limits" in given:
        made.model.jnt_solref[:, 0] = float(given.pop("limits"))
    if "contacts" in given:
        made.model.geom_solref[:, 0] = float(given.pop("contacts"))
    if "cone" in given:
        made.model.opt.cone = int(given.pop("cone"))
    fields = {key: value if key in WORDS else float(value) for key, value in given.items()}
    if "substeps" in fields:
        fields["substeps"] = int(given["substeps"])
    return name, made, load_physics(fields or None)


def trials_of(result: Path, chosen: list[int]) -> list[Trial]:
    """The trials of a result, each once, without what they do beside one push."""
    found = {}
    for row in csv.DictReader((result / "trials.csv").open()):
        number = int(row["trial"])
        size = [float(row[key] or 0.0) for key in ("start", "duration", "impulse", "direction")]
        pushes = (Push(row["body"], *size),) if row["body"] else ()
        if not chosen or number in chosen:
            found[number] = Trial(number, int(row["seed"]), pushes)
    return [found[number] for number in chosen or sorted(found)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("result", type=Path)
    parser.add_argument("controller")
    parser.add_argument("--robot", default="humanoid")
    parser.add_argument("--starts", type=int, nargs="+", default=[0])
    parser.add_argument("--trials", type=int, nargs="+", default=[])
    parser.add_argument("--variants", nargs="+", default=["mujoco"])
    parser.add_argument("--duration", type=float, default=5.0)
    args = parser.parse_args()
    for text in args.variants:
        name, robot, physics = variant(text, args.robot)
        agent = load_agent(args.controller, robot, physics=physics, realism="ideal",
                           duration=args.duration)  # fmt: skip
        for start in args.starts:
            verdicts, chatter = "", 0.0
            trials = trials_of(args.result, args.trials)
            for trial in trials:
                outcome = run_trial(agent, Trial(trial.number, trial.seed + start, trial.pushes))
                verdicts += "#" if outcome.recovered else "."
                chatter += outcome.torque_variation / len(trials)
            print(f"{name:10} start {start}: {verdicts} {verdicts.count('#')} of {len(trials)}, "
                  f"chatter {chatter:.3f} /s", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
