"""Trials in which a controller performs a motion from disturbed starts, and may be pushed."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.reference_motion import ReferenceMotion, WalkCommand
from poise.baselines.balance.references.tempo import Tempo
from poise.configs.errors import ConfigError
from poise.configs.numbers import whole_number
from poise.configs.problems import out_of_range
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.mdp.termination import FallLimits
from poise.envs.physics.engines.config import load_physics
from poise.envs.physics.engines.engine import check_engine
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.sensing.realism import load_realism
from poise.training.benchmarking.trials.agents import (
    Agent,
    can_follow,
    follows_no_motion,
    load_agent,
)
from poise.training.benchmarking.trials.jobs import ANYWHERE, LONGEST
from poise.training.benchmarking.trials.play import Watch, run_trial
from poise.training.benchmarking.trials.push_limits import load_limits
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.motion.tracking.record import TrackingFigures

from .footsteps import Steps

PUSH_TIME = 0.1  # [s]
LITTLE = 0.2  # [m, rad]
LEAN = 30.0  # [deg] beyond the motion's own largest tilt
FALLEN = 0.8  # of the motion's lowest CoM: lower is a fall where the motion itself goes low


@dataclass(frozen=True)
class Followed(TrackingFigures):
    """How near one trial stayed to the motion, until half a second after its end or a fall."""

    fallen: bool  #: whether the robot fell
    solver_failures: int  #: ticks without a solution of the QP
    push: dict[str, Any] | None  #: as an environment takes it; None for none
    #: distance walked along the heading over the commanded distance, during the clip; NaN if
    #: that is less than 0.2 m
    walked: float = np.nan
    turned: float = np.nan  #: the same of the turn; NaN if less than 0.2 rad is commanded
    #: from here on as of `Footsteps`; NaN of a motion without steps
    footsteps: float = np.nan
    footsteps_kept: float = np.nan
    footstep_delay: float = np.nan
    footstep_place: float = np.nan


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
    speed: float = 1.0,
    tempo: Tempo | None = None,
    watch: Callable[[Trial], Watch | None] | None = None,
    patient: bool = True,
    realism: str | Path | None = None,
    physics: str | Path | None = None,
) -> list[Followed]:
    """Let a controller perform a motion from `starts` disturbed starts.

    A fall is what environments call so, with the motion for standing: more than the feet on the
    ground, a CoM below 0.6 of the motion's height at that time, or a root that leans 90° away from
    the motion's. A trial goes on for 3 s after the motion's end, and for 6 s after the push. With
    an `impulse` [N·s] trial k is pushed once at the robot's first push body, in direction
    360° k / `directions`, at a random time within the motion; the same for every controller. With a
    `share` the impulse is that share of the J50 that the robot's file of limits has for the
    direction: what momentum-qp stands half of.

    The motion runs `speed` times as fast, and waits as `tempo` defines. `watch(trial)` returns
    what is called with the environment after the reset and after every step. Without
    `patient` the first fall ends the trials. `realism` is a level, by name or file;
    `physics` the engine, by name or file.

    Raises:
        ConfigError: no such motion, controller, robot or engine, a robot that the engine does not
            hold, a controller that does not play motions, counts below 1, an impulse, a share or a
            seed below 0, an impulse and a share, a share without measured limits, a speed that is
            not from 0.1 to 10.
    """
    if not 0.1 <= speed <= 10.0:
        raise out_of_range(speed, field="tempo", least=0.1, most=10, form="g")
    for name, count in (("starts", starts), ("directions", directions)):
        whole_number(count, 1, name)
    whole_number(seed, 0, "seed")
    for name, size in (("impulse", impulse), ("share", share)):
        if not 0.0 <= size < np.inf:
            raise out_of_range(size, field=name, least=0, form="g")
    if impulse and share:
        raise ConfigError("give either an impulse or a share of J50", field="share")
    body = robot if isinstance(robot, Robot) else load_robot(robot)
    check_engine(load_physics(physics), body)
    half = load_limits(body).j50() if share else None
    reference = load_motion(motion, body)
    reference = reference if speed == 1.0 else reference.at_speed(speed)
    agent = performer(controller, body, reference, LONGEST, ANYWHERE, tempo, realism, physics)
    rng = np.random.default_rng(seed)
    trials = []
    for k in range(starts):
        start = float(rng.uniform(0.1, 0.9)) * reference.duration
        direction = 360.0 * k / directions % 360.0
        size = impulse if half is None else share * half(direction)
        push = Push(push_bodies(body)[0], start, PUSH_TIME, size, direction)
        pushes = (push,) if size else ()
        trial = Trial(k, seed + k, pushes, motion=reference.name)
        steps = Steps(reference, None if watch is None else watch(trial))
        course = FollowedWalk(reference.commands, steps)
        followed = _followed(run_trial(agent, trial, course), trial)
        walked, turned = course.shares()
        number, kept, delay, place = steps.figures()
        trials.append(replace(
            followed, walked=walked, turned=turned, footsteps=number, footsteps_kept=kept,
            footstep_delay=delay, footstep_place=place,
        ))  # fmt: skip
        if trials[-1].fallen and not patient:
            break
    return trials


class FollowedWalk:
    """Path of a robot while a walk is commanded: a `Watch` that also calls another."""

    def __init__(self, commands: np.ndarray | None, other: Watch | None = None):
        self._commands, self._other = commands, other
        self._gone: list[tuple[float, float, float]] = []

    def __call__(self, env: BalanceEnv) -> object:
        commands, time = self._commands, env.simulation.time
        starts = None if commands is None else np.asarray(WalkCommand(*commands.T).start)
        if starts is not None and starts[1] <= time <= starts[-1]:
            state = env.simulation.state
            heading = np.arctan2(state.heading[1], state.heading[0])
            self._gone.append((*state.com[:2], heading))
        return None if self._other is None else self._other(env)

    def shares(self) -> tuple[float, float]:
        """`walked` and `turned` of `Followed`."""
        if self._commands is None or len(self._gone) < 2:
            return np.nan, np.nan
        gone, commands = np.array(self._gone), self._commands[1:]
        yaw = np.unwrap(gone[:, 2])
        axes = np.column_stack([np.cos(yaw), np.sin(yaw)])[1:]
        way = float((np.diff(gone[:, :2], axis=0) * axes).sum())
        start, ahead, _, turn, _ = WalkCommand(*commands.T)
        asked = np.diff(start) @ np.stack([ahead, turn], axis=1)[:-1]
        done = np.array([way, yaw[-1] - yaw[0]])
        shares = np.where(np.abs(asked) > LITTLE, done / np.where(asked == 0.0, 1.0, asked), np.nan)
        return float(shares[0]), float(shares[1])


def _followed(outcome: Outcome, trial: Trial) -> Followed:
    """Return the figures of a finished trial."""
    names = TrackingFigures.__dataclass_fields__
    values = {name: getattr(outcome, name) for name in names}
    return Followed(
        **{name: np.nan if value is None else value for name, value in values.items()},
        fallen=outcome.fallen,
        solver_failures=outcome.solver_failures,
        push=None if trial.push is None else asdict(trial.push),
    )


def performer(
    controller: str,
    robot: Robot,
    motion: ReferenceMotion,
    duration: float,
    fall: Mapping[str, float] | None = None,
    tempo: Tempo | None = None,
    realism: str | Path | None = None,
    physics: str | Path | None = None,
) -> Agent:
    """Return an agent that performs a motion for `duration` [s], whose time runs as `tempo` says.

    `fall` are its `FallLimits`; by default lower than the motion ever is, or further from upright.

    Raises:
        ConfigError: no such controller, or one that plays no motions.
    """
    fall = fall or fall_limits(motion, robot)
    given: dict[str, Any] = {"motion": motion, "pushes": None, "duration": duration, "fall": fall}
    given |= {} if tempo is None else {"tempo": tempo}
    given |= {} if realism is None else {"realism": load_realism(realism)}
    given |= {} if physics is None else {"physics": load_physics(physics)}
    try:
        agent = load_agent(controller, robot, **given)
    except TypeError:
        raise follows_no_motion(controller) from None
    if not can_follow(agent):
        raise follows_no_motion(controller)
    return agent


def fall_limits(motion: ReferenceMotion, robot: Robot) -> dict[str, float]:
    """`FallLimits` that a robot does not reach which performs this motion."""
    samples = [motion.sample(time) for time in np.arange(0.0, motion.duration, 0.05)]
    upright = min(Rotation.from_rotvec(sample.root).as_matrix()[2, 2] for sample in samples)
    tilt = float(np.degrees(np.arccos(np.clip(upright, -1.0, 1.0))))
    low = min(float(sample.com_offset[2]) for sample in samples)
    return {"height": min(FallLimits().height, FALLEN * low / robot.height_com),
            "tilt": min(max(FallLimits().tilt, tilt + LEAN), 180.0)}  # fmt: skip
