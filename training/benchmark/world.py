"""Playing one case with one controller, in whatever process: the result depends on them alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.variants import perturbed_robot
from poise.envs.sensors.delayed import DelayedState
from poise.training.statistics.eurobench import body_sway, recovery_time, sway_angle
from poise.training.trials.players import Player
from poise.training.trials.stage import Stage
from poise.training.trials.trial import run_trial

from .case import Case, Result, failed


@dataclass(frozen=True)
class Job:
    """One case for one controller, by the name that `load_player` takes."""

    stage: Stage
    controller: str
    case: Case


def play(job: Job) -> Result:
    """Play a job; what the controller raises while it plays becomes the result's `error`.

    Raises PoiseError when the controller cannot be loaded here: that is no trial.
    """
    player = _player(job.stage, job.controller)
    try:
        return play_case(player, job.case)
    except MemoryError:  # of this process, not of the controller
        raise
    except Exception as error:  # a controller from outside may raise anything
        del _players[job.stage, job.controller]  # it may be broken: the next trial gets a new one
        return failed(error)


def play_case(player: BenchmarkPlayer, case: Case, watch: Any = None) -> Result:
    """Play a case; `watch(env)` is called after the reset and after every step."""
    ready = player.prepare(case)
    sway = _Sway()

    def both(env: BalanceEnv) -> None:
        sway(env)
        if watch is not None:
            watch(env)

    outcome = run_trial(ready, case, both)
    if case.push is None or not outcome.recovered:
        return Result(outcome)
    rate = 1.0 / ready.env.config.policy_period
    angle = sway.angle(case.push.direction)
    start = round(case.push.start * rate)
    return Result(outcome, body_sway(angle, start), recovery_time(angle, start, rate))


class BenchmarkPlayer:
    """A player in the standard world, and in others.

    The environment stays that of `poise evaluate`; its simulation and its state source are those of
    the case.
    """

    def __init__(self, player: Player):
        self.player = player
        self.standard = player.env.simulation

    def prepare(self, case: Case) -> Player:
        """The player with an environment whose world is that of the case."""
        env = self.player.env
        known = case.mass_error == 0.0  # the controller's masses are the true ones
        if known and case.friction is None:
            env.simulation = self.standard
        else:
            env.simulation = Simulation(
                perturbed_robot(env.robot, friction=case.friction, mass_error=case.mass_error)
            )
        if not known or case.delay > 0.0:
            env.state_source = DelayedState(env.simulation, env.robot, case.delay)
        return self.player


_players: dict[tuple[Stage, str], BenchmarkPlayer] = {}  # of this process


def _player(stage: Stage, controller: str) -> BenchmarkPlayer:
    key = (stage, controller)
    if key not in _players:
        _players[key] = BenchmarkPlayer(stage.load(controller))
    return _players[key]


class _Sway:
    """CoM and ankles at every policy step, in the heading frame of the start."""

    def __init__(self) -> None:
        self.rows: list[tuple[np.ndarray, np.ndarray]] = []
        self.heading = np.array([1.0, 0.0])

    def __call__(self, env: BalanceEnv) -> None:
        state = env.simulation.state
        if not self.rows:
            self.heading = state.heading.copy()
        self.rows.append((state.com.copy(), _ankles(env.simulation)))

    def angle(self, direction: float) -> np.ndarray:
        """θ (n,) in the plane of a push towards `direction` [deg]."""
        cos, sin = self.heading
        c, s = np.cos(np.radians(direction)), np.sin(np.radians(direction))
        com, ankles = (np.array(column) for column in zip(*self.rows, strict=True))
        return sway_angle(com, ankles, [cos * c - sin * s, sin * c + cos * s])


def _ankles(simulation: Simulation) -> np.ndarray:
    """(3,) middle of the feet's own joints, or of the feet where a foot has none [m]."""
    model, data = simulation.model, simulation.data
    points = []
    for sole in simulation.robot.soles:
        first, count = model.body_jntadr[sole.body_id], model.body_jntnum[sole.body_id]
        joints = data.xanchor[first : first + count]
        points.append(joints.mean(axis=0) if count else data.xpos[sole.body_id])
    return np.mean(points, axis=0)
