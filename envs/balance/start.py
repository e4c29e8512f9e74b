"""The start of an episode: a disturbed standing posture, and the pushes that will come."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.numbers import finite_array, option_mapping, whole_number
from poise.envs.physics.pushes.options import parse_pushes
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.physics.pushes.sampler import PushSampler
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .fallen import fallen_posture

FALLEN_POSTURES = 512  #: from which training episodes begin; an evaluation has others
RESET_OPTIONS = ("push", "noise", "qpos", "qvel", "fallen", "realism")


@dataclass(frozen=True)
class StartNoise:
    """The range in which a reset departs from the standing posture; uniform in ±.

    Attributes:
        joints: Largest departure of a joint at a reset [rad].
        joint_speeds: Largest speed of a joint at a reset [rad/s].
        speed: Largest horizontal speed of the root at a reset [m/s].
    """

    joints: float = field(default=0.02, metadata={"min": 0.0, "max": 0.5})
    joint_speeds: float = field(default=0.05, metadata={"min": 0.0})
    speed: float = field(default=0.02, metadata={"min": 0.0})


def disturbed_start(
    simulation: Simulation, noise: StartNoise, scale: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """A standing posture (nq,) with its lowest sole on the ground, and its velocity (nv,).

    Both are disturbed by `scale` times `noise`. The simulation is reset to find the lowest sole.
    """
    robot = simulation.robot
    qpos, qvel = robot.standing_qpos.copy(), np.zeros(robot.model.nv)
    nj = len(robot.joint_names)
    qpos[7:] += scale * rng.uniform(-noise.joints, noise.joints, nj)
    qpos[7:] = np.clip(qpos[7:], robot.joint_range[:, 0], robot.joint_range[:, 1])
    qvel[6:] = scale * rng.uniform(-noise.joint_speeds, noise.joint_speeds, nj)
    qvel[:2] = scale * rng.uniform(-noise.speed, noise.speed, 2)
    state = simulation.reset(qpos)
    lowest = min(
        float((point + polygon @ axes[:, :2].T)[:, 2].min())
        for point, axes, polygon in zip(
            state.sole_points, state.sole_axes, (s.polygon for s in robot.soles), strict=True
        )
    )
    qpos[2] -= lowest
    return qpos, qvel


def reset_options(options: object, known: Sequence[str] = RESET_OPTIONS) -> dict[str, Any]:
    """Return the options of a reset, all of which are among `known`; {} for None.

    Raises ConfigError naming the option that is unknown, and what there is.
    """
    chosen = option_mapping(options)
    for name in chosen:
        if name not in known:
            raise ConfigError("unknown option", source="reset", field=str(name), choices=known)
    return chosen


def chosen_start(
    simulation: Simulation,
    noise: StartNoise,
    fallen: float,
    options: Mapping[str, Any],
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the start (nq,), (nv,) of `options`, disturbed where these do not say it.

    Without options it is on the ground with probability `fallen`, in one of `FALLEN_POSTURES`.

    Raises ConfigError for "noise", "qpos" or "qvel" that are no finite numbers of their shape, and
    for a "fallen" that is no whole number from 0 on.
    """
    number = options.get("fallen")
    if number is None and fallen > 0.0 and rng.uniform() < fallen:
        number = int(rng.integers(FALLEN_POSTURES))
    if number is None:
        scale = float(_numbers(options.get("noise", 1.0), (), "noise"))
        qpos, qvel = disturbed_start(simulation, noise, scale, rng)
    else:
        number = whole_number(number, 0, "fallen", "reset")
        qpos = fallen_posture(simulation.robot, number)
        qvel = np.zeros(simulation.model.nv)
    start = {"qpos": qpos, "qvel": qvel}
    for name, numbers in start.items():
        if options.get(name) is not None:
            start[name] = _numbers(options[name], numbers.shape, name)
    return start["qpos"], start["qvel"]


def chosen_pushes(
    given: object,
    sampler: PushSampler | None,
    robot: Robot,
    state: RobotState,
    rng: np.random.Generator,
) -> tuple[Push | Kick, ...]:
    """Return the pushes that are `given`, else those that `sampler` draws; without either none.

    Raises ConfigError as `parse_pushes` does.
    """
    if given is not None:
        return parse_pushes(given, robot, state.support_margin)
    if sampler is None:
        return ()
    return sampler.sample(rng, robot, state.support_margin)


def _numbers(value: object, shape: tuple[int, ...], name: str) -> np.ndarray:
    numbers = finite_array(value, shape)
    if numbers is None:
        expected = f"{shape[0]} finite numbers" if shape else "a finite number"
        raise ConfigError(f"must be {expected}", source="reset", field=name)
    return numbers
