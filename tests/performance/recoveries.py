"""Recorded ticks of real push recoveries, for the benchmarks of the controller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config
from poise.baselines.solvers import QP
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import load_robot

DIRECTIONS = (0.0, 45.0, 90.0, 135.0, 180.0, 270.0)
IMPULSES = (9.0, 13.0, 16.0, 19.0)  # [N·s]
CONTROLLER = "momentum-qp"


@dataclass
class Tick:
    """What the controller met at one tick."""

    state: RobotState
    targets: Targets
    problem: QP


def impulses(name: str) -> list[float]:
    """Impulses of the default humanoid, by the robot's mass [N·s]."""
    share = load_robot(name).mass / load_robot("humanoid").mass
    return [share * impulse for impulse in IMPULSES]


def record(
    seconds: float = 1.5, every: int = 10, robot: str = "humanoid"
) -> tuple[ResidualBalanceEnv, list[list[Tick]]]:
    """The environment, and every `every`-th control tick after each push, up to a fall."""
    period = controller_config(CONTROLLER).period  # a policy step is one tick
    env = ResidualBalanceEnv(
        load_robot(robot), controller=CONTROLLER, pushes=None, duration=0.5 + seconds,
        policy_period=period,
    )  # fmt: skip
    action = np.zeros(env.action_space.shape)
    recoveries = []
    for direction in DIRECTIONS:
        for impulse in impulses(robot):
            push = {"impulse": impulse, "direction": direction, "start": 0.1}
            env.reset(seed=len(recoveries), options={"push": push})
            ticks: list[Tick] = []
            ended = False
            while not ended:
                _, fallen, truncated = env.step_without_info(action)
                ended = fallen or truncated
                if env.simulation.time > 0.1 and env.steps % every == 0 and not fallen:
                    state = env.simulation.state.copy()
                    targets = Targets.standing(env.robot, state)
                    targets.com[0] += env.controller.com_offset
                    targets.cop[0] += env.controller.com_offset
                    ticks.append(Tick(state, targets, env.controller.problem(state, targets)))
            recoveries.append(ticks)
    return env, recoveries
