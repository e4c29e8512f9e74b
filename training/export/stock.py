"""The policy as Stable-Baselines3's own, which its `PPO.load` reads without Poise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from poise.envs.robots.mirror import Mirror
from poise.training.learning.policy import Policy

if TYPE_CHECKING:
    from torch import Tensor

STATISTICS = "vec_normalize.pkl"  # the name that huggingface_sb3 gives it
TOLERANCE = 1e-4  # of an action: SB3 computes with 32 bits


def write_stock(folder: Path, name: str, policy: Policy, source: Path) -> None:
    """Write NAME.zip for `PPO.load` and the statistics for `VecNormalize.load`.

    `source` is the policy's folder. A symmetric policy becomes an ordinary one that is twice as
    wide, and as symmetric. The optimizer begins anew. Raises PoiseError where what SB3 makes of an
    observation differs by more than `TOLERANCE`.
    """
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecNormalize

    from poise.training.learning.checkpoints import LEFT_OUT, plain
    from poise.training.learning.policy_files import read_weights
    from poise.training.learning.train import make_model
    from poise.training.learning.vec_env import ThreadedVecEnv

    from .check import compared, observations

    weights = read_weights(source / "policy.zip")
    config = policy.config
    ppo = replace(config.ppo, n_envs=1, symmetric=False)
    if policy.mirrors is not None:
        weights = both_sides(weights, *policy.mirrors)
        critic = None if ppo.critic_arch is None else _twice(ppo.critic_arch)
        ppo = replace(ppo, net_arch=_twice(ppo.net_arch), critic_arch=critic)
    normalize = VecNormalize(ThreadedVecEnv([policy.make_env()]), gamma=ppo.gamma)
    _set_statistics(normalize, source)
    model = make_model(replace(config, ppo=ppo), normalize)
    model.policy.load_state_dict(weights)
    model.num_timesteps = int(policy.state["timesteps"])
    path = folder / f"{name}.zip"
    plain(model).save(path, exclude=LEFT_OUT)
    normalize.save(str(folder / STATISTICS))
    seen = observations(policy, 1000)
    actions, _ = PPO.load(path, device="cpu").predict(
        normalize.normalize_obs(seen), deterministic=True
    )
    normalize.close()
    compared(actions, policy.predict(seen)[0], TOLERANCE, path.name)


def _twice(widths: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(2 * width for width in widths)


def _set_statistics(normalize: Any, source: Path) -> None:
    """Give SB3's normalisation the policy's numbers; it no longer learns, and leaves rewards."""
    from poise.training.learning.policy_files import MOMENTS, read_statistics

    moments = {"obs": normalize.obs_rms, "ret": normalize.ret_rms}
    names = [f"{prefix}_{name}" for prefix in moments for name in MOMENTS]
    found = read_statistics(source / "vecnormalize.npz", [*names, "clip_obs", "epsilon"])
    for prefix, of in moments.items():
        for name in MOMENTS:
            setattr(of, name, found[f"{prefix}_{name}"][()])
    normalize.clip_obs, normalize.epsilon = float(found["clip_obs"]), float(found["epsilon"])
    normalize.training = normalize.norm_reward = False


def both_sides(weights: dict[str, Tensor], see: Mirror, do: Mirror) -> dict[str, Tensor]:
    """The weights of an ordinary network that is the mean of f and of its mirror image.

    The first layer sees o by W and M_o o by W M_o; further ones treat both alike; the last one is
    ½ [W, M_a W], of the value ½ [W, W].
    """
    import torch

    def mirrored(values: Tensor) -> Tensor:
        sign = torch.as_tensor(do.sign, dtype=values.dtype)
        rows = values[torch.as_tensor(do.order)]
        return sign[:, None] * rows if values.dim() == 2 else sign * rows

    wide: dict[str, Tensor] = {}
    for name, values in weights.items():
        if name == "log_std":
            wide[name] = 0.5 * (values + values[torch.as_tensor(do.order)])
        elif name.startswith("action_net."):
            sides = values, mirrored(values)
            wide[name] = 0.5 * (torch.cat(sides, 1) if values.dim() == 2 else sides[0] + sides[1])
        elif name.startswith("value_net."):
            wide[name] = 0.5 * torch.cat([values, values], 1) if values.dim() == 2 else values
        elif values.dim() == 1:
            wide[name] = torch.cat([values, values])
        elif name.rsplit(".", 2)[1] == "0":  # what comes in
            image = torch.zeros_like(values)
            image[:, torch.as_tensor(see.order)] = values * torch.as_tensor(
                see.sign, dtype=values.dtype
            )
            wide[name] = torch.cat([values, image])
        else:
            wide[name] = torch.block_diag(values, values)
    return wide

