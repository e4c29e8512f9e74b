"""Poise keeps a simulated humanoid on its feet while it is pushed.

Importing it registers the environments ``poise/TorqueBalance-v0``, ``poise/PositionBalance-v0``,
``poise/ResidualBalance-v0``, ``poise/ResidualStep-v0``, ``poise/ResidualWalk-v0``,
``poise/ResidualWhole-v0`` and ``poise/Velocity-v0`` with Gymnasium, and loads neither torch nor
numba nor MuJoCo.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING

from gymnasium.envs.registration import register

from poise.lazy import lazy

__version__ = "0.1.0"
__all__ = [
    "ConfigError",
    "PoiseError",
    "__version__",
    "allowing",
    "baselines",
    "benchmark",
    "envs",
    "evaluate",
    "load_controller",
    "load_policy",
    "load_robot",
    "load_standalone",
    "make_env",
    "training",
]

if "numba" not in sys.modules:
    # Numba takes these from a .numba_config.yaml of the current folder, too, wherever that came
    # from: it would unpickle kernels, or import a class. The environment goes before that file.
    for _name in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"):
        os.environ.setdefault(_name, "")

# No max_episode_steps: the environments end their episodes themselves, after `duration`; a number
# here would cut off those that are made longer.
register(
    "poise/TorqueBalance-v0",
    entry_point="poise.envs.balance.torque:TorqueBalanceEnv",
    vector_entry_point="poise.envs.balance.vector.vector_env:torque_vector_env",
)
register(
    "poise/PositionBalance-v0",
    entry_point="poise.envs.balance.position:PositionBalanceEnv",
    vector_entry_point="poise.envs.balance.vector.vector_env:position_vector_env",
)
register(
    "poise/ResidualBalance-v0",
    entry_point="poise.baselines.environments.residual:ResidualBalanceEnv",
    vector_entry_point="poise.baselines.environments.residual:vector_env",
)
register(
    "poise/ResidualStep-v0",
    entry_point="poise.baselines.environments.stepping:ResidualStepEnv",
    vector_entry_point="poise.baselines.environments.stepping:vector_env",
)
register(
    "poise/ResidualWalk-v0",
    entry_point="poise.baselines.environments.walking:ResidualWalkEnv",
    vector_entry_point="poise.baselines.environments.walking:vector_env",
)
register(
    "poise/ResidualWhole-v0",
    entry_point="poise.baselines.environments.whole:ResidualWholeEnv",
    vector_entry_point="poise.baselines.environments.whole:vector_env",
)
register(
    "poise/Velocity-v0",
    entry_point="poise.baselines.environments.velocity:VelocityEnv",
    vector_entry_point="poise.baselines.environments.velocity:vector_env",
)

if TYPE_CHECKING:
    from poise import baselines, envs, training
    from poise.baselines.allowance import allowing
    from poise.baselines.registry import load_controller
    from poise.configs.errors import ConfigError, PoiseError
    from poise.envs.robots.robot import load_robot
    from poise.training.benchmarking.evaluation.evaluate import benchmark, evaluate
    from poise.training.deploy.standalone.controller import load_standalone
    from poise.training.learning.policy import load_policy, make_env
else:
    __getattr__, __dir__ = lazy(__name__, __file__)
