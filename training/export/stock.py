"""The policy as Stable-Baselines3's own, which its `PPO.load` reads without Poise."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from poise.envs.balance.base import BalanceEnv
from poise.envs.robots.mirror import Mirror
from poise.training.learning.checkpoints import LEFT_OUT, POLICY, STATISTICS, plain
from poise.training.learning.config import TrainConfig
from poise.training.learning.policy import Policy
from poise.training.learning.policy_files import MOMENTS, read_statistics, read_weights
from poise.training.learning.train import make_model
from poise.training.learning.vec_env import ThreadedVecEnv

from .check import compared, observations

if TYPE_CHECKING:
    from torch import Tensor

NORMALISATION = "vec_normalize.pkl"  # the name that huggingface_sb3 gives it
TOLERANCE = 1e-4  # of an action: SB3 computes with 32 bits
CHECKED = 1000  # observations


def write_stock(folder: Path, archive: str, policy: Policy, env: BalanceEnv, source: Path) -> None:
    """Write `archive` for `PPO.load`, and the statistics for `VecNormalize.load`.

    `env` is the policy's environment, `source` its folder. A symmetric policy becomes an ordinary
    one that is twice as wide, and as symmetric. The optimizer begins anew. Raises PoiseError where
    what SB3 makes of an observation differs by more than `TOLERANCE`.
    """
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecNormalize

    weights, config = _ordinary(read_weights(source / POLICY), policy)
    normalize = VecNormalize(ThreadedVecEnv([env]), gamma=config.ppo.gamma)
    _set_statistics(normalize, source)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a batch that one environment cannot fill
        model = make_model(config, normalize)
        model.policy.load_state_dict(weights)
        model.num_timesteps = int(policy.state["timesteps"])
        plain(model).save(folder / archive, exclude=LEFT_OUT)
    normalize.save(str(folder / NORMALISATION))
    seen = observations(policy, CHECKED)
    loaded = PPO.load(folder / archive, device="cpu")
    actions, _ = loaded.predict(normalize.normalize_obs(seen), deterministic=True)
    compared(actions, policy.predict(seen)[0], TOLERANCE, archive)


def _ordinary(weights: dict[str, Tensor], policy: Policy) -> tuple[dict[str, Tensor], TrainConfig]:
    """Weights and configuration of the policy as an ordinary one, in one environment."""
    ppo = replace(policy.config.ppo, n_envs=1, symmetric=False)
    if policy.mirrors is not None:
        weights = both_sides(weights, *policy.mirrors)
        critic = None if ppo.critic_arch is None else _twice(ppo.critic_arch)
        ppo = replace(ppo, net_arch=_twice(ppo.net_arch), critic_arch=critic)
    return weights, replace(policy.config, ppo=ppo)


def _twice(widths: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(2 * width for width in widths)


def _set_statistics(normalize: Any, source: Path) -> None:
    """Give SB3's normalisation the policy's numbers; it no longer learns, and leaves rewards."""
    moments = {"obs": normalize.obs_rms, "ret": normalize.ret_rms}
    names = [f"{prefix}_{name}" for prefix in moments for name in MOMENTS]
    found = read_statistics(source / STATISTICS, [*names, "clip_obs", "epsilon"])
    for prefix, of in moments.items():
        for name in MOMENTS:
            setattr(of, name, found[f"{prefix}_{name}"][()])
    normalize.clip_obs, normalize.epsilon = float(found["clip_obs"]), float(found["epsilon"])
    normalize.training = normalize.norm_reward = False


def both_sides(weights: dict[str, Tensor], see: Mirror, do: Mirror) -> dict[str, Tensor]:
    """The weights of an ordinary network that is the mean of f and of its mirror image.

    The first layer sees o by W and M_o o by W M_o; further ones treat both alike; the last one is
    ½ [W, M_a W], of the value ½ [W, W]. Of the logarithms of the spread it has the mean.
    """
    return {name: _both(name, values, see, do) for name, values in weights.items()}


def _both(name: str, values: Tensor, see: Mirror, do: Mirror) -> Tensor:
    """One array of `both_sides`, by its name in SB3's state_dict."""
    import torch

    if name == "log_std":
        return 0.5 * (values + values[torch.as_tensor(do.order)])
    if name.startswith("action_net."):
        return _mean_of(values, _image_of_actions(values, do))
    if name.startswith("value_net."):
        return _mean_of(values, values)
    if values.dim() == 1:
        return torch.cat([values, values])
    if name.endswith("_net.0.weight"):
        return torch.cat([values, _of_image(values, see)])
    return torch.block_diag(values, values)


def _mean_of(values: Tensor, image: Tensor) -> Tensor:
    """A last layer, weight or bias, that gives the mean of two."""
    import torch

    return 0.5 * (torch.cat([values, image], 1) if values.dim() == 2 else values + image)


def _image_of_actions(values: Tensor, do: Mirror) -> Tensor:
    """M_a W, or M_a b."""
    import torch

    sign = torch.as_tensor(do.sign, dtype=values.dtype)
    return sign.reshape(-1, *[1] * (values.dim() - 1)) * values[torch.as_tensor(do.order)]


def _of_image(values: Tensor, see: Mirror) -> Tensor:
    """W M_o."""
    import torch

    image = torch.zeros_like(values)
    image[:, torch.as_tensor(see.order)] = values * torch.as_tensor(see.sign, dtype=values.dtype)
    return image
