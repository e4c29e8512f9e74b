"""Stable-Baselines3's PPO on the plain environment: python examples/sb3_train.py [STEPS]"""

import sys

from stable_baselines3 import PPO

import poise  # noqa: F401  (registers the environments)

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
quiet = {"net_arch": [64, 64], "log_std_init": -1.5}  # full-scale noise would fell the robot
model = PPO("MlpPolicy", "poise/ResidualBalance-v0", policy_kwargs=quiet, n_steps=512, verbose=1)
model.learn(steps)
model.save("sb3_residual")
