"""Open loop against feedback: `python -m tests.performance.open_loop [--budget 30]`.

Servos at the gains of `pd` track keyframe motions with offsets that SAMCON and CMA-ES of the whole
have found, each with the same simulated time, `budget` times the motion. Printed: how long the
robot stays up, from standing and where it begins at 5 cm/s. The last row is momentum-qp.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

from poise.baselines.balance.references.motion import load_motion
from poise.envs.robots.robot import load_robot
from poise.training.motion.following.follow import follow
from tests.performance.open_loop.plant import Plant
from tests.performance.open_loop.search import OpenLoop, replay, samcon, search_whole

MOTIONS = ("squat", "weight_shift")
VELOCITY = 0.05  # [m/s]
STARTS = 3


def compare(name: str, budget: float, seeds: int) -> None:
    robot = load_robot()
    plant = Plant(robot, load_motion(name, robot))
    span = plant.windows * plant.steps * plant.dt
    still = replay(plant, np.zeros((plant.windows, plant.size)))
    rows: list[tuple[str, OpenLoop]] = [("servos alone", still)]
    for seed in range(seeds):
        rows.append((f"SAMCON, seed {seed}", samcon(plant, budget * span, seed)))
        rows.append((f"CMA-ES, seed {seed}", search_whole(plant, budget * span, seed)))
    for title, found in rows:
        moving = replay(plant, found.offsets, VELOCITY)
        print(f"| {name} | {title} | {found.simulated:.0f} s | {found.upright:.1f} of {span:.1f} s "
              f"| {found.error:.2f} | {moving.upright:.1f} s |", flush=True)  # fmt: skip
    falls = sum(trial.fallen for trial in follow(name, starts=STARTS))
    print(f"| {name} | momentum-qp, {STARTS} disturbed starts | – | {falls} falls | – | – |",
          flush=True)  # fmt: skip


def main(args: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--budget", type=float, default=30.0, help="times the motion")
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args(sys.argv[1:] if args is None else args)
    print("| motion | found by | simulated | upright | error | upright from 5 cm/s |")
    print("| --- " * 6 + "|")
    for name in MOTIONS:
        compare(name, options.budget, options.seeds)


if __name__ == "__main__":
    main()
