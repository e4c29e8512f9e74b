"""Trials in which a controller performs a motion from disturbed starts, and may be pushed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.motions.motion import load_motion
from poise.baselines.motions.reference_motion import ReferenceMotion
from poise.configs.errors import ConfigError, shown
from poise.configs.files import packaged
from poise.configs.numbers import whole_number
from poise.envs.balance.episode import FAILURES
from poise.envs.balance.termination import FallLimits
from poise.envs.physics.state import RobotState
from poise.envs.pushes.sampler import LimitTable
from poise.envs.robots.robot import Robot, load_robot
from poise.training.trials.agents import Agent, load_agent
from poise.training.trials.push_limits import load_limits

from .reference import ReferenceBodies, Stance

LAST = 0.5  # [s] of a trial whose error is told apart
COUNTED = 0.5  # [s] after the motion's end until which errors count
AFTER = 3.0  # [s] that a trial goes on after the motion's end: a fall takes its time
PUSH_TIME = 0.1  # [s]
LANDING = 25  # policy steps after which feet of a disturbed start have landed
LONGEST = 600.0  # [s]
LEAN = 30.0  # [deg] beyond the motion's own largest tilt
FALLEN = 0.8  # of the motion's lowest CoM: lower is a fall where the motion itself goes low
ANYWHERE = {"height": 1e-3, "tilt": 180.0}  # limits that never end an episode


@dataclass(frozen=True)
class Followed:
    """How near one trial stayed to the motion, until half a second after its end or a fall.

    Attributes:
        fallen: whether the robot fell.
        joint_rms: root mean square of joint errors [rad].
        body_error: mean distance of the bodies from where the motion has them, on the soles as
            they stand [m] (MPKPE).
        body_error_root: the same, relative to the root body [m].
        body_error_last: `body_error` of the trial's last half second, 2.5 s after the motion's
            end [m].
        slide: largest distance of a sole from where it landed after the disturbed start [m].
        solver_failures: ticks without a solution of the QP.
        push: the push, as an environment takes it; None for none.
    """

    fallen: bool
    joint_rms: float
    body_error: float
    body_error_root: float
    body_error_last: float
    slide: float
    solver_failures: int
    push: dict[str, Any] | None


def follow(
    motion: str | Path | ReferenceMotion,
    controller: str = "momentum-qp",
    *,
    robot: str | Path | Robot = "humanoid",
    starts: int = 20,
    impulse: float = 0.0,
    share: float = 0.0,
    directions: int = 8,
    seed: int = 0,
) -> list[Followed]:
    """Let a controller perform a motion from `starts` disturbed starts.

    A fall is what environments call so, with the motion for standing: more than the feet on the
    ground, a CoM below 0.6 of the motion's height at that time, or a root that leans 90° away from
    the motion's. A trial goes on for 3 s after the motion's end. With an `impulse` [N·s] trial k is
    pushed once at the robot's first push body, in direction 360° k / `directions`, at a random time
    within the motion; the same for every controller. With a `share` the impulse is that share of
    the J50 that the robot's file of limits has for the direction: what momentum-qp stands half of.

    Raises:
        ConfigError: no such motion, controller or robot, one that does not play motions, counts
            below 1, an impulse, a share or a seed below 0, an impulse and a share, a share without
            measured limits.
    """
    for name, count in (("starts", starts), ("directions", directions)):
        whole_number(count, 1, name)
    whole_number(seed, 0, "seed")
    for name, size in (("impulse", impulse), ("share", share)):
        if not 0.0 <= size < np.inf:
            raise ConfigError(f"must be at least 0, not {size:g}", field=name)
    if impulse and share:
        raise ConfigError("give either an impulse or a share of J50", field="share")
    body = robot if isinstance(robot, Robot) else load_robot(robot)
    half = _half(body) if share else None
    reference = load_motion(motion, body)
    period = 0.02
    duration = period * round((min(reference.duration, LONGEST) + AFTER) / period)
    agent = performer(controller, body, reference, duration, ANYWHERE)
    bodies = ReferenceBodies(reference, body)
    rng = np.random.default_rng(seed)
    trials = []
    for k in range(starts):
        start = float(rng.uniform(0.1, 0.9)) * reference.duration
        direction = 360.0 * k / directions % 360.0
        size = impulse if half is None else share * half(direction)
        push = {"impulse": size, "direction": direction, "start": start,
                "duration": PUSH_TIME, "body": _pushed(body)}  # fmt: skip
        trials.append(play(agent, bodies, seed + k, push if size else None))
    return trials


def _half(robot: Robot) -> LimitTable:
    """J50 [N·s] by direction, of 0.1 s pushes; raises ConfigError where none was measured."""
    table = load_limits(robot).table
    if table is None:
        raise ConfigError(f"no J50 of {robot.name!r} was measured: give an impulse", field="share",
                          choices=packaged("limits"))  # fmt: skip
    return table


def play(
    agent: Agent, reference: ReferenceBodies, seed: int, push: dict[str, Any] | None
) -> Followed:
    """One trial of an agent that has the motion in its environment."""
    env = agent.env
    observation, _ = env.reset(seed=seed, options={"push": [] if push is None else [push]})
    if agent.begin is not None:
        agent.begin()
    state, footing = env.simulation.state, Footing(env.simulation.state)
    errors: list[tuple[float, float, float]] = []
    done = fallen = False
    while not done:
        _, terminated, truncated = env.step_without_info(agent.act(observation))
        observation = env.episode.observation.astype(np.float32)
        footing.update(state)
        fallen = bool(env.fallen) or lies(env, reference)
        done = terminated or truncated or fallen
        if not fallen:
            errors.append(_errors(env, reference, footing.stance))
    table, period = np.array(errors).reshape(-1, 3), env.config.policy_period
    last = table[-round(LAST / period) :]
    table = table[: round((reference.motion.duration + COUNTED) / period)]
    if not len(table):
        table = last = np.full((1, 3), np.nan)
    return Followed(
        fallen,
        float(np.sqrt(table[:, 0].mean())),
        float(table[:, 1].mean()),
        float(table[:, 2].mean()),
        float(last[:, 1].mean()),
        footing.slide,
        int(env.episode.metrics[FAILURES]),
        push,
    )


class Footing:
    """The stance of a robot's feet, and how far they have moved.

    Attributes:
        stance: of the soles now, or when both were last on the ground.
        slide: largest distance of a sole from where it landed [m].
    """

    def __init__(self, state: RobotState):
        self.stance, self.slide = Stance.of(state), 0.0
        self._landed: np.ndarray | None = None
        self._steps = 0

    def update(self, state: RobotState) -> None:
        """Call it after every policy step."""
        self._steps += 1
        if np.all(state.contacts > 0.0):
            self.stance = Stance.of(state)
        if self._landed is None and self._steps >= LANDING:
            self._landed = state.sole_points.copy()
        if self._landed is not None:
            ways = np.linalg.norm((state.sole_points - self._landed)[:, :2], axis=1)
            self.slide = max(self.slide, float(ways.max()))


def lies(env: Any, reference: ReferenceBodies) -> bool:
    """True if the CoM is too low or the root leans too far for the motion at this time."""
    state, limits = env.simulation.state, FallLimits()
    sample = reference.motion.sample(env.simulation.time)
    low = state.com[2] - state.origin[2] < limits.height * sample.com_offset[2]
    robot = env.simulation.arrays
    wanted = Rotation.from_rotvec(sample.root).as_matrix() @ robot.root_standing
    # the vertical as the root sees it, and as it is to see it: whatever the yaw
    leaning = state.root_axes[2] @ wanted[2] < np.cos(np.radians(limits.tilt))
    return bool(low or leaning)


def _errors(env: Any, reference: ReferenceBodies, stance: Stance) -> tuple[float, float, float]:
    """Mean square of the joints, mean distance of the bodies, the same relative to the root."""
    joints, places = reference.at(env.simulation.time, stance)
    now = env.simulation.data.xpos[reference.bodies]
    root = int(np.searchsorted(reference.bodies, reference.robot.root_body_id))
    gap = now - places
    return (
        float(np.mean((env.simulation.data.qpos[7:] - joints) ** 2)),
        float(np.linalg.norm(gap, axis=1).mean()),
        float(np.linalg.norm(gap - gap[root], axis=1).mean()),
    )


def performer(
    controller: str,
    robot: Robot,
    motion: ReferenceMotion,
    duration: float,
    fall: Mapping[str, float] | None = None,
) -> Agent:
    """An agent that performs a motion for `duration` [s].

    `fall` are its `FallLimits`; by default lower than the motion ever is, or further from upright.

    Raises:
        ConfigError: no such controller, or one that plays no motions.
    """
    fall = fall or fall_limits(motion, robot)
    given = {"motion": motion, "pushes": None, "duration": duration, "fall": fall}
    try:
        return load_agent(controller, robot, **given)
    except TypeError:
        raise ConfigError(
            f"{shown(controller)} follows no motion: name a controller that tracks a reference, "
            "or a policy on one", field="controller",
        ) from None  # fmt: skip


def fall_limits(motion: ReferenceMotion, robot: Robot) -> dict[str, float]:
    """`FallLimits` that a robot does not reach which performs this motion."""
    samples = [motion.sample(time) for time in np.arange(0.0, motion.duration, 0.05)]
    upright = min(Rotation.from_rotvec(sample.root).as_matrix()[2, 2] for sample in samples)
    tilt = float(np.degrees(np.arccos(np.clip(upright, -1.0, 1.0))))
    low = min(float(sample.com_offset[2]) for sample in samples)
    return {"height": min(FallLimits().height, FALLEN * low / robot.height_com),
            "tilt": min(max(FallLimits().tilt, tilt + LEAN), 180.0)}  # fmt: skip


def _pushed(robot: Robot) -> str:
    bodies = robot.description.push_bodies
    return bodies[0] if bodies else robot.description.root
