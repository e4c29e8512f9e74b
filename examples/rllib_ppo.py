"""RLlib's PPO on the plain environment: python examples/rllib_ppo.py [ITERATIONS]

Needs RLlib: pip install -e ".[rllib]" in a checkout. With more than one core, num_env_runners.
"""

import sys

import gymnasium
from ray.rllib.algorithms.ppo import PPOConfig
from ray.tune.registry import register_env

# Before MuJoCo, which may load OSMesa, whose LLVM would take the place of that of torch's Triton.
import poise.envs  # noqa: F401


def make(arguments: dict) -> gymnasium.Env:
    """Also called in Ray's own processes, which have to register the environments, too."""
    import poise.envs  # noqa: F401, F811

    return gymnasium.make("poise/ResidualBalance-v0", **arguments)


register_env("residual-balance", make)
config = (
    PPOConfig()
    .environment("residual-balance", env_config={"duration": 4.0})
    .env_runners(num_env_runners=0)
    .training(train_batch_size_per_learner=1024, minibatch_size=128, num_epochs=5, lr=3e-4)
)
algorithm = config.build_algo()
for k in range(int(sys.argv[1]) if len(sys.argv) > 1 else 100):
    result = algorithm.train()
    episodes = result["env_runners"]
    print(f"iteration {k + 1}, mean return {episodes['episode_return_mean']:.1f}")
algorithm.stop()
