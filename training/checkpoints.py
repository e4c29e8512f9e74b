"""A policy folder: policy.zip (SB3), vecnormalize.npz, config.yaml, state.json.

The folder is replaced as a whole: a reader, or a kill, finds the old one or the new one.
Nothing in it is unpickled on loading: weights by torch's weights-only reader, statistics as
plain arrays, the rest as YAML and JSON.
"""

import hashlib
import json
import os
import pickle
import shutil
import zipfile
import zlib
from pathlib import Path
from typing import Any, cast

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.vec_env import VecNormalize
from torch import Tensor

from poise.baselines.registry import controller_config
from poise.envs.config import to_yaml
from poise.envs.errors import ConfigError, PoiseError

from .config import TrainConfig
from .widening import widened

POLICY, STATISTICS, CONFIG, STATE = "policy.zip", "vecnormalize.npz", "config.yaml", "state.json"
FILES = (POLICY, STATISTICS, CONFIG, STATE)
_MOMENTS = ("mean", "var", "count")

#: What reading a file that is missing, truncated or something else may raise.
UNREADABLE = (
    *(OSError, ValueError, KeyError, IndexError, TypeError, AttributeError, RuntimeError, EOFError),
    *(zipfile.BadZipFile, zlib.error, pickle.UnpicklingError),
)


def save_checkpoint(
    folder: Path, model: PPO, normalize: VecNormalize, config: TrainConfig, state: dict[str, Any]
) -> None:
    """Write the folder whole; raises PoiseError when the disk refuses."""
    new, old = _beside(folder, "new"), _beside(folder, "old")
    try:
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir(parents=True)
        model.save(new / POLICY, exclude=["ep_info_buffer", "ep_success_buffer"])
        arrays: dict[str, Any] = statistics(normalize)
        np.savez(new / STATISTICS, **arrays)
        (new / CONFIG).write_text(to_yaml(config))
        (new / STATE).write_text(json.dumps(state, indent=1) + "\n")
        if folder.exists():
            shutil.rmtree(old, ignore_errors=True)
            os.replace(folder, old)
        os.replace(new, folder)
        shutil.rmtree(old, ignore_errors=True)
    except OSError as error:
        raise PoiseError(f"{folder}: cannot be written ({error.strerror})") from None


def find_checkpoint(folder: Path) -> Path | None:
    """The folder, or what a kill in the middle of a replacement left of it."""
    for candidate in (folder, _beside(folder, "old")):
        if all((candidate / name).is_file() for name in FILES):
            return candidate
    return None


def restore(
    folder: Path, model: PPO, normalize: VecNormalize, fingerprint: str, wider: bool = False
) -> dict[str, Any]:
    """Load weights, optimizer and statistics into `model` and `normalize`; returns the state.

    With `wider` the network of `model` may be larger than the stored one; its optimizer then
    begins anew. Raises ConfigError naming the file that cannot be read or is for another robot
    than the one with this `fingerprint`.
    """
    state = read_state(folder / STATE)
    check_robot(state, fingerprint, folder / STATE)
    path = folder / POLICY
    try:
        if not (wider and _load_into_wider(path, model)):
            model.set_parameters(str(path), exact_match=True, device="cpu")
        path = folder / STATISTICS
        with np.load(path, allow_pickle=False) as data:
            for prefix, moments in (("obs", normalize.obs_rms), ("ret", normalize.ret_rms)):
                for name in _MOMENTS:
                    value = np.asarray(data[f"{prefix}_{name}"], dtype=float)
                    if value.shape != np.shape(getattr(moments, name)):
                        raise ValueError(f"{prefix}_{name} has shape {value.shape}")
                    setattr(moments, name, value[()])
    except UNREADABLE as error:
        raise unreadable(path, error) from None
    return state


def _load_into_wider(path: Path, model: PPO) -> bool:
    """Load the weights if the network of `model` is another one than the stored; else False."""
    archive = load_from_zip_file(path, load_data=False, device="cpu")
    stored = cast(dict[str, Tensor], archive[1]["policy"])
    own = model.policy.state_dict()
    if {n: w.shape for n, w in stored.items()} == {n: w.shape for n, w in own.items()}:
        return False
    model.policy.load_state_dict(widened(stored, own))
    return True


def read_state(path: Path) -> dict[str, Any]:
    """The mapping in a state.json; raises ConfigError naming the file."""
    try:
        state = json.loads(path.read_text())
        if not isinstance(state, dict):
            raise ValueError("not a mapping")
        if type(state["timesteps"]) is not int:
            raise ValueError("timesteps is not a whole number")
    except UNREADABLE as error:
        raise unreadable(path, error) from None
    return state


def check_robot(state: dict[str, Any], fingerprint: str, path: Path) -> None:
    """Raise ConfigError unless the policy was trained for the robot with this fingerprint."""
    if state.get("fingerprint") != fingerprint:
        raise ConfigError(
            f"trained for another robot, {state.get('robot')!r}, or another version of it",
            source=path,
            field="fingerprint",
        )


def check_controller(state: dict[str, Any], config: TrainConfig, path: Path) -> None:
    """Raise ConfigError unless the controller still has the gains that the policy learned on."""
    if state.get("controller_fingerprint") != controller_fingerprint(config):
        raise ConfigError(
            f"trained on another version of the controller {config.controller!r}",
            source=path,
            field="controller_fingerprint",
        )


def controller_fingerprint(config: TrainConfig) -> str:
    """Hash of the configuration of the controller below the policy; empty if there is none."""
    if config.action == "torque":
        return ""
    return hashlib.sha256(to_yaml(controller_config(config.controller)).encode()).hexdigest()


def unreadable(path: Path, error: BaseException) -> ConfigError:
    """The ConfigError for a file whose reading raised `error`."""
    return ConfigError(f"cannot be read ({type(error).__name__}: {error})", source=path)


def statistics(normalize: VecNormalize) -> dict[str, np.ndarray]:
    """What normalises observations and returns, as arrays."""
    arrays = {
        f"{prefix}_{name}": np.asarray(getattr(moments, name), dtype=float)
        for prefix, moments in (("obs", normalize.obs_rms), ("ret", normalize.ret_rms))
        for name in _MOMENTS
    }
    arrays["clip_obs"] = np.asarray(normalize.clip_obs)
    arrays["epsilon"] = np.asarray(normalize.epsilon)
    return arrays


def _beside(folder: Path, suffix: str) -> Path:
    folder = Path(os.path.abspath(folder))  # "." has no name
    return folder.parent / f".{folder.name}.{suffix}"
