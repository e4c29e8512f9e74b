"""Length and time of real steps: `python -m tests.benchmarks.steps [CONTROLLER…]`.

First steps of recoveries from 0.1 s torso pushes in 16 directions at 0.7 to 1.1 of
`residual-step`'s J50, against the l and T_s that `NStepLimit` takes from the planner's limits. A
step lasts from lift-off to touchdown (to 20 ms, a policy step); its length is how far the sole
moved. Sideways: directions of 67 to 113° and 247 to 293°.
"""

from __future__ import annotations

import sys
from collections import defaultdict

import numpy as np

from poise.envs.robot import load_robot
from poise.training.limits import PushLimits
from poise.training.players import load_player
from poise.training.step_limits import NStepLimit

J50 = (30.5, 29.0, 30.5, 22.0, 22.5, 27.0, 31.5, 31.5)  # [N·s] every 22.5°, left as right
J50 = (*J50, 30.6, *J50[:0:-1])
SHARES = (0.7, 0.8, 0.9, 1.0, 1.1)


def first_step(player, impulse: float, direction: float, seed: int):
    """(time [s], length [m]) of the first step of a recovery; None for a fall or no step."""
    env = player.env
    push = {"impulse": impulse, "direction": direction, "start": 0.5, "body": "torso"}
    observation, _ = env.reset(seed=seed, options={"push": push})
    begun = found = None
    over = False
    while not over:
        observation, _, fallen, over, _ = env.step(player.act(observation))
        over = over or fallen
        now, feet = env.simulation.time, env.simulation.state.sole_points
        told = env.controller.stepping()
        if begun is None and told.steps == 1 and told.foot >= 0 and told.phase > 0.0:
            begun = (told.foot, now, feet[told.foot, :2].copy())
        if begun is not None and found is None and (told.foot < 0 or told.steps > 1):
            foot, since, place = begun
            found = (now - since, float(np.linalg.norm(feet[foot, :2] - place)))
    return None if fallen else found


def main() -> None:
    names = sys.argv[1:] or ["capture-step", "residual-step"]
    robot = load_robot()
    print("| controller | directions | first steps | time, median (5 %) [s] | "
          "length, median (95 %) [m] | T_s, l of the limit |")  # fmt: skip
    print("| --- | --- | --- | --- | --- | --- |")
    for name in names:
        player = load_player(name, robot)
        steps = defaultdict(list)
        limit = NStepLimit(PushLimits(robot), player.env.controller.planner.limits)
        for k in range(16):
            angle = 22.5 * k
            sideways = "sideways" if abs(np.sin(np.radians(angle))) > 0.9 else "others"
            for seed, share in enumerate(SHARES):
                step = first_step(player, share * J50[k], angle, seed)
                if step is not None:
                    steps[sideways].append((*step, limit.length(angle)))
        for which, rows in steps.items():
            time, length, bound = np.array(rows).T
            short, long = np.percentile(time, 5), np.percentile(length, 95)
            print(f"| {name} | {which} | {len(rows)} | {np.median(time):.2f} ({short:.2f}) | "
                  f"{np.median(length):.2f} ({long:.2f}) | "
                  f"{limit.time:.2f}, {bound.mean():.2f} |")  # fmt: skip


if __name__ == "__main__":
    main()
