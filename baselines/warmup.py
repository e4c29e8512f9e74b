"""Compile the kernels once, in two processes of their own.

A kernel that a process compiled itself may differ in the last bits from the same kernel read from
the cache (other functions were at hand to be inlined). After `prepare` every process reads the
same compiled code, so results do not depend on which process came first.
"""

import subprocess
import sys

from poise.envs import jit
from poise.envs.config import write_atomic

_READY = jit.CACHE_STAMP.with_name("kernels.ready")
#: For each process, one after the other; what needs most comes last, and is read from the cache.
_SHARES = (("compile_tick",), ("compile_solver", "compile_steps"))
_compiling = False  # whether this is one of the two


def prepare() -> None:
    """Fill the cache of compiled kernels if it is cold: some twenty seconds on two cores, once."""
    if _compiling:
        return
    try:
        sources = jit.CACHE_STAMP.read_text()
        if _READY.is_file() and _READY.read_text() == sources:
            return
        print(jit.MESSAGE, file=sys.stderr, flush=True)
        if _compile_apart():
            write_atomic(_READY, sources)
    except OSError:
        return  # a folder that cannot be written has no cache: nothing to share


def _compile_apart() -> bool:
    """Whether both processes have finished without an error."""
    jobs = []
    try:
        for names in _SHARES:
            calls = "; ".join(f"warmup.{name}()" for name in names)
            code = f"from poise.baselines import warmup; warmup.begin(); {calls}"
            jobs.append(subprocess.Popen([sys.executable, "-c", code]))
        return all([job.wait() == 0 for job in jobs])
    finally:
        for job in jobs:
            job.kill()


def begin() -> None:
    """This process compiles: it has nothing to wait for, and its starter has told the user."""
    global _compiling
    _compiling = True
    jit.quiet()


def compile_tick() -> None:
    """A tick of the momentum QP, of a state that is all zeros."""
    from poise.envs.kinematics import allocate_state
    from poise.envs.robot import load_robot
    from poise.envs.state import RobotState

    from .controller import Targets
    from .momentum_qp import MomentumQP

    robot = load_robot("humanoid")
    qp = MomentumQP(robot)
    state = RobotState(qp.arrays, allocate_state(robot.model.nv, len(robot.soles)))
    targets = Targets.standing(robot, state)
    qp.problem(state, targets)  # while the other process is at the solver
    qp.compiled_tick(state, targets)
    qp.torques(state, targets)


def compile_solver() -> None:
    """The active-set method, on a problem that is all zeros."""
    from poise.envs.robot import load_robot

    from .momentum_qp import MomentumQP, solve

    solve(MomentumQP(load_robot("humanoid")).workspace)


def compile_steps() -> None:
    """A policy step of both environments: physics, state, targets, episode."""
    import numpy as np

    from poise.envs.torque_balance import TorqueBalanceEnv

    from .residual_balance import ResidualBalanceEnv

    for kind in (TorqueBalanceEnv, ResidualBalanceEnv):
        env = kind(duration=0.1)
        env.reset(seed=0, options={"push": {"impulse": 1.0, "start": 0.0}})
        env.step(np.zeros(env.action_space.shape))
        env.simulation.state.support_distance(np.zeros(2))
        env.simulation.step(np.zeros(env.robot.model.nu))
