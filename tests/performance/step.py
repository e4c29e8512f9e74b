"""The control tick and the environment's step against physics.

    python -m tests.performance.step [--robot humanoid]

All on states of real push recoveries, in one process, interleaved. The yardstick is `mj_step` of
the same robot in the same states. A tick is timed inside compiled code, in three parts: MuJoCo's
position and velocity stages (which the physics step shares), `update_state`, `momentum_tick`.
"""

from __future__ import annotations

import argparse
import time

import mujoco
import numpy as np

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.robots.robot import load_robot
from tests.performance.recoveries import DIRECTIONS, impulses, record
from tests.performance.tick_clock import TickClock

PASSES = 5  # over the same ticks: the least time of each is what it takes undisturbed


def tick_times(robot: str) -> np.ndarray:
    """(ticks, 3) seconds of the parts of each control tick of the recoveries.

    All ticks, one after the other, since each starts from the solution of the one before. A tick
    does the same in every pass, for the controller's memory is reset with each recovery.
    """
    env, recoveries = record(every=1, robot=robot)
    clock = TickClock(env.controller)
    clock.time(recoveries[0][0])  # compiled
    passes = []
    for _ in range(PASSES):
        times = []
        for recovery in recoveries:
            env.controller.reset()
            times += [clock.time(tick) for tick in recovery]
        passes.append(times)
    return np.array(passes).min(axis=0)


def step_times(robot: str) -> tuple[np.ndarray, np.ndarray]:
    """Seconds of each environment step, and of as many `mj_step` calls from the same states."""
    env = ResidualBalanceEnv(load_robot(robot), pushes=None, duration=2.0)
    model, shadow = env.robot.model, mujoco.MjData(env.robot.model)
    action = np.zeros(env.action_space.shape)
    steps, physics = [], []
    for direction in DIRECTIONS:
        for impulse in impulses(robot):
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="humanoid")
    robot = parser.parse_args().robot
    steps, physics = step_times(robot)
    parts = tick_times(robot)
    print("| path | median | p99 | over physics | p99 over median |")
    print("| --- | --- | --- | --- | --- |")
    floor = float(np.median(physics))
    rows = {
        "10 × mj_step": physics,
        "ResidualBalance-v0.step": steps,
        "tick: mj_step1": parts[:, 0],
        "tick: update_state": parts[:, 1],
        "tick: momentum_tick": parts[:, 2],
        "tick, positions and velocities to torques": parts.sum(axis=1),
    }
    for name, times in rows.items():
        median, slow = float(np.median(times)), float(np.percentile(times, 99))
        print(f"| {name} | {1e6 * median:.1f} µs | {1e6 * slow:.1f} µs | {median / floor:.2f} | "
              f"{slow / median:.2f} |")  # fmt: skip
    print(f"{len(steps)} steps, each once, and {len(parts)} ticks, each the least of {PASSES}.")
    pairs = np.median(steps / physics)
    print(f"step / (10 mj_step), median of the interleaved pairs: {pairs:.2f}")


if __name__ == "__main__":
    main()
