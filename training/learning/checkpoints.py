"""A policy folder: policy.zip (SB3), vecnormalize.npz, config.yaml, state.json.

The folder is replaced as a whole: a reader, or a kill, finds the old one or the new one.
Nothing in it is unpickled on loading, see `policy_files.py`.
"""

import copy
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor

from poise.configs.errors import ConfigError, PoiseError
from poise.configs.reading import parsing
from poise.configs.schema import to_yaml

from .config import TrainConfig
from .policy_files import (
    CONFIG,
    MOMENTS,
    POLICY,
    STATE,
    STATISTICS,
    check_policy_robot,
    place_beside,
    read_parameters,
    read_state,
    read_statistics,
)

#: rebuilt by `PPO.load`, or valid in the running process only
LEFT_OUT = ("ep_info_buffer", "ep_success_buffer", "lr_schedule")
FEW = 1e5  # observations: a few rollouts


def save_checkpoint(
    folder: Path, model: PPO, normalize: VecNormalize, config: TrainConfig, state: dict[str, object]
) -> None:
    """Write the folder whole; raises PoiseError if it cannot be written."""
    new, old = place_beside(folder, "new"), place_beside(folder, "old")
    try:
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir(parents=True)
        plain_model(model).save(new / POLICY, exclude=LEFT_OUT)
        arrays: dict[str, Any] = statistics(normalize)
        np.savez(new / STATISTICS, **arrays)
        (new / CONFIG).write_text(to_yaml(config), "utf-8")
        (new / STATE).write_text(json.dumps(state, indent=1) + "\n", "utf-8")
        if folder.exists():
            shutil.rmtree(old, ignore_errors=True)
            os.replace(folder, old)
        os.replace(new, folder)
        shutil.rmtree(old, ignore_errors=True)
    except (OSError, RuntimeError) as error:  # torch has errors of its own for a full disk
        shutil.rmtree(new, ignore_errors=True)
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise PoiseError(f"{folder}: cannot be written ({reason})") from None


def plain_model(model: PPO) -> PPO:
    """Return the model with nothing in it that is defined by Poise, so that SB3 alone can load it.

    It shares the weights. Its learning rate is the one at the start. Of a symmetric policy it is
    the ordinary one, f, whose weights these are: see `symmetry.py` for what is made of it.
    """
    stock = copy.copy(model)
    stock.learning_rate = float(model.lr_schedule(1.0))
    stock.policy_class = ActorCriticPolicy
    stock.policy_kwargs = {k: v for k, v in model.policy_kwargs.items() if k != "mirrors"}
    return stock


def restore(
    folder: Path,
    model: PPO,
    normalize: VecNormalize,
    fingerprint: str,
    newest: int | None = None,
) -> dict[str, Any]:
    """Load weights, optimizer and statistics into `model` and `normalize`; returns the state.

    With `newest` the network of `model` may be larger than the stored one, whose observation is the
    part before that entry; the optimizer then starts afresh. Raises ConfigError naming the file
    that cannot be read or is for another robot than the one with this `fingerprint`.
    """
    state = read_state(folder / STATE)
    check_policy_robot(state, fingerprint, folder / STATE)
    parameters, own = read_parameters(folder / POLICY), model.policy.state_dict()
    stored = parameters["policy"]
    with parsing(folder / POLICY):
        if newest is None or _shapes(stored) == _shapes(own):
            model.set_parameters(parameters, exact_match=True, device="cpu")
        else:
            model.policy.load_state_dict(widened(stored, own, newest))
    restore_statistics(folder / STATISTICS, normalize, newest)
    return state


def _shapes(weights: Mapping[str, Tensor]) -> dict[str, torch.Size]:
    return {name: values.shape for name, values in weights.items()}


def restore_statistics(path: Path, normalize: VecNormalize, newest: int | None = None) -> None:
    """Load the moments of observations and returns into `normalize`; `newest` as of `restore`."""
    of: dict[str, Any] = {"obs": normalize.obs_rms, "ret": normalize.ret_rms}
    found = read_statistics(path, [f"{prefix}_{name}" for prefix in of for name in MOMENTS])
    if newest is not None:
        _spread(found, len(of["obs"].mean), newest)
    for key, value in found.items():
        prefix, name = key.split("_")
        if value.shape != np.shape(getattr(of[prefix], name)):
            raise ConfigError(f"{key} has shape {value.shape}", source=path)
        setattr(of[prefix], name, value[()])


def _spread(found: dict[str, np.ndarray], size: int, newest: int) -> None:
    """Take the moments of a frame for each that lies before `newest`, and 0 and 1 for the rest.

    Those of the rest have to be learned: the observations that they are of count for few.
    """
    frame = len(found["obs_mean"])
    if frame == size or frame == 0 or newest % frame:
        return
    for name, rest in (("obs_mean", 0.0), ("obs_var", 1.0)):
        wide = np.full(size, rest)
        wide[:newest] = np.tile(found[name], newest // frame)
        found[name] = wide
    found["obs_count"] = np.minimum(found["obs_count"], FEW)


def statistics(normalize: VecNormalize) -> dict[str, np.ndarray]:
    """Return the statistics that normalise observations and returns, as arrays."""
    arrays = {
        f"{prefix}_{name}": np.asarray(getattr(moments, name), dtype=float)
        for prefix, moments in (("obs", normalize.obs_rms), ("ret", normalize.ret_rms))
        for name in MOMENTS
    }
    arrays["clip_obs"] = np.asarray(normalize.clip_obs)
    arrays["epsilon"] = np.asarray(normalize.epsilon)
    return arrays


def widened(
    small: Mapping[str, Tensor], large: Mapping[str, Tensor], end: int | None = None
) -> dict[str, Tensor]:
    """Return weights of the network `large` with which it computes what `small` does.

    Weights W (out, in) and biases (out,) of both, of as many layers. The units that are new keep
    what comes in as initialised in `large`; nothing goes out of them yet: their columns are zero.
    What `small` is given lies in the input of `large` before `end`; None: at its start.

    Raises:
        ValueError: other layers, or a layer of `small` that is larger.
    """
    if small.keys() != large.keys():
        raise ValueError("has other layers")
    weights = {}
    for name, old in small.items():
        new = large[name].clone()
        if old.dim() != new.dim() or any(o > n for o, n in zip(old.shape, new.shape, strict=True)):
            raise ValueError(f"{name} has shape {tuple(old.shape)}, not {tuple(new.shape)} or less")
        place = [slice(length) for length in old.shape]
        if old.dim() == 2:
            new[: old.shape[0]] = 0.0
            if end is not None and name.split(".")[-2] == "0":  # of a first layer
                if old.shape[1] > end:
                    raise ValueError(f"{name} sees {old.shape[1]} numbers, not {end} or less")
                place[1] = slice(end - old.shape[1], end)
        new[tuple(place)] = old
        weights[name] = new
    return weights
