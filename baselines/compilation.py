"""What each process of `warmup.py` compiles: every kernel that an environment's step needs."""

import numpy as np

from poise.envs.balance import BalanceEnv
from poise.envs.kinematics import allocate_state
from poise.envs.robot import load_robot
from poise.envs.state import RobotState
from poise.envs.torque_balance import TorqueBalanceEnv

from .controller import Targets
from .momentum_qp import MomentumQP, accept, solve
from .residual_balance import ResidualBalanceEnv
from .warmup import begin

__all__ = ["assembly", "begin", "solver", "steps", "ticks"]


def _standing() -> tuple[MomentumQP, RobotState, Targets]:
    """The baseline, in a state that is all zeros."""
    robot = load_robot("humanoid")
    qp = MomentumQP(robot)
    state = RobotState(qp.arrays, allocate_state(robot.model.nv, len(robot.soles)))
    return qp, state, Targets.standing(robot, state)


def assembly() -> None:
    """The momentum QP's problem."""
    qp, state, targets = _standing()
    qp.problem(state, targets)


def solver() -> None:
    """The active-set method, and torques from what it finds."""
    qp, state, _ = _standing()
    solve(qp.workspace)
    accept(state.arrays, qp.parameters, qp.workspace, qp.memory)


def steps() -> None:
    """Physics, state and episode: a step of torques."""
    _step(TorqueBalanceEnv(duration=0.1))


def ticks() -> None:
    """The baseline's step, by which everything else is compiled."""
    env = ResidualBalanceEnv(duration=0.1)
    _step(env)
    env.controller.torques(env.simulation.state, env.targets)


def _step(env: BalanceEnv) -> None:
    env.reset(seed=0, options={"push": {"impulse": 1.0, "start": 0.0}})
    env.step(np.zeros(env.action_space.shape or ()))
    env.simulation.state.support_distance(np.zeros(2))
    env.simulation.step(np.zeros(env.robot.model.nu))
