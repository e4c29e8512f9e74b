"""A trained residual policy, ready to use: observation in, action out, plain NumPy."""

import io
import json
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch

from poise.baselines.residual_balance import ResidualBalanceEnv
from poise.envs.config import build, packaged_folder, read_yaml
from poise.envs.errors import ConfigError
from poise.envs.robot import Robot, load_robot

from .checkpoints import CONFIG, POLICY, STATE, STATISTICS
from .config import TrainConfig

SHIPPED = "residual"


class Policy:
    """The mean of a Gaussian actor: a = clip(W₃ tanh(W₂ tanh(W₁ ô)) , −1, 1), ô normalised."""

    def __init__(
        self,
        config: TrainConfig,
        layers: list[tuple[np.ndarray, np.ndarray]],
        mean: np.ndarray,
        var: np.ndarray,
        clip: float,
        epsilon: float,
        state: dict[str, Any],
    ):
        self.config, self.state = config, state
        self.layers = layers
        self._mean, self._scale = mean, 1.0 / np.sqrt(var + epsilon)
        self._clip = clip

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Deterministic action (..., na) for raw observations (..., no)."""
        x = np.clip((observation - self._mean) * self._scale, -self._clip, self._clip)
        for weight, bias in self.layers[:-1]:
            x = np.tanh(x @ weight + bias)
        weight, bias = self.layers[-1]
        return np.clip(x @ weight + bias, -1.0, 1.0)

    def make_env(self, **overrides: Any) -> ResidualBalanceEnv:
        """The environment that the policy was trained in; `overrides` as in `EnvConfig`."""
        return self.config.make_env(**overrides)


def load_policy(folder: str | Path | None = None, robot: Robot | None = None) -> Policy:
    """A policy folder, or the best checkpoint of a run folder; None: the shipped policy.

    Raises ConfigError naming the file when it is missing, truncated, made for another robot
    (of `robot`, or of the configuration's own) or has another number of observations or actions.
    No code from the files is executed.
    """
    path = _locate(folder)
    config = build(TrainConfig, read_yaml(path / CONFIG), str(path / CONFIG))
    state = _read_state(path / STATE)
    mean, var, clip, epsilon = _read_statistics(path / STATISTICS)
    layers = _read_weights(path / POLICY)
    robot = robot or load_robot(config.robot)
    if state.get("fingerprint") != robot.fingerprint:
        raise ConfigError(
            f"was trained for another robot than {robot.name!r} (fingerprints differ)",
            source=str(path / STATE),
            field="fingerprint",
        )
    sizes = (len(mean), layers[-1][0].shape[1])
    expected = (state.get("observations"), state.get("actions"))
    if layers[0][0].shape[0] != sizes[0] or sizes != expected:
        raise ConfigError(
            f"observations and actions are {layers[0][0].shape[0]} and {sizes[1]} in {POLICY}, "
            f"{sizes[0]} in {STATISTICS}, {expected[0]} and {expected[1]} in {STATE}",
            source=str(path),
        )
    return Policy(config, layers, mean, var, clip, epsilon, state)


def _locate(folder: str | Path | None) -> Path:
    if folder is None:
        path = packaged_folder("policies") / SHIPPED
    else:
        path = Path(folder)
        if (path / "best" / CONFIG).is_file():
            path = path / "best"
    for name in (CONFIG, POLICY, STATISTICS, STATE):
        if not (path / name).is_file():
            raise ConfigError(
                f"no {name}: a policy folder holds {CONFIG}, {POLICY}, {STATISTICS} and {STATE}",
                source=str(path),
            )
    return path


def _read_state(path: Path) -> dict[str, Any]:
    try:
        state = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot be read ({error})", source=str(path)) from None
    if not isinstance(state, dict):
        raise ConfigError("must hold a mapping", source=str(path))
    return state


def _read_statistics(path: Path) -> tuple[np.ndarray, np.ndarray, float, float]:
    try:
        with np.load(path, allow_pickle=False) as data:
            values = [np.asarray(data[k], dtype=float) for k in ("obs_mean", "obs_var")]
            clip, epsilon = float(data["clip_obs"]), float(data["epsilon"])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise ConfigError(f"cannot be read ({error})", source=str(path)) from None
    if not all(np.all(np.isfinite(v)) for v in values) or values[0].shape != values[1].shape:
        raise ConfigError("holds numbers that are not statistics", source=str(path))
    return values[0], values[1], clip, epsilon


def _read_weights(path: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    """(weight (in, out), bias) of the actor's layers, by torch's weights-only reader."""
    try:
        with zipfile.ZipFile(path) as archive:
            blob = io.BytesIO(archive.read("policy.pth"))
        weights = torch.load(blob, map_location="cpu", weights_only=True)
        names = sorted(
            {key.rsplit(".", 1)[0] for key in weights if key.startswith("mlp_extractor.policy_net")},
            key=lambda name: int(name.rsplit(".", 1)[1]),
        )
        layers = [
            (weights[f"{name}.weight"].double().numpy().T.copy(),
             weights[f"{name}.bias"].double().numpy().copy())
            for name in [*names, "action_net"]
        ]  # fmt: skip
    except (
        OSError, KeyError, ValueError, RuntimeError, EOFError, zipfile.BadZipFile,
        pickle.UnpicklingError,
    ) as error:  # fmt: skip
        raise ConfigError(f"cannot be read ({error})", source=str(path)) from None
    if not all(np.all(np.isfinite(array)) for layer in layers for array in layer):
        raise ConfigError("holds weights that are not finite", source=str(path))
    return layers
