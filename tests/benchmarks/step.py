"""The control tick and the environment's step against physics: `python -m tests.benchmarks.step`.

All on states of real push recoveries, in one process. The yardstick is `mj_step` of the same
robot in the same states.
"""

from __future__ import annotations

import time

import mujoco
import numpy as np

from poise.baselines.momentum_qp import momentum_tick
from poise.baselines.residual_balance import ResidualBalanceEnv

from .recoveries import DIRECTIONS, IMPULSES, record


def tick_times() -> np.ndarray:
    """Seconds of each compiled control tick, called from Python."""
    env, recoveries = record()
    controller, times = env.controller, []
    for recovery in recoveries:
        controller.reset()
        for tick in recovery:
            arguments = (
                controller.arrays, tick.state.arrays, controller.parameters,
                tick.targets.arrays(), controller.period, controller.workspace, controller.memory,
            )  # fmt: skip
            start = time.perf_counter()
            momentum_tick(*arguments)
            times.append(time.perf_counter() - start)
    return np.array(times)


def step_times() -> tuple[np.ndarray, np.ndarray]:
    """Seconds of each environment step, and of as many `mj_step` calls from the same states."""
    env = ResidualBalanceEnv(pushes=None, duration=2.0)
    model, shadow = env.robot.model, mujoco.MjData(env.robot.model)
    action = np.zeros(env.action_space.shape)
    steps, physics = [], []
    for direction in DIRECTIONS:
        for impulse in IMPULSES:
            push = {"impulse": impulse, "direction": direction, "start": 0.1}
            env.reset(seed=0, options={"push": push})
            ended = False
            while not ended:
                data = env.simulation.data
                shadow.qpos[:], shadow.qvel[:], shadow.ctrl[:] = data.qpos, data.qvel, data.ctrl
                shadow.qacc_warmstart[:] = data.qacc_warmstart
                start = time.perf_counter()
                for _ in range(env.substeps):
                    mujoco.mj_step(model, shadow)
                physics.append(time.perf_counter() - start)
                start = time.perf_counter()
                _, _, terminated, truncated, _ = env.step(action)
                steps.append(time.perf_counter() - start)
                ended = terminated or truncated
    return np.array(steps), np.array(physics)


def main() -> None:
    steps, physics = step_times()
    ticks = tick_times()
    print("| path | median | p99 | over physics |")
    print("| --- | --- | --- | --- |")
    floor = float(np.median(physics))
    rows = {"10 × mj_step": physics, "ResidualBalance-v0.step": steps, "control tick": ticks}
    for name, times in rows.items():
        median, slow = np.median(times), np.percentile(times, 99)
        print(f"| {name} | {1e6 * median:.0f} µs | {1e6 * slow:.0f} µs | {median / floor:.2f} |")


if __name__ == "__main__":
    main()
