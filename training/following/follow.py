"""Trials in which a controller performs a motion from disturbed starts, and may be pushed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.motions.motion import load_motion
from poise.baselines.motions.reference_motion import ReferenceMotion
from poise.configs.errors import ConfigError, shown
from poise.configs.numbers import whole_number
from poise.envs.balance.episode import FAILURES
from poise.envs.balance.termination import FallLimits
from poise.envs.robots.robot import Robot, load_robot
from poise.training.trials.agents import Agent, load_agent

from .reference import ReferenceBodies, Stance

LAST = 0.5  # [s] of a trial whose error is told apart
AFTER = 0.5  # [s] that a trial goes on after the motion's end
PUSH_TIME = 0.1  # [s]
LONGEST = 600.0  # [s]
LEAN = 30.0  # [deg] beyond the motion's own largest tilt
FALLEN = 0.8  # of the motion's lowest CoM: lower is a fall where the motion itself goes low


@dataclass(frozen=True)
class Followed:
    """How near one trial stayed to the motion, until it ended or fell.

    Attributes:
        fallen: whether the robot fell.
        joint_rms: root mean square of joint errors [rad].
        body_error: mean distance of the bodies from where the motion has them, the soles being
            where they were at the start [m] (MPKPE, global).
        body_error_root: the same, relative to the root body [m].
        body_error_last: `body_error` of the last half second [m].
        solver_failures: ticks without a solution of the QP.
        push: the push, as an environment takes it; None for none.
    """

    fallen: bool
    joint_rms: float
    body_error: float
    body_error_root: float
    body_error_last: float
    solver_failures: int
    push: dict[str, Any] | None


def follow(
    motion: str | Path | ReferenceMotion,
    controller: str = "momentum-qp",
    *,
    robot: str | Path | Robot = "humanoid",
    starts: int = 20,
    impulse: float = 0.0,
    directions: int = 8,
    seed: int = 0,
) -> list[Followed]:
    """Let a controller perform a motion from `starts` disturbed starts.

    A fall is what environments call so, but for a motion that itself goes low or bends over: then
    it is a CoM below 0.8 of the motion's lowest, a tilt 30° beyond its largest. With an `impulse`
    [N·s] trial k is pushed once at the robot's first push body, in direction 360° k /
    `directions`, at a random time within the motion; the same for every controller.

    Raises:
        ConfigError: no such motion, controller or robot, one that does not play motions, counts
            below 1, an impulse or a seed below 0.
    """
    for name, count in (("starts", starts), ("directions", directions)):
        whole_number(count, 1, name)
    whole_number(seed, 0, "seed")
    if not 0.0 <= impulse < np.inf:
        raise ConfigError(f"must be at least 0, not {impulse:g}", field="impulse")
    body = robot if isinstance(robot, Robot) else load_robot(robot)
    reference = load_motion(motion, body)
    period = 0.02
    duration = period * round((min(reference.duration, LONGEST) + AFTER) / period)
    agent = performer(controller, body, reference, duration)
    bodies = ReferenceBodies(reference, body)
    rng = np.random.default_rng(seed)
    trials = []
    for k in range(starts):
        start = float(rng.uniform(0.1, 0.9)) * reference.duration
        push = {"impulse": impulse, "direction": 360.0 * k / directions % 360.0, "start": start,
                "duration": PUSH_TIME, "body": _pushed(body)}  # fmt: skip
        trials.append(play(agent, bodies, seed + k, push if impulse else None))
    return trials


def play(
    agent: Agent, reference: ReferenceBodies, seed: int, push: dict[str, Any] | None
) -> Followed:
    """One trial of an agent that has the motion in its environment."""
    env = agent.env
    observation, _ = env.reset(seed=seed, options={"push": [] if push is None else [push]})
    if agent.begin is not None:
        agent.begin()
    state = env.simulation.state
    stance = Stance(state.origin.copy(), state.heading.copy())
    errors: list[tuple[float, float, float]] = []
    done = False
    while not done:
        _, terminated, truncated = env.step_without_info(agent.act(observation))
        observation, done = env.episode.observation.astype(np.float32), terminated or truncated
        if not env.fallen:
            errors.append(_errors(env, reference, stance))
    table = np.array(errors).reshape(-1, 3)
    last = table[-round(LAST / env.config.policy_period) :]
    if not len(table):
        table = last = np.full((1, 3), np.nan)
    return Followed(
        bool(env.fallen),
        float(np.sqrt(table[:, 0].mean())),
        float(table[:, 1].mean()),
        float(table[:, 2].mean()),
        float(last[:, 1].mean()),
        int(env.episode.metrics[FAILURES]),
        push,
    )


def _errors(env: Any, reference: ReferenceBodies, stance: Stance) -> tuple[float, float, float]:
    """Mean square of the joints, mean distance of the bodies, the same relative to the root."""
    joints, places = reference.at(env.simulation.time)
    places = stance.placed(places)
    now = env.simulation.data.xpos[reference.bodies]
    root = int(np.searchsorted(reference.bodies, reference.robot.root_body_id))
    gap = now - places
    return (
        float(np.mean((env.simulation.data.qpos[7:] - joints) ** 2)),
        float(np.linalg.norm(gap, axis=1).mean()),
        float(np.linalg.norm(gap - gap[root], axis=1).mean()),
    )


def performer(controller: str, robot: Robot, motion: ReferenceMotion, duration: float) -> Agent:
    """An agent that performs a motion for `duration` [s]; a fall is what `follow` calls so.

    Raises:
        ConfigError: no such controller, or one that plays no motions.
    """
    low, tilt = _extremes(motion)
    fall = {"height": min(FallLimits().height, FALLEN * low / robot.height_com),
            "tilt": min(max(FallLimits().tilt, tilt + LEAN), 180.0)}  # fmt: skip
    given = {"motion": motion, "pushes": None, "duration": duration, "fall": fall}
    try:
        return load_agent(controller, robot, **given)
    except TypeError:
        raise ConfigError(
            f"{shown(controller)} follows no motion: name a controller that tracks a reference, "
            "or a policy on one", field="controller",
        ) from None  # fmt: skip


def _extremes(motion: ReferenceMotion) -> tuple[float, float]:
    """Least height of the motion's CoM above the soles [m], largest tilt of its root [deg]."""
    samples = [motion.sample(time) for time in np.arange(0.0, motion.duration, 0.05)]
    turned = [Rotation.from_rotvec(sample.root).as_matrix()[2, 2] for sample in samples]
    low = min(float(sample.com_offset[2]) for sample in samples)
    return low, float(np.degrees(np.arccos(np.clip(min(turned), -1.0, 1.0))))


def _pushed(robot: Robot) -> str:
    bodies = robot.description.push_bodies
    return bodies[0] if bodies else robot.description.root
