"""Tuning a controller's gains by CMA-ES on seeded pushes.

Candidates of one generation meet the same pushes; every generation draws new ones, so that
gains are not fitted to a few trials. Needs the `cma` package (`pip install poise[dev]`).
"""

import json
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.momentum_qp import MomentumQP, MomentumQPConfig
from poise.baselines.residual_balance import ResidualBalanceEnv
from poise.envs.config import to_yaml, write_atomic
from poise.envs.episode import MAX_SLIDE
from poise.envs.push_schedule import push_bodies
from poise.envs.pushes import Push
from poise.envs.robot import Robot, load_robot

from .trials import STEP_LENGTH


@dataclass(frozen=True)
class Gain:
    """One number of the configuration: `section.name`, searched on a log or a linear scale."""

    path: str
    low: float
    high: float
    log: bool = True

    def value(self, unit: float) -> float:
        """From the search's [0, 1] to the gain."""
        if self.log:
            return float(self.low * (self.high / self.low) ** unit)
        return float(self.low + (self.high - self.low) * unit)

    def unit(self, value: float) -> float:
        """From a gain to [0, 1]."""
        value = min(max(value, self.low), self.high)
        if self.log:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return float((value - self.low) / (self.high - self.low))


GAINS = (
    Gain("posture.trunk_weight", 0.03, 100.0),
    Gain("posture.free_weight", 0.003, 10.0),
    Gain("posture.root_weight", 0.03, 100.0),
    Gain("posture.stiffness", 0.5, 60.0),
    Gain("posture.free_stiffness", 0.3, 60.0),
    Gain("posture.root_stiffness", 0.3, 60.0),
    Gain("posture.damping_ratio", 0.3, 8.0),
    Gain("posture.far_share", 1e-4, 1.0),
    Gain("posture.far_distance", 0.003, 0.3),
    Gain("com.weight", 10.0, 1e6),
    Gain("com.height_weight", 10.0, 1e6),
    Gain("com.stiffness", 0.2, 12.0),
    Gain("com.height_stiffness", 0.5, 20.0),
    Gain("com.damping_ratio", 0.4, 3.0),
    Gain("com.offset", -0.06, 0.06, log=False),
    Gain("cop.weight", 1e-3, 1e4),
    Gain("cop.yaw_weight", 1e-3, 1e3),
    Gain("cop.stiffness", 0.3, 1e4),
    Gain("cop.damping", 0.01, 100.0),
    Gain("cop.horizon", 0.005, 0.5),
    Gain("cop.angular_damping", 0.0, 5.0, log=False),
    Gain("contact.damping", 0.5, 60.0),
    Gain("contact.polygon_share", 0.6, 1.0, log=False),
    Gain("contact.friction_share", 0.5, 1.0, log=False),
    Gain("contact.force_weight", 1e-5, 10.0),
    Gain("contact.moment_weight", 1e-5, 10.0),
    Gain("torque.weight", 1e-6, 10.0),
    Gain("joint.brake", 0.5, 30.0),
    Gain("joint.horizon", 0.03, 1.0),
    Gain("joint.floor", 2.0, 100.0),
)


SIZE = 113.7  # [N·s] m √(g h) of the humanoid


@dataclass(frozen=True)
class TuningPushes:
    """Half a circle of directions (the robot is symmetric) times a ladder of impulses.

    Impulses [N·s] are scaled by the robot's m √(g h) over `SIZE`, and push the first of its
    `push_bodies`.
    """

    directions: int = 9
    impulses: tuple[float, ...] = (11.0, 13.0, 15.0, 17.0, 19.0, 21.0, 23.0, 25.0)
    duration: float = 0.1
    seconds: float = 5.0

    def draw(self, seed: int, robot: Robot) -> list[list[Push]]:
        """A row per direction; impulses and directions are jittered within their steps."""
        rng = np.random.default_rng(seed)
        size = robot.mass * np.sqrt(-robot.model.opt.gravity[2] * robot.height_com) / SIZE
        body = push_bodies(robot)[0]
        gap = np.diff(self.impulses, append=2 * self.impulses[-1] - self.impulses[-2])
        rows = []
        for angle in np.linspace(0.0, 180.0, self.directions):
            turned = angle + rng.uniform(-8.0, 8.0)
            jitter = rng.uniform(-0.5, 0.5, len(self.impulses)) * gap
            rows.append(
                [
                    Push(body, 0.5, self.duration, float(j), float(turned))
                    for j in size * (np.asarray(self.impulses) + jitter)
                ]
            )
        return rows


