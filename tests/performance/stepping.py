"""Speed of the stepping controller: `python -m tests.performance.stepping`.

Processor time of an environment step (20 ms, five ticks) and of a tick, by what the controller
does, over pushes of 8 to 30 N·s in eight directions; `momentum-qp`, which runs compiled, between.
"""

from __future__ import annotations

import time

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.stepping import ResidualStepEnv
from tests.performance.clocked import ClockedByKind

PUSHES = [
    {
        "impulse": 8.0 + 22.0 * (3 * k % 8) / 7.0,
        "direction": 45.0 * k,
        "start": 0.1,
        "body": "torso",
    }
    for k in range(8)
]
SECONDS = 2.0


def kind_of(controller) -> str:
    """What a tick of a stepping controller was for."""
    step = controller.stepping()
    return "in a swing" if step.foot >= 0 else "after a step" if step.steps else "feet in place"


def play(env, push) -> list[float]:
    """Processor time of each step of a trial [s]."""
    env.reset(seed=0, options={"push": push})
    action, times, ended = np.zeros(env.action_space.shape), [], False
    while not ended:
        begun = time.thread_time()
        _, fallen, over = env.step_without_info(action)
        times.append(time.thread_time() - begun)
        ended = fallen or over
    return times


def main() -> None:
    envs = {
        "ResidualBalance-v0, momentum-qp": ResidualBalanceEnv(pushes=None, duration=SECONDS),
        "ResidualStep-v0, capture-step": ResidualStepEnv(pushes=None, duration=SECONDS),
    }
    steps: dict[str, list[float]] = {name: [] for name in envs}
    for env in envs.values():
        play(env, PUSHES[-1])  # compiled
    for push in PUSHES:
        for name, env in envs.items():
            steps[name] += play(env, push)
    stepping = envs["ResidualStep-v0, capture-step"]
    clocked = stepping.controller = ClockedByKind(stepping.controller, stepping.robot, kind_of)
    for push in PUSHES:
        play(stepping, push)
    print("| path | median | mean | steps per second |")
    print("| --- | --- | --- | --- |")
    for name, times in steps.items():
        mean = float(np.mean(times))
        print(
            f"| {name} | {1e6 * np.median(times):.0f} µs | {1e6 * mean:.0f} µs | {1 / mean:.0f} |"
        )
    for name, times in clocked.seconds.items():
        print(
            f"| tick {name} | {1e6 * np.median(times):.0f} µs | {1e6 * np.mean(times):.0f} µs | |"
        )


if __name__ == "__main__":
    main()
