"""A million steps of nonsense in each environment: `python -m tests.endurance.million`.

Every episode has one of four kinds: random actions, bang-bang (all at a bound, changing sides at
random), drops (from up to 1 m, turned), spins (up to 20 rad/s). The bar: no NaN, no exception, each
observation in its space, memory that does not grow.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import poise  # noqa: F401  registers the environments

IDS = (
    "poise/TorqueBalance-v0", "poise/PositionBalance-v0",
    "poise/ResidualBalance-v0", "poise/ResidualStep-v0", "poise/ResidualWalk-v0",
    "poise/ResidualWhole-v0", "poise/Velocity-v0",
)  # fmt: skip
#: what else an environment is made with, by a name for the table
SETTINGS: dict[str, dict[str, Any]] = {
    level: {"realism": level} for level in ("ideal", "lab", "field", "late")
}
KINDS = ("random", "bang-bang", "drop", "spin")
WARM, GROWTH = 0.1, 20.0  # fraction of the steps before memory counts; [MiB] that it may grow


def main(arguments: list[str] | None = None) -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--steps", type=int, default=1_000_000)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--only", nargs="*", choices=IDS, default=[])
    options.add_argument("--levels", nargs="*", choices=list(SETTINGS), default=[])
    given = options.parse_args(arguments)
    print(
        "| environment | setting | steps | episodes | NaN | exceptions | outside | MiB | seconds |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    missed = [
        _run(name, setting, given.steps, np.random.default_rng(given.seed))
        for name in given.only or IDS
        for setting in given.levels or SETTINGS
    ]
    return 1 if any(missed) else 0


def _run(name: str, setting: str, steps: int, rng: np.random.Generator) -> bool:
    """Prints a row; whether the bar is missed."""
    env = gymnasium.make(name, disable_env_checker=True, **SETTINGS[setting])
    start, done = time.monotonic(), True
    count = {"episodes": 0, "nan": 0, "exceptions": 0, "outside": 0}
    first = memory()
    for step in range(steps):
        if step == int(WARM * steps):
            first = memory()
        if step and step % (steps // 10) == 0:
            told = f"{name}, {setting}: {step:,} steps, {time.monotonic() - start:.0f} s"
            print(told, file=sys.stderr, flush=True)
        try:
            if done:
                kind = KINDS[count["episodes"] % len(KINDS)]
                observation, _ = env.reset(seed=int(rng.integers(2**31)), options=None)
                _disturb(env.unwrapped, kind, rng)
                count["episodes"] += 1
                signs = np.ones_like(env.action_space.high)
            if kind == "bang-bang":
                signs = np.where(rng.random(signs.shape) < 0.1, -signs, signs)
                action = np.where(signs > 0, env.action_space.high, env.action_space.low)
            else:
                low, high = env.action_space.low, env.action_space.high
                action = rng.uniform(low, high).astype(np.float32)
            observation, reward, terminated, truncated, _ = env.step(action)
            done = terminated or truncated
            count["nan"] += not (np.isfinite(observation).all() and np.isfinite(reward))
            count["outside"] += observation not in env.observation_space
        except Exception as error:
            count["exceptions"] += 1
            print(f"{name}, {kind}: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
            done = True
    grown = memory() - first
    env.close()
    figures = [f"{number:,}" for number in (steps, *count.values())]
    figures += [f"{first:.0f} → {first + grown:.0f}", f"{time.monotonic() - start:.0f}"]
    print("|", " | ".join([name, setting, *figures]), "|", flush=True)
    return bool(count["nan"] + count["exceptions"] + count["outside"]) or grown > GROWTH


def _disturb(env: Any, kind: str, rng: np.random.Generator) -> None:
    """Put the robot where no episode begins."""
    if kind not in ("drop", "spin"):
        return
    simulation = env.simulation
    qpos, qvel = simulation.data.qpos.copy(), simulation.data.qvel.copy()
    if kind == "drop":
        qpos[2] += rng.uniform(0.0, 1.0)
        turn = rng.normal(size=4)
        qpos[3:7] = turn / np.linalg.norm(turn)
    else:
        qvel[3:6] = rng.uniform(-20.0, 20.0, 3)
        qvel[6:] += rng.uniform(-20.0, 20.0, len(qvel) - 6)
    simulation.reset(qpos, qvel)


def memory() -> float:
    """What this process holds now [MiB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 2**20


if __name__ == "__main__":
    sys.exit(main())
