"""Compile the kernels once, in a process of its own.

A kernel that a process compiled itself may differ in the last bits from the same kernel read from
the cache (other functions were at hand to be inlined). After `prepare` every process reads the
same compiled code, so results do not depend on which process came first.
"""

import subprocess
import sys

from poise.envs.config import write_atomic
from poise.envs.jit import CACHE_STAMP

_READY = CACHE_STAMP.with_name("kernels.ready")


def prepare() -> None:
    """Fill the cache of compiled kernels if it is cold; about half a minute, once."""
    try:
        sources = CACHE_STAMP.read_text()
        if _READY.is_file() and _READY.read_text() == sources:
            return
        code = "from poise.training.warmup import compile_all; compile_all()"
        subprocess.run([sys.executable, "-c", code], check=True)
        write_atomic(_READY, sources)
    except (OSError, subprocess.CalledProcessError):
        return  # a folder that cannot be written has no cache: nothing to share


def compile_all() -> None:
    """Play a step of both environments: compiles and caches what trials use."""
    import numpy as np

    from poise.baselines.residual_balance import ResidualBalanceEnv
    from poise.envs.torque_balance import TorqueBalanceEnv

    push = {"impulse": 1.0, "start": 0.0}
    for env in (ResidualBalanceEnv(duration=0.1), TorqueBalanceEnv(duration=0.1)):
        env.reset(seed=0, options={"push": push})
        env.step(np.zeros(env.action_space.shape))
        env.simulation.state.support_distance(np.zeros(2))
        env.simulation.step(np.zeros(env.robot.model.nu))
