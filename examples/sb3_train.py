"""Stable-Baselines3's PPO with nearly the numbers of `poise train --quick`.

python examples/sb3_train.py [STEPS]
"""

import sys

import torch
from ppo_single_file import ENVIRONMENT  # pushes, rewards and scales, from the file beside this
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from poise.baselines import ResidualStepEnv
from poise.envs import replicate
from poise.training import MirroredMeanStd, MirroredPolicy, ThreadedVecEnv, slow_actor

steps = int(sys.argv[1]) if len(sys.argv) > 1 else 500_000
n = min(max(steps // 96, 2), 128)  # environments
env = ResidualStepEnv(**ENVIRONMENT)
vec = VecNormalize(ThreadedVecEnv(replicate(env, n), threads=2), gamma=0.985)
vec.obs_rms = MirroredMeanStd(env.mirrors()[0])
policy = {"mirrors": env.mirrors(), "net_arch": [128, 64], "activation_fn": torch.nn.ELU,
          "log_std_init": -1.7}  # fmt: skip
model = PPO(MirroredPolicy, vec, learning_rate=lambda left: 8e-4 + 2e-4 * left, n_steps=96,
            batch_size=min(2048, 96 * n), n_epochs=4, gamma=0.985, gae_lambda=0.95, target_kl=0.02,
            max_grad_norm=1.0, policy_kwargs=policy, device="cpu", verbose=1)  # fmt: skip
with torch.no_grad():  # the first policy is the controller alone
    model.policy.action_net.weight.zero_()
    model.policy.action_net.bias.zero_()
slow_actor(model.policy, 0.4)
model.learn(steps)
model.save("sb3_step")
vec.save("sb3_step_normalize.pkl")  # the policy is nothing without these statistics
