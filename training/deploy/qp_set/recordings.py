"""Push recoveries of the momentum QP, with every tick kept.

Pushes in eight directions, from well inside to well beyond the limit of the robot's baseline.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import momentum_qp_config
from poise.baselines.solvers import QP, make_solver
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot
from poise.training.benchmarking.suites.draw import generator, start_seed
from poise.training.benchmarking.trials.push_limits import PushLimits

End = Literal["recovered", "fell", "not quiet"]
DIRECTIONS = 8
FRACTIONS = (0.6, 1.5, 0.85, 1.15, 1.0)  # of the limit in the push's direction
PUSH_START, PUSH_DURATION = 0.2, 0.1  # [s]
SPAN, TRIAL_DURATION = 2.0, 5.0  # [s]


class RecordedTick(NamedTuple):
    """A control tick: what the controller met, and its answer."""

    time: float
    state: RobotState
    targets: Targets
    cop_vel: np.ndarray  # (2,) as it measured it
    reduced: QP
    torque_matrix: np.ndarray  # (nu, n) of the reduced problem
    torque_offset: np.ndarray  # (nu,)
    torques: np.ndarray  # (nu,) its answer
    active: int  # rows that bind


class QPRecorder(MomentumQP):
    """The momentum QP, keeping its ticks between two times, but for those without a solution."""

    begin, end = PUSH_START, PUSH_START + SPAN

    def __init__(self, robot: Robot, config: MomentumQPConfig):
        super().__init__(robot, config)
        self._exact = make_solver("active-set")

    def reset(self, state: RobotState | None = None) -> None:
        super().reset(state)
        self.ticks: list[RecordedTick] = []
        self.met = 0

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        if not self.begin <= state.time < self.end:
            return super().torques(state, targets)
        self.met += 1
        qp, ws = self.problem(state, targets), self.workspace
        joints, cop_vel = self._motor_joints, ws.cop_vel.copy()
        matrix, offset = ws.T[joints], ws.tau0[joints]
        solution = self._exact.solve(qp)
        torques = super().torques(state, targets)
        if solution.solved:
            kept = replace(targets)  # copies what it holds
            active = int(np.count_nonzero(solution.lam))
            self.ticks.append(RecordedTick(state.time, state.copy(), kept, cop_vel, qp,
                                   matrix, offset, torques, active))  # fmt: skip
        return torques


@dataclass(frozen=True)
class Recovery:
    """One trial: its push, its seed, how it ended, and its ticks (`met` counts all there were)."""

    push: Push
    seed: int
    end: End
    ticks: list[RecordedTick]
    met: int


def recoveries(robot: Robot, controller: str, limits: PushLimits, seed: int) -> Iterator[Recovery]:
    """Yield trials without end: each of 8 directions with each of 5 impulses, then repeated."""
    recorder = QPRecorder(robot, momentum_qp_config(controller))
    env = ResidualBalanceEnv(robot, controller=recorder, pushes=None, duration=TRIAL_DURATION)
    action = np.zeros(len(env.action_names))
    body, number = push_bodies(robot)[0], 0
    while True:
        push = _push(body, limits, seed, number)
        start = start_seed(seed, number)
        env.reset(seed=start, options={"push": [push]})
        ended = False
        while not ended:
            _, fallen, truncated = env.step_without_info(action)
            ended = fallen or truncated
        end: End = "fell" if env.fallen else "recovered" if env.recovered else "not quiet"
        yield Recovery(push, start, end, recorder.ticks, recorder.met)
        number += 1


def _push(body: str, limits: PushLimits, seed: int, number: int) -> Push:
    """Near a direction and a fraction of the limit that take turns; 5 and 8 are coprime."""
    rng = generator(seed, number)
    sector = 360.0 / DIRECTIONS
    direction = (sector * (3 * number % DIRECTIONS + rng.uniform(-0.5, 0.5))) % 360.0
    fraction = FRACTIONS[number % len(FRACTIONS)] * rng.uniform(0.95, 1.05)
    table = limits.table
    limit = limits.ankle(direction, PUSH_DURATION) if table is None else table(direction)
    return Push(body, PUSH_START, PUSH_DURATION, fraction * limit, direction)
