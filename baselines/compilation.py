"""What each process of `warmup.py` compiles: every kernel that an environment's step needs."""

import numpy as np

from poise.envs import batch
from poise.envs.kinematics import allocate_state
from poise.envs.robot import load_robot
from poise.envs.state import RobotState

from .controller import Targets
from .momentum_qp import MomentumQP, Tick, accept, momentum_tick, solve
from .residual_balance import ResidualBalanceEnv
from .residual_step import residual_step
from .residual_step_env import ResidualStepEnv
from .warmup import begin

__all__ = ["assembly", "begin", "contacts", "solver", "steps"]


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
    """The active-set method."""
    qp, _, _ = _standing()
    solve(qp.workspace)


def steps() -> None:
    """Physics, state and episode, and the policy step from which everything is called."""
    env = ResidualBalanceEnv(duration=0.1)
    env.reset(seed=0, options={"push": {"impulse": 1.0, "start": 0.0}})
    env.simulation.step(np.zeros(env.robot.model.nu))
    env.simulation.state.support_distance(np.zeros(2))
    # for its type alone: what is called by these addresses, other processes compile
    qp = env.controller
    problem = qp.assembly(env.simulation.state, env.targets)
    tick = Tick(problem, qp.memory, 0, 0)
    residual_step.compile((env.bind(tick, 0).numba_type,))
    momentum_tick.compile((tick.numba_type,))
    accept(problem.state, problem.parameters, problem.workspace, qp.memory)
    batch.play(0, batch.NOBODY, np.zeros(1, dtype=np.int64))


def contacts() -> None:
    """What controllers that step need besides: a push that takes a step."""
    env = ResidualStepEnv(duration=2.0)
    push = {"impulse": 0.55 * env.robot.mass, "start": 0.0}
    env.reset(seed=0, options={"push": push})
    over = False
    while not over:
        *_, fallen, truncated, _ = env.step(np.zeros(env.action_space.shape or ()))
        over = fallen or truncated
