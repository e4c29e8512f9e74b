"""Reach, length and time of real steps: `python -m tests.performance.steps [CONTROLLER…]`.

First steps of recoveries from 0.1 s torso pushes in 16 directions at 0.7 to 1.1 of `IMPULSES`,
against the r, l and T_s that `NStepLimit` takes from soles, ankles and the planner's limits. A step
lasts from lift-off to touchdown (to 20 ms, a policy step); its length is how far the sole moved. r
is how far the CoP got in the push's direction from where the CoM was before it, with both feet in
place: until a lift-off. Sideways: directions of 67 to 113° and 247 to 293°.
"""

from __future__ import annotations

import sys
from collections import defaultdict

import numpy as np

from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.step_limits import NStepLimit

# about J50 of `residual-step` after its first stage
IMPULSES = (30.5, 29.0, 30.5, 22.0, 22.5, 27.0, 31.5, 31.5)  # [N·s] every 22.5°, left as right
IMPULSES = (*IMPULSES, 30.6, *IMPULSES[:0:-1])
SHARES = (0.7, 0.8, 0.9, 1.0, 1.1)


def first_step(agent, impulse: float, direction: float, seed: int):
    """Reach r [m], time [s] and length [m] of the first step of a recovery; None for a fall or no
    step."""
    env = agent.env
    push = {"impulse": impulse, "direction": direction, "start": 0.5, "body": "torso"}
    observation, _ = env.reset(seed=seed, options={"push": push})
    away = np.array([np.cos(np.radians(direction)), np.sin(np.radians(direction))])
    begun = found = None
    start, reach = np.zeros(2), -np.inf
    over = False
    while not over:
        observation, _, fallen, over, _ = env.step(agent.act(observation))
        over = over or fallen
        state, now = env.simulation.state, env.simulation.time
        feet = state.sole_points
        observed = env.controller.stepping()
        if begun is None and observed.steps == 1 and observed.foot >= 0 and observed.phase > 0.0:
            begun = (observed.foot, now, feet[observed.foot, :2].copy())
        if now <= 0.5:
            start = state.com[:2].copy()
        elif begun is None:
            reach = max(reach, float((state.cop - start) @ away))
        if begun is not None and found is None and (observed.foot < 0 or observed.steps > 1):
            foot, since, place = begun
            found = (reach, now - since, float(np.linalg.norm(feet[foot, :2] - place)))
    return None if fallen else found


def main() -> None:
    names = sys.argv[1:] or ["capture-step", "residual-step"]
    robot = load_robot()
    print(
        "| controller | directions | first steps | reach, median (95 %) [m] | "
        "time, median (5 %) [s] | length, median (95 %) [m] | r, T_s, l of the limit |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name in names:
        agent = load_agent(name, robot)
        steps = defaultdict(list)
        limit = NStepLimit(PushLimits(robot), agent.env.controller.step_limits)
        for k in range(16):
            angle = 22.5 * k
            sideways = "sideways" if abs(np.sin(np.radians(angle))) > 0.9 else "others"
            for seed, share in enumerate(SHARES):
                step = first_step(agent, share * IMPULSES[k], angle, seed)
                if step is not None:
                    steps[sideways].append((*step, limit.reach(angle), limit.length(angle)))
        for which, rows in steps.items():
            reach, time, length, radius, bound = np.array(rows).T
            far, short, long = (
                np.percentile(column, share)
                for column, share in ((reach, 95), (time, 5), (length, 95))
            )
            print(f"| {name} | {which} | {len(rows)} | {np.median(reach):.2f} ({far:.2f}) | "
                  f"{np.median(time):.2f} ({short:.2f}) | {np.median(length):.2f} ({long:.2f}) | "
                  f"{radius.mean():.2f}, {limit.time:.2f}, {bound.mean():.2f} |")  # fmt: skip


if __name__ == "__main__":
    main()
