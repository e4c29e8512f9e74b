"""Tried by `make build` in an environment that holds the wheel alone: does the package work there?

Run with `python -P`, so that the sources beside this file are not seen.
"""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium

import poise

assert Path(poise.__file__).is_relative_to(sys.prefix), f"not the wheel: {poise.__file__}"
for name in ("poise/TorqueBalance-v0", "poise/ResidualBalance-v0"):
    env = gymnasium.make(name)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()
poise.load_policy()
print(f"poise {poise.__version__} works from its wheel")
