"""The files of a policy folder, found, read and checked: statistics, weights, the optimizer.

Nothing is unpickled: weights come by torch's weights-only reader, statistics as plain arrays. torch
itself is loaded with the first weights: what has none of its own does without it.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from poise.baselines.balance.stepping.planning.config import CaptureStepConfig
from poise.baselines.registry import controller_config
from poise.configs.archives import Archive, read_archive, read_arrays
from poise.configs.errors import ConfigError, shown
from poise.configs.reading import is_file, read_json
from poise.configs.schema import to_yaml

from .config import TrainConfig

if TYPE_CHECKING:
    from torch import Tensor

LAST, BEST, KEPT = "last", "best", "kept"  # folders of a run; `KEPT` has policies by their steps
POLICY, STATISTICS, CONFIG, STATE = "policy.zip", "vecnormalize.npz", "config.yaml", "state.json"
FILES = (POLICY, STATISTICS, CONFIG, STATE)
MOMENTS = ("mean", "var", "count")
#: The smallest and the largest of each number; what training gives lies far inside.
RANGES = {
    "mean": (-1e6, 1e6),
    "var": (0.0, 1e12),
    "count": (1e-9, 1e15),
    "clip_obs": (1e-3, 1e3),
    "epsilon": (1e-12, 1.0),
}
WEIGHT = 1e6  # the largest
STEPS = 10**15  # of training
_VALUES = 100_000  # in a member


def find_checkpoint(folder: Path) -> Path | None:
    """Return the folder, or what a kill in the middle of a replacement left of it."""
    for candidate in (folder, place_beside(folder, "old")):
        if all(is_file(candidate / name) for name in FILES):
            return candidate
    return None


def place_beside(folder: Path, suffix: str) -> Path:
    """Return the place where a folder is built, or kept, while it is replaced."""
    folder = Path(os.path.abspath(folder))  # "." has no name
    return folder.parent / f".{folder.name}.{suffix}"


def check_policy_robot(
    state: dict[str, object], fingerprint: str, path: Path, name: str | None = None
) -> None:
    """Raise ConfigError unless the policy was trained for the robot with this fingerprint, and
    `name`, if that is known."""
    if state.get("fingerprint") != fingerprint:
        trained = state.get("robot")
        now = " as it was then" if name in (None, trained) else f", not on {shown(name)}"
        raise ConfigError(
            f"the policy was trained on the robot {shown(trained)}{now}: name that one, or train a "
            "policy on this one",
            source=path,
            field="robot",
        )


def check_controller(state: dict[str, object], config: TrainConfig, path: Path) -> None:
    """Raise ConfigError unless the controller still has the gains that the policy learned on."""
    if state.get("controller_fingerprint") != controller_fingerprint(config):
        raise ConfigError(
            f"the policy was trained on other gains of the controller {shown(config.controller)}",
            source=path,
            field="controller",
        )


def controller_fingerprint(config: TrainConfig) -> str:
    """Return a hash of the configuration of the controller below the policy; empty without one.

    Which other one takes its place where state and robot are uncertain does not count: the gains
    that are learned on stay as they are.
    """
    if not config.controlled:
        return ""
    below = controller_config(config.controller)
    if isinstance(below, CaptureStepConfig):
        below = replace(below, uncertain=None, uncertain_from=0.0)
    return hashlib.sha256(to_yaml(below).encode()).hexdigest()


def read_state(path: Path) -> dict[str, Any]:
    """Return the mapping in a state.json; raises ConfigError naming the file."""
    state = read_json(path)
    steps = state.get("timesteps")
    if type(steps) is not int or not 0 <= steps <= STEPS:
        raise ConfigError(f"must be a whole number from 0 to {STEPS:.0e}", source=path,
                          field="timesteps")  # fmt: skip
    return state


def last_state(run: Path) -> dict[str, Any]:
    """What the last checkpoint of a run's folder says; 0 `timesteps` as long as there is none."""
    checkpoint = find_checkpoint(run / LAST)
    begun = {} if checkpoint is None else read_state(checkpoint / STATE)
    return {"timesteps": 0, "evaluations": [], **begun}


def read_statistics(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return arrays of vecnormalize.npz by name, such as ``obs_mean`` (no,), ``clip_obs`` ().

    Raises ConfigError for one that is missing, of another type than floats, not finite, or beyond
    what statistics may be (`RANGES`).
    """
    arrays = read_arrays(path, names)
    for name, values in arrays.items():
        low, high = RANGES[name if name in RANGES else name.rpartition("_")[2]]
        wrong = values[~((values >= low) & (values <= high))]  # NaN too
        if wrong.size:
            raise ConfigError(
                f"holds numbers that are not statistics: {name} must be from {low:g} to {high:g}, "
                f"not {wrong[0]:g}", source=path,
            )  # fmt: skip
    return arrays


def read_weights(path: Path) -> dict[str, Tensor]:
    """Return the state_dict of the network in policy.zip.

    Raises ConfigError for anything but finite floats of at most `WEIGHT`.
    """
    return _weights(read_archive(path), path)


def read_parameters(path: Path) -> dict[str, Any]:
    """Return the state_dicts of the network and its optimizer in policy.zip, as SB3 names them.

    Raises ConfigError as `read_weights`.
    """
    archive, optimizer = read_archive(path), "policy.optimizer"
    return {"policy": _weights(archive, path), optimizer: _member(archive, path, optimizer)}


def _weights(archive: Archive, path: Path) -> dict[str, Tensor]:
    import torch

    weights = _member(archive, path, "policy")
    if not isinstance(weights, dict):
        raise ConfigError("policy.pth holds no weights", source=path)
    for name, value in weights.items():
        if not isinstance(name, str) or not isinstance(value, torch.Tensor):
            raise ConfigError(f"policy.pth holds no weights: {name!s:.80} is a "
                              f"{type(value).__name__}", source=path)  # fmt: skip
        if value.numel() and value.abs().max() > WEIGHT:
            raise ConfigError(f"{name}: weights must be at most {WEIGHT:g}", source=path)
    return weights


def _member(archive: Archive, path: Path, part: str) -> Any:
    """The content that torch saved in a member of policy.zip; its tensors are finite floats."""
    import torch

    data = archive.read(f"{part}.pth")
    Archive(data, f"{path}: {part}.pth")  # torch's own format is a zip file too
    try:
        value = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
    except Exception as error:  # torch's text advises to unpickle it nevertheless
        why = f"{part}.pth must hold tensors and nothing that is run ({type(error).__name__})"
        raise ConfigError(f"cannot be read: {why}", source=path) from None
    for tensor in _tensors(value, path):
        if tensor.dtype not in (torch.float32, torch.float64) or tensor.layout is not torch.strided:
            raise ConfigError(f"holds weights of {tensor.dtype}: they must be 32- or 64-bit floats",
                              source=path)  # fmt: skip
        if tensor.numel() * tensor.element_size() > len(data):  # a few bytes that are repeated
            raise ConfigError("holds weights that are larger than their file", source=path)
        if not torch.isfinite(tensor).all():
            raise ConfigError("holds weights that are not finite", source=path)
    return value


def _tensors(value: object, path: Path) -> Iterator[Tensor]:
    """Yield all tensors in mappings, lists and tuples of these."""
    import torch

    waiting, seen = [value], 0
    while waiting:
        seen += 1
        if seen > _VALUES:
            raise ConfigError(f"holds more than {_VALUES} values", source=path)
        each = waiting.pop()
        if isinstance(each, torch.Tensor):
            yield each
        elif isinstance(each, dict):
            waiting += each.values()
        elif isinstance(each, (list, tuple)):
            waiting += each
