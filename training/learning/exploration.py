"""Exploration: how much noise a policy's actions have, and how long it lasts."""

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy

from .config import TrainConfig


class ExplorationCallback(BaseCallback):
    """Narrows the exploration on a schedule, where the configuration says so.

    The deterministic policy is what counts in the end: with little noise left, what is learned
    is what is judged.
    """

    model: PPO

    def __init__(self, config: TrainConfig):
        super().__init__()
        self.config = config

    def _on_rollout_start(self) -> None:
        ppo = self.config.ppo
        if ppo.log_std_final is None:
            return
        done = min(self.num_timesteps / self.config.steps, 1.0)
        log_std = ppo.log_std_init + done * (ppo.log_std_final - ppo.log_std_init)
        with torch.no_grad():
            self.model.policy.log_std.fill_(log_std)

    def _on_step(self) -> bool:
        return True


class CorrelatedGaussian(DiagGaussianDistribution):
    """Gaussian actions whose noise lasts from step to step [Hollenstein24].

    a = μ + σ ε with ε' = ρ ε + √(1 − ρ²) w for each environment, w white and of variance 1, ρ the
    `correlation`. ε has a variance of 1 at every step, and the density that PPO's ratio is made of
    stays that of N(μ, σ²), as there, where the noise is coloured instead. White noise at 50 Hz is
    averaged by a body before it moves; noise that lasts pushes it where it has not been.
    """

    def __init__(self, action_dim: int, correlation: float):
        super().__init__(action_dim)
        self.correlation = correlation
        self._noise: torch.Tensor | None = None  # ε (n, na) of the step before

    def sample(self) -> torch.Tensor:
        """Actions (n, na) of the next step of `n` environments."""
        mean, std = self.distribution.mean, self.distribution.stddev
        noise, rho = torch.randn_like(mean), self.correlation
        if self._noise is not None and self._noise.shape == noise.shape:
            noise = rho * self._noise + (1.0 - rho * rho) ** 0.5 * noise
        self._noise = noise
        return mean + std * noise


def correlate_exploration(policy: ActorCriticPolicy, correlation: float) -> None:
    """Let the noise of `policy`, which has Gaussian actions, last; its weights stay as they are."""
    dimension = policy.action_space.shape
    assert dimension  # the space is a box
    policy.action_dist = CorrelatedGaussian(dimension[0], correlation)
