"""The policy as Stable-Baselines3's own, which its `PPO.load` reads without Poise."""

import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.linalg import block_diag

from poise.envs.balance.base import BalanceEnv
from poise.envs.robots.mirror import Mirror
from poise.training.learning.checkpoints import LEFT_OUT, plain_model
from poise.training.learning.config import TrainConfig
from poise.training.learning.policy import Policy
from poise.training.learning.policy_files import (
    MOMENTS,
    POLICY,
    STATISTICS,
    read_statistics,
    read_weights,
)
from poise.training.learning.train import make_model
from poise.training.learning.vec_env import ThreadedVecEnv

from .check import largest_difference, observations

Weights = dict[str, np.ndarray]  # by their names in SB3's state_dict

NORMALISATION = "vec_normalize.pkl"  # the name that huggingface_sb3 gives it
TOLERANCE = 1e-4  # of an action: SB3 computes with 32 bits
CHECKED = 1000  # observations


def write_stock(folder: Path, archive: str, policy: Policy, env: BalanceEnv, source: Path) -> None:
    """Write `archive` for `PPO.load`, and the statistics for `VecNormalize.load`.

    `env` is the policy's environment, `source` its folder. A symmetric policy becomes an ordinary
    one of twice the width that is still symmetric. Privileged inputs of the critic are left out:
    its values are those at zero. The optimizer starts afresh. Raises PoiseError if SB3's action for
    an observation differs by more than `TOLERANCE`.
    """
    import torch
    from stable_baselines3.common.vec_env import VecNormalize

    seen = env.observation_space.shape[0]
    stored = {name: _seen(name, values.numpy(), seen)
              for name, values in read_weights(source / POLICY).items()}  # fmt: skip
    weights, config = _ordinary(stored, policy)
    normalize = VecNormalize(ThreadedVecEnv([env]), gamma=config.ppo.gamma)
    for prefix, moments in (("obs", normalize.obs_rms), ("ret", normalize.ret_rms)):
        known = read_statistics(source / STATISTICS, [f"{prefix}_{name}" for name in MOMENTS])
        for name, values in zip(MOMENTS, known.values(), strict=True):
            setattr(moments, name, values[:seen] if values.ndim else values[()])
    limits = read_statistics(source / STATISTICS, ("clip_obs", "epsilon"))
    normalize.clip_obs, normalize.epsilon = float(limits["clip_obs"]), float(limits["epsilon"])
    normalize.training = normalize.norm_reward = False  # it no longer learns, and leaves rewards
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a batch that one environment cannot fill
        model = make_model(config, normalize)
        model.policy.load_state_dict({k: torch.as_tensor(v) for k, v in weights.items()})
        model.num_timesteps = int(policy.state["timesteps"])
        plain_model(model).save(folder / archive, exclude=LEFT_OUT)
    normalize.save(str(folder / NORMALISATION))
    shown = observations(policy, CHECKED)
    model.policy.load_state_dict(read_weights(folder / archive))  # as they were written
    actions, _ = model.predict(normalize.normalize_obs(shown), deterministic=True)
    largest_difference(actions, policy.predict(shown)[0], TOLERANCE, archive)


def _seen(name: str, values: np.ndarray, seen: int) -> np.ndarray:
    """An array of the networks without the inputs that the critic alone saw in training."""
    return values[:, :seen] if name.endswith("_net.0.weight") else values


def _ordinary(weights: Weights, policy: Policy) -> tuple[Weights, TrainConfig]:
    """Return weights and configuration of the policy as an ordinary one, in one environment."""
    ppo = replace(policy.config.ppo, n_envs=1, symmetric=False)
    if policy.mirrors is not None:
        weights = both_sides(weights, *policy.mirrors)
        critic = None if ppo.critic_arch is None else _twice(ppo.critic_arch)
        ppo = replace(ppo, net_arch=_twice(ppo.net_arch), critic_arch=critic)
    return weights, replace(policy.config, ppo=ppo)


def _twice(widths: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(2 * width for width in widths)


def both_sides(weights: Mapping[str, np.ndarray], see: Mirror, do: Mirror) -> Weights:
    """Return the weights of an ordinary network that is the mean of f and of its mirror image.

    The first layer sees o by W and M_o o by W M_o; further ones treat both alike; the last one is
    ½ [W, M_a W], of the value ½ [W, W]. Of the logarithms of the spread it has the mean.
    """
    return {name: _both(name, values, see, do) for name, values in weights.items()}


def _both(name: str, values: np.ndarray, see: Mirror, do: Mirror) -> np.ndarray:
    """One array of `both_sides`, by its name in SB3's state_dict."""
    if name == "log_std":
        return 0.5 * (values + values[do.order])
    if name.startswith("action_net."):
        return _mean_of(values, do(values.T).T)
    if name.startswith("value_net."):
        return _mean_of(values, values)
    if values.ndim == 1:
        return np.concatenate([values, values])
    if name.endswith("_net.0.weight"):
        image = np.zeros_like(values)
        image[:, see.order] = see.sign * values
        return np.concatenate([values, image])
    return block_diag(values, values)


def _mean_of(values: np.ndarray, image: np.ndarray) -> np.ndarray:
    """Return a last layer, weight or bias, that gives the mean of two."""
    return 0.5 * (np.concatenate([values, image], 1) if values.ndim == 2 else values + image)
