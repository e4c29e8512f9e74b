"""Poise keeps a simulated humanoid on its feet while it is pushed.

Importing it registers the environments ``poise/TorqueBalance-v0``, ``poise/ResidualBalance-v0`` and
``poise/ResidualStep-v0`` with Gymnasium, and loads neither torch nor numba nor MuJoCo.
"""

from __future__ import annotations

import os
import sys
from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import register

if TYPE_CHECKING:
    from poise.baselines.allowance import allowing
    from poise.training.learning.policy import load_policy

__version__ = "0.1.0"
__all__ = ["__version__", "allowing", "load_policy"]

if "numba" not in sys.modules:
    # Numba takes these from a .numba_config.yaml of the current folder, too, wherever that came
    # from: it would unpickle kernels, or import a class. The environment goes before that file.
    for _name in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"):
        os.environ.setdefault(_name, "")

# No max_episode_steps: the environments end their episodes themselves, from their own config.
register(
    "poise/TorqueBalance-v0",
    entry_point="poise.envs.balance.torque:TorqueBalanceEnv",
    vector_entry_point="poise.envs.vector.vector_env:torque_vector_env",
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


def __getattr__(name: str) -> Any:
    if name == "load_policy":
        from poise.training.learning.policy import load_policy

        return load_policy
    if name == "allowing":
        from poise.baselines.allowance import allowing

        return allowing
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
