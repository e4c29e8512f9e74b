"""TorchRL's PPO on the plain environment: python examples/torchrl_ppo.py [STEPS]

Needs TorchRL: pip install -e ".[torchrl]" in a checkout.
"""

import sys

import torch
from tensordict.nn import InteractionType, TensorDictModule, TensorDictSequential
from tensordict.nn.distributions import NormalParamExtractor
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import GymEnv, TransformedEnv
from torchrl.envs.transforms import Compose, InitTracker, RewardSum, StepCounter
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

import poise  # noqa: F401  (registers the environments)

BATCH, EPOCHS, MINIBATCH = 512, 5, 128
steps = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
transforms = Compose(InitTracker(), StepCounter(), RewardSum())
env = TransformedEnv(GymEnv("poise/ResidualBalance-v0"), transforms)
size, actions = env.observation_spec["observation"].shape[0], env.action_spec.shape[0]


def network(outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh(),
                         nn.Linear(64, outputs))  # fmt: skip


mean = nn.Sequential(
    network(2 * actions), NormalParamExtractor(scale_mapping="biased_softplus_0.2")
)
actor = ProbabilisticActor(
    TensorDictSequential(TensorDictModule(mean, ["observation"], ["loc", "scale"])),
    in_keys=["loc", "scale"], out_keys=["action"], distribution_class=TanhNormal,
    distribution_kwargs={"low": -1.0, "high": 1.0}, return_log_prob=True,
    default_interaction_type=InteractionType.RANDOM,
)  # fmt: skip
critic = ValueOperator(network(1), in_keys=["observation"])
advantage = GAE(gamma=0.99, lmbda=0.95, value_network=critic)
loss = ClipPPOLoss(actor, critic, clip_epsilon=0.2)
optimizer = torch.optim.Adam(loss.parameters(), lr=3e-4)
collector = Collector(env, actor, frames_per_batch=BATCH, total_frames=-(-steps // BATCH) * BATCH)
done = 0
for batch in collector:
    for _ in range(EPOCHS):
        with torch.no_grad():
            advantage(batch)
        flat = batch.reshape(-1)
        for rows in torch.randperm(len(flat)).split(MINIBATCH):
            terms = loss(flat[rows])
            total = terms["loss_objective"] + terms["loss_critic"] + terms["loss_entropy"]
            optimizer.zero_grad()
            total.backward()
            nn.utils.clip_grad_norm_(loss.parameters(), 0.5)
            optimizer.step()
    done += batch.numel()
    print(f"{done} steps, mean reward {batch['next', 'reward'].mean():.3f}")
collector.shutdown()
