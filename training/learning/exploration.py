"""Exploration: how much noise a policy's actions have, and how long it lasts."""

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy

from .config import TrainConfig


class ExplorationCallback(BaseCallback):
    """Narrows the exploration on a schedule, and ends it in each episode, where asked for.

    The deterministic policy is what counts in the end: with little noise left, what is learned
    is what is judged. After `ppo.noise_until` seconds of an episode actions are the policy's mean:
    a robot that trembles by noise never rests, and a policy that never sees rest forgets it. Such
    steps teach the critic what rest is worth, and the actor nothing: the gradient of their density
    is zero, so their advantages are set to zero, which else would count through the ratio.
    """

    model: PPO

    def __init__(self, config: TrainConfig):
        super().__init__()
        self.config = config
        self._exact: list[np.ndarray] = []  # (n,) bool of each step of the rollout

    def _on_rollout_start(self) -> None:
        ppo = self.config.ppo
        if ppo.noise_until is not None:
            self._exact = [self._end_noise(ppo.noise_until)]
        if ppo.log_std_final is None:
            return
        done = min(self.num_timesteps / self.config.steps, 1.0)
        log_std = ppo.log_std_init + done * (ppo.log_std_final - ppo.log_std_init)
        with torch.no_grad():
            self.model.policy.log_std.fill_(log_std)

    def _on_step(self) -> bool:
        if self.config.ppo.noise_until is not None:
            self._exact.append(self._end_noise(self.config.ppo.noise_until))
        return True

    def _on_rollout_end(self) -> None:
        if self._exact:
            buffer = self.model.rollout_buffer
            buffer.advantages[np.stack(self._exact[: len(buffer.advantages)])] = 0.0

    def _end_noise(self, until: float) -> np.ndarray:
        """Which environments (n,) take the mean at their next step."""
        assert self.training_env is not None
        steps = np.array(self.training_env.get_attr("steps"))
        exact = steps * self.config.env.policy_period >= until
        noise = self.model.policy.action_dist
        assert isinstance(noise, EpisodeGaussian)
        noise.exact = torch.as_tensor(exact)
        return exact


class EpisodeGaussian(DiagGaussianDistribution):
    """Gaussian actions whose noise lasts from step to step [Hollenstein24], and may end.

    a = μ + σ ε with ε' = ρ ε + √(1 − ρ²) w for each environment, w white and of variance 1, ρ the
    `correlation`. ε has a variance of 1 at every step, and the density that PPO's ratio is made of
    stays that of N(μ, σ²), as there, where the noise is coloured instead. White noise at 50 Hz is
    averaged by a body before it moves; noise that lasts pushes it where it has not been.
    """

    def __init__(self, action_dim: int, correlation: float):
        super().__init__(action_dim)
        self.correlation = correlation
        self.exact: torch.Tensor | None = None  #: (n,) bool: environments without noise; None: none
        self._noise: torch.Tensor | None = None  # ε (n, na) of the step before

    def sample(self) -> torch.Tensor:
        """Actions (n, na) of the next step of `n` environments."""
        mean, std = self.distribution.mean, self.distribution.stddev
        noise, rho = torch.randn_like(mean), self.correlation
        if self._noise is not None and self._noise.shape == noise.shape:
            noise = rho * self._noise + (1.0 - rho * rho) ** 0.5 * noise
        self._noise = noise
        if self.exact is not None and len(self.exact) == len(noise):
            noise = torch.where(self.exact[:, None], 0.0, noise)
        return mean + std * noise


def shape_exploration(policy: ActorCriticPolicy, correlation: float) -> None:
    """Let the noise of `policy`, which has Gaussian actions, last and end as `EpisodeGaussian`'s.

    Its weights stay as they are.
    """
    dimension = policy.action_space.shape
    assert dimension  # the space is a box
    policy.action_dist = EpisodeGaussian(dimension[0], correlation)