def set_gains(
    config: MomentumQPConfig, gains: Sequence[Gain], units: np.ndarray
) -> MomentumQPConfig:
    """`config` with the gains at the search's coordinates."""
    for gain, unit in zip(gains, units, strict=True):
        section, name = gain.path.split(".")
        part = replace(getattr(config, section), **{name: gain.value(float(unit))})
        config = replace(config, **{section: part})
    return config


def score(env: ResidualBalanceEnv, config: MomentumQPConfig, rows: list[list[Push]], seed: int):
    """Mean over directions of the impulse recovered [N·s, of the ladder before it is scaled to the
    robot], plus half of the worst; and the detail.

    A trial that fell counts for at most 0.3 by how long it stood, one that is not quiet, or that
    dragged a foot further than `STEP_LENGTH`, 0.6.
    """
    env.controller = MomentumQP(env.robot, config)
    action = np.zeros(env.action_space.shape)
    step = 2.0  # [N·s] between two impulses of the ladder
    reached = []
    for d, row in enumerate(rows):
        total = 10.0  # below the ladder everything is recovered
        for i, push in enumerate(row):
            env.reset(seed=seed + 1000 * d + i, options={"push": [push]})
            terminated = truncated = False
            while not (terminated or truncated):
                _, _, terminated, truncated, _ = env.step(action)
            if truncated:
                in_place = env.episode.metrics[MAX_SLIDE] <= STEP_LENGTH
                value = 1.0 if env.recovered and in_place else 0.6
            else:
                value = 0.3 * env.steps / env.max_steps
            total += value * step
            if terminated and i + 1 < len(row) and env.steps < 0.3 * env.max_steps:
                break  # larger pushes fall faster
        reached.append(total)
    return float(np.mean(reached) + 0.5 * np.min(reached)), reached


_ENV: ResidualBalanceEnv | None = None


def _work(arguments: tuple[MomentumQPConfig, TuningPushes, str, int]):
    global _ENV
    config, pushes, robot, seed = arguments
    if _ENV is None:
        _ENV = ResidualBalanceEnv(robot, duration=pushes.seconds, pushes=None)
    return score(_ENV, config, pushes.draw(seed, _ENV.robot), seed)


@dataclass(frozen=True)
class Tuning:
    """Budget and seed of a search."""

    start: MomentumQPConfig = field(default_factory=MomentumQPConfig)
    robot: str = "humanoid"
    pushes: TuningPushes = field(default_factory=TuningPushes)
    generations: int = 60
    population: int = 14
    spread: float = 0.15
    seed: int = 0
    workers: int = 2


def tune(tuning: Tuning, out: Path, report: Callable[[str], Any] = print) -> MomentumQPConfig:
    """Search; writes `out/gains.yaml` (mean of the search) and `out/history.jsonl` as it goes."""
    import cma

    load_robot(tuning.robot)
    mean = np.array(
        [
            gain.unit(
                getattr(getattr(tuning.start, gain.path.split(".")[0]), gain.path.split(".")[1])
            )
            for gain in GAINS
        ]
    )
    search = cma.CMAEvolutionStrategy(
        mean, tuning.spread,
        {"bounds": [0, 1], "popsize": tuning.population, "seed": tuning.seed + 1, "verbose": -9},
    )  # fmt: skip
    history = []
    best = tuning.start
    with ProcessPoolExecutor(tuning.workers) as pool:
        for generation in range(tuning.generations):
            units = search.ask()
            configs = [set_gains(tuning.start, GAINS, u) for u in units]
            centre = set_gains(tuning.start, GAINS, np.clip(search.mean, 0.0, 1.0))
            seed = tuning.seed + 100_000 * (generation + 1)
            jobs = [(c, tuning.pushes, tuning.robot, seed) for c in [*configs, centre]]
            results = list(pool.map(_work, jobs))
            search.tell(units, [-value for value, _ in results[:-1]])
            best = set_gains(tuning.start, GAINS, np.clip(search.mean, 0.0, 1.0))
            row = {
                "generation": generation,
                "centre": results[-1][0],
                "best": max(value for value, _ in results[:-1]),
                "reached": np.round(results[-1][1], 2).tolist(),
                "gains": {
                    g.path: round(g.value(u), 5)
                    for g, u in zip(GAINS, np.clip(search.mean, 0, 1), strict=True)
                },
            }
            history.append(row)
            report(
                f"{generation} centre {row['centre']:.2f} best {row['best']:.2f} {row['reached']}"
            )
            write_atomic(out / "gains.yaml", to_yaml(best))
            write_atomic(out / "history.jsonl", "".join(json.dumps(r) + "\n" for r in history))
    return best
