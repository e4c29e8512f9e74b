"""A policy that is its own mirror image: half the pushes teach all of them.

μ(o) = ½ (f(o) + M_a f(M_o o)), V(o) = ½ (v(o) + v(M_o o)), where M_o and M_a exchange left and
right in observations and actions [Abdolhosseini19].
The weights are those of an ordinary policy.
"""

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.distributions import DiagGaussianDistribution, Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.torch_layers import FlattenExtractor

from poise.envs.robots.mirror import Mirror


class TorchMirror(torch.nn.Module):
    """A `Mirror` of tensors (..., n)."""

    def __init__(self, mirror: Mirror):
        super().__init__()
        self.order = torch.as_tensor(mirror.order)
        self.sign = torch.as_tensor(mirror.sign, dtype=torch.float32)

    def forward(self, values: torch.Tensor) -> torch.Tensor:
        """Return the mirror image of `values`."""
        return self.sign * values[..., self.order]


class BothSides(FlattenExtractor):
    """(2, n, no): observations, and their mirror images."""

    def __init__(self, space: spaces.Box, mirror: Mirror):
        super().__init__(space)
        self.mirror = TorchMirror(mirror)

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the features of observations (n, no) and of their mirror images."""
        features = super().forward(observations)
        return torch.stack([features, self.mirror(features)])


class MirroredPolicy(ActorCriticPolicy):
    """SB3's actor and critic, each the mean of what it says and of what its mirror image says."""

    def __init__(self, *arguments: Any, mirrors: tuple[Mirror, Mirror], **named: Any):
        seen, done = mirrors
        named["features_extractor_class"] = BothSides
        named["features_extractor_kwargs"] = {"mirror": seen}
        super().__init__(*arguments, **named)
        self.mirror = TorchMirror(done)
        self.value_net.register_forward_hook(lambda layer, given, values: values.mean(dim=0))

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> Distribution:
        mean, image = self.action_net(latent_pi)
        mean = 0.5 * (mean + self.mirror(image))
        log_std = 0.5 * (self.log_std + self.log_std[self.mirror.order])
        assert isinstance(self.action_dist, DiagGaussianDistribution)
        return self.action_dist.proba_distribution(mean, log_std)


class MirroredMeanStd(RunningMeanStd):
    """Statistics of observations and of their mirror images, so that these are normalised alike."""

    def __init__(self, mirror: Mirror):
        super().__init__(shape=mirror.order.shape)
        self.mirror = mirror

    def alike(self, mean: np.ndarray, var: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return means and variances (no,) of which half are of the mirror images."""
        other = self.mirror(mean)
        spread = 0.25 * (mean - other) ** 2
        return 0.5 * (mean + other), 0.5 * (var + var[self.mirror.order]) + spread

    def update(self, arr: np.ndarray) -> None:
        """Take in observations (n, no)."""
        super().update(np.concatenate([arr, self.mirror(arr)]))
