"""Speed of a walk: `python -m tests.performance.walking`.

Processor time of an environment step (20 ms, five ticks) and of a tick from Python, on one foot and
on both, at 0.5 m/s; each beside `momentum-qp` at rest, which is played between, as a ratio.
"""

from __future__ import annotations

import time
from collections import defaultdict

import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from tests.performance.clocked import ClockedByKind

SECONDS, BEGUN, ROUNDS = 8.0, 3.0, 5
NAMES = ("momentum-qp", "walk", "walk-double")


def kind_of(controller) -> str:
    """What a tick was for, once it walks."""
    swinging = getattr(getattr(controller, "memory", None), "swinging", None)
    return "" if swinging is None else ", in a swing" if swinging else ", on both feet"


def play(env, name) -> list[float]:
    """Processor time of each step after the first seconds of a trial [s]."""
    options = {} if name == "momentum-qp" else {"command": {"ahead": 0.5}}
    env.reset(seed=0, options=options)
    begin, times, action = round(BEGUN / 0.02), [], np.zeros(env.action_space.shape)
    for k in range(env.max_steps):
        if k == begin and isinstance(env.controller, ClockedByKind):
            env.controller.seconds.clear()
        begun = time.thread_time()
        env.step_without_info(action)
        times.append(time.thread_time() - begun)
    return times[begin:]


def main() -> None:
    envs = {
        name: ResidualBalanceEnv(controller=name, pushes=None, duration=SECONDS) for name in NAMES
    }
    steps: dict[str, list[float]] = defaultdict(list)
    for name, env in envs.items():
        play(env, name)  # compiled
    for _ in range(ROUNDS):
        for name, env in envs.items():
            steps[name] += play(env, name)
    ticks: dict[str, list[float]] = defaultdict(list)
    for env in envs.values():
        env.controller = ClockedByKind(env.controller, env.robot, kind_of)
    for _ in range(ROUNDS):
        for name, env in envs.items():
            play(env, name)
            for kind, seconds in env.controller.seconds.items():
                ticks[name + kind] += seconds
    print("| path | median | 99th percentile | median over that of momentum-qp |")
    print("| --- | --- | --- | --- |")
    for title, found in (("step", steps), ("tick", ticks)):
        rest = float(np.median(next(iter(found.values()))))
        for name, times in found.items():
            median, high = np.median(times), np.quantile(times, 0.99)
            print(f"| {title} of {name} | {1e6 * median:.0f} \u00b5s | {1e6 * high:.0f} \u00b5s "
                  f"| {median / rest:.2f} |")  # fmt: skip


if __name__ == "__main__":
    main()
