"""Vectorised stepping against one environment and processes: `python -m tests.performance.vector`.

Environment steps per second on ResidualBalance-v0 with its default pushes, automatic resets and
small random actions. The contestants take turns; a ratio is the median over rounds. Run it on a
quiet machine: where other jobs compete for the cores, two threads are given no more time than one.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Connection

import gymnasium
import numpy as np
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv

import poise  # noqa: F401  (registers the environments)
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.balance.vector.batch import replicate
from poise.training.learning.vec_env import ThreadedVecEnv

NAME = "poise/ResidualBalance-v0"
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
THREADS = min(2, CORES)
ROUNDS, SECONDS = 9, 1.0  # of each contestant per round
SPREAD = 0.2  # of the actions

Stepper = Callable[[], object]


def single() -> tuple[int, Stepper]:
    """One environment, `step` by `step`."""
    env = gymnasium.make(NAME).unwrapped
    env.reset(seed=0)
    draw = actions(env.action_space.shape)

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(draw())
        if terminated or truncated:
            env.reset()

    return 1, step


def native(count: int, threads: int) -> tuple[int, Stepper]:
    """`gymnasium.make_vec`'s threads."""
    env = gymnasium.make_vec(NAME, num_envs=count, threads=threads)
    env.reset(seed=0)
    draw = actions(env.action_space.shape)
    return count, lambda: env.step(draw())


def for_sb3(count: int, threads: int) -> tuple[int, Stepper]:
    """The same as Stable-Baselines3 sees it, which asks for no infos but at an end."""
    env = ThreadedVecEnv(replicate(ResidualBalanceEnv(), count), threads)
    env.reset()
    draw = actions((count, *(env.action_space.shape or ())))
    return count, lambda: env.step(draw())


def processes(count: int) -> tuple[int, Stepper]:
    """Stable-Baselines3's processes, as its users make them."""
    env = make_vec_env(f"poise:{NAME}", n_envs=count, seed=0, vec_env_cls=SubprocVecEnv)
    env.reset()
    draw = actions((count, *(env.action_space.shape or ())))
    return count, lambda: env.step(draw())


def worker(pipe: Connection) -> None:
    """A process of its own with one environment, whose rate it sends whenever it is asked."""
    contestant = single()
    with contextlib.suppress(EOFError):  # nobody asks any more
        while True:
            pipe.send(rate(*contestant))
            pipe.recv()


class Apart:
    """`count` environments in as many processes that share nothing: what the machine has to give.

    Nothing that steps environments on that many cores can be faster, but by doing less.
    """

    def __init__(self, count: int):
        context = multiprocessing.get_context("spawn")
        self.pipes = []
        for _ in range(count):
            ours, theirs = context.Pipe()
            context.Process(target=worker, args=(theirs,), daemon=True).start()
            self.pipes.append(ours)
        self._answers()

    def _answers(self) -> np.ndarray:
        return np.array([pipe.recv() for pipe in self.pipes])

    def rate(self) -> tuple[float, float]:
        """Environment steps per second of all, at the same time."""
        for pipe in self.pipes:
            pipe.send(None)
        rates, cpu = self._answers().T
        return float(rates.sum()), float(cpu.mean())


def actions(shape: tuple[int, ...] | None) -> Callable[[], np.ndarray]:
    """A source of actions."""
    rng = np.random.default_rng(0)
    return lambda: np.clip(rng.normal(0.0, SPREAD, shape), -1.0, 1.0)


def rate(count: int, step: Stepper) -> tuple[float, float]:
    """Environment steps per second, and this process's own CPU time for each [s]."""
    steps, start, cpu = 0, time.perf_counter(), time.process_time()
    while time.perf_counter() - start < SECONDS:
        step()
        steps += count
    return steps / (time.perf_counter() - start), (time.process_time() - cpu) / steps


def memory(count: int) -> float:
    """Resident memory [GB] of a process with `count` vectorised environments that have stepped."""
    code = (
        "import resource, sys, gymnasium, numpy, poise\n"
        f"env = gymnasium.make_vec({NAME!r}, num_envs={count}, threads={THREADS})\n"
        "env.reset(seed=0)\n"
        "for _ in range(50): env.step(numpy.zeros(env.action_space.shape))\n"
        "scale = 1 if sys.platform == 'darwin' else 1024\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * scale)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return int(done.stdout) / 1e9


def main() -> None:
    load = os.getloadavg()[0]
    busy = ": other jobs run, these ratios mean little" if load > 0.5 else ""
    print(f"{CORES} cores, load average {load:.1f} before the start{busy}\n")
    contestants = {
        "1 environment, 1 thread": partial(rate, *single()),
        "16 vectorised, 1 thread": partial(rate, *native(16, 1)),
        f"16 vectorised, {THREADS} threads": partial(rate, *native(16, THREADS)),
        f"16 vectorised for SB3, {THREADS} threads": partial(rate, *for_sb3(16, THREADS)),
        f"64 vectorised, {THREADS} threads": partial(rate, *native(64, THREADS)),
        f"{THREADS} × 1 environment, processes apart": Apart(THREADS).rate,
        f"SubprocVecEnv, {CORES} processes": partial(rate, *processes(CORES)),
    }
    for measure in contestants.values():
        measure()  # warms up
    turns = [[measure() for measure in contestants.values()] for _ in range(ROUNDS)]
    rates, cpu = np.moveaxis(np.array(turns), -1, 0)
    print(
        "| environments | steps/s | over one environment | over SubprocVecEnv | own CPU per step |"
    )
    print("| --- | --- | --- | --- | --- |")
    for k, name in enumerate(contestants):
        print(
            f"| {name} | {np.median(rates[:, k]):.0f} | "
            f"{np.median(rates[:, k] / rates[:, 0]):.2f} | "
            f"{np.median(rates[:, k] / rates[:, -1]):.2f} | {1e6 * np.median(cpu[:, k]):.0f} µs |"
        )
    print(f"\nresident memory with 64 vectorised environments: {memory(64):.2f} GB")


if __name__ == "__main__":
    main()
