"""Robots whose sensors, motors, bodies and ground are drawn, for the tests of envs/sensing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from poise.configs.schema import build
from poise.envs.compiled.calls import run
from poise.envs.sensing.config import EstimatorConfig
from poise.envs.sensing.drawn import DrawnRobot, Plant, draw_robot
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.realism import load_realism
from tests.support.shared import robot

PLAIN = {"motors": {"no_load_speed": 1e9}}  #: not ideal by name, and nothing comes of it

Level = str | Mapping


def drawn_of(level: Level, seed: int = 0) -> DrawnRobot:
    """The tests' robot as a level and a seed have it."""
    return draw_robot(load_realism(level), robot(), np.random.default_rng(seed))


def estimated(level: Level, seed: int = 0, **estimator: object) -> EstimatedState:
    """A source whose simulation is measured and driven by `Simulation.step`."""
    config = build(EstimatorConfig, estimator, "tests")
    source = EstimatedState(Plant(robot()), robot(), config)
    source.simulation.equip(source.drive, source.sense, source.bus)
    start(source, level, seed)
    return source


def start(
    source: EstimatedState,
    level: Level,
    seed: int = 0,
    qpos: np.ndarray | None = None,
    qvel: np.ndarray | None = None,
) -> DrawnRobot:
    """Begin an episode of a source, from a state, with another robot."""
    drawn = drawn_of(level, seed)
    source.plant.become(drawn)
    source.simulation.reset(qpos, qvel)
    source.begin(drawn, np.zeros(robot().model.nu))
    return drawn


def remeasured(source: EstimatedState, name: str, count: int) -> np.ndarray:
    """(count, ...) one kind of measurement, taken again and again without a step of the robot."""
    rings, rows = source.sensors.rings, []
    for _ in range(count):
        run(source.sense)
        rows.append(getattr(rings, name)[rings.next - 1].copy())
    return np.array(rows)
