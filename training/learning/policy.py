"""A trained policy, ready to use: observation in, action out, plain NumPy."""

import warnings
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.allowance import allowing, carrying_allowance
from poise.configs.errors import ConfigError, PoiseWarning
from poise.configs.files import packaged, packaged_folder, resolve
from poise.configs.reading import is_file, is_folder, parsing
from poise.configs.schema import build, read_yaml, to_dict
from poise.envs.balance.base import BalanceEnv
from poise.envs.compiled.copies import Copyable
from poise.envs.robots.mirror import Mirror
from poise.envs.robots.robot import Robot, in_physics_of, load_robot, read_description

from .config import TrainConfig, train_config
from .policy_files import (
    BEST,
    CONFIG,
    FILES,
    POLICY,
    STATE,
    STATISTICS,
    check_controller,
    check_policy_robot,
    find_checkpoint,
    read_state,
    read_statistics,
    read_weights,
)

SHIPPED = "residual-torque"
ACTOR = "mlp_extractor.policy_net."  # SB3's name of the actor's hidden layers


def elu(x: np.ndarray) -> np.ndarray:
    """x above 0, eˣ − 1 below."""
    return np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0)))


ACTIVATIONS: dict[str, Callable[[np.ndarray], np.ndarray]] = {"tanh": np.tanh, "elu": elu}


class Policy(Copyable):
    """The mean of a Gaussian actor: a = clip(W₃ f(W₂ f(W₁ ô + b₁) + b₂) + b₃, −1, 1).

    ô = clip((o − mean)/√(var + ε), ±clip) is the normalised observation, f the activation, tanh or
    ELU, after each of the hidden layers, of which there may be any number. With `mirrors` a is the
    mean of it and of its mirror image, see `symmetry.py`.

    Attributes:
        config: the run's configuration.
        state: what its state.json says (steps, robot, evaluations).
        layers: (W (in, out), b (out,)) of each layer.
        mean, scale: (no,) of the observation's normalisation, scale = 1/√(var + ε).
        clip: of the normalised observation.
        mirrors: of an observation and of an action, or None.
    """

    def __init__(
        self,
        config: TrainConfig,
        layers: list[tuple[np.ndarray, np.ndarray]],
        mean: np.ndarray,
        var: np.ndarray,
        clip: float,
        epsilon: float,
        state: dict[str, Any],
        mirrors: tuple[Mirror, Mirror] | None = None,
    ):
        self.config, self.state = config, state
        self.mirrors = mirrors
        self.layers = layers
        self.mean, self.scale = mean, 1.0 / np.sqrt(var + epsilon)
        self.clip = clip
        self._activation = ACTIVATIONS[config.ppo.activation]
        self._make_env = carrying_allowance(config.make_env)

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Return the deterministic action (..., na) for raw observations (..., no).

        An observation gives the same bits alone as in a batch: each is a product of its own.
        """
        mean = self._mean_action(observation)
        if self.mirrors is not None:
            seen, done = self.mirrors
            mean = 0.5 * (mean + done(self._mean_action(seen(observation))))
        return np.clip(mean, -1.0, 1.0)

    def predict(
        self,
        observation: np.ndarray,
        state: tuple[np.ndarray, ...] | None = None,
        episode_start: np.ndarray | None = None,
        deterministic: bool = True,
    ) -> tuple[np.ndarray, None]:
        """`act` as Stable-Baselines3 calls it, for code that takes one of its models.

        Args:
            observation: (..., no), raw.
            state: ignored: the policy has no memory.
            episode_start: ignored.
            deterministic: must be true: of the Gaussian only the mean is kept.

        Returns:
            The action (..., na), float32 as the environment's action space, and None.

        Raises:
            ConfigError: `deterministic` is false.
        """
        if not deterministic:
            raise ConfigError("has the mean of its actions only, no random ones",
                              source="policy", field="deterministic")  # fmt: skip
        return self.act(observation).astype(np.float32), None

    def _mean_action(self, observation: np.ndarray) -> np.ndarray:
        x = np.clip((observation - self.mean) * self.scale, -self.clip, self.clip)
        x = x[..., None, :]
        for weight, bias in self.layers[:-1]:
            x = self._activation(x @ weight + bias)
        weight, bias = self.layers[-1]
        return (x @ weight + bias)[..., 0, :]

    def content(self) -> list[bytes]:
        """Return the bytes of all that decides the policy's actions."""
        layers = [array for layer in self.layers for array in layer]
        sides = [] if self.mirrors is None else [m.sign * (1 + m.order) for m in self.mirrors]
        numbers = [*layers, self.mean, self.scale, np.array(self.clip), *sides]
        return [array.tobytes() for array in numbers]

    def make_env(self, **overrides: Any) -> BalanceEnv:
        """Return the environment that the policy was trained in; `overrides` as in `EnvConfig`."""
        return self._make_env(**overrides)


def load_policy(
    folder: str | Path | None = None,
    robot: Robot | None = None,
    *,
    allow: str | Iterable[str] = (),
) -> Policy:
    """Return a packaged policy, a policy folder, or the best checkpoint of a run folder.

    None is the packaged policy ``residual-torque``. No code from the files is executed, nor any
    that they name: a policy on an external controller needs `allow`, the names
    (``module:Class``) that may run.

    A `robot` that differs from the policy's by its description's `options` alone, such as the time
    step, is taken, and a warning says which.

    Raises ConfigError naming the file when it is missing, truncated, made for another robot
    (of `robot`, or of the configuration's own), has another number of observations or actions, or
    names an external controller that is not allowed.
    """
    path = locate_policy(folder)
    with allowing(allow, source=path / CONFIG):
        return _read_policy(path, robot)


def make_env(
    name: str | Path | TrainConfig | Policy | None = None,
    *,
    allow: str | Iterable[str] = (),
    **overrides: Any,
) -> BalanceEnv:
    """Return the environment of a policy, or of a training configuration.

    Args:
        name: a policy, or what `load_policy` takes; or a `TrainConfig`, a packaged name of one or
            its .yaml file. None is the packaged policy ``residual-torque``.
        allow: as of `load_policy`.
        overrides: arguments of the environment, or fields of its `EnvConfig`.

    Raises ConfigError for a name of neither, and as `load_policy`.
    """
    if isinstance(name, (TrainConfig, Policy)):
        with allowing(allow):
            return name.make_env(**overrides)
    is_training = Path(name or "").suffix in (".yaml", ".yml") or (
        name in packaged("training") and name not in packaged("policies")
    )
    if name is not None and is_training:
        with allowing(allow, source=str(name)):
            return train_config(name).make_env(**overrides)
    return load_policy(name, allow=allow).make_env(**overrides)


def _read_policy(path: Path, robot: Robot | None) -> Policy:
    config = build(TrainConfig, read_yaml(path / CONFIG), str(path / CONFIG))
    state = read_state(path / STATE)
    mean, var, clip, epsilon = _read_statistics(path / STATISTICS)
    layers = _read_weights(path / POLICY)
    robot = robot or load_robot(config.robot)
    if not _in_other_physics(config, robot, state):
        check_policy_robot(state, robot.fingerprint, path / STATE, robot.name)
    check_controller(state, config, path / STATE)
    env = config.make_env(robot)
    seen, outputs = env.observation_space.shape[0], env.action_space.shape[0]
    hidden = env.terms_by_name(config.env.observation.privileged)  # seen by the critic alone
    inputs = seen + sum(term.size for term in hidden)
    for name, what, size, expected in (
        (STATISTICS, "observations", len(mean), inputs),
        (POLICY, "observations", layers[0][0].shape[0], inputs),
        (POLICY, "actions", layers[-1][0].shape[1], outputs),
    ):
        if size != expected:
            raise ConfigError(
                f"is for {size} {what}, the environment has {expected}", source=path / name
            )
    mirrors = env.mirrors() if config.ppo.symmetric else None
    mean, var, layers[0] = mean[:seen], var[:seen], (layers[0][0][:seen], layers[0][1])
    return Policy(config, layers, mean, var, clip, epsilon, state, mirrors)


def _in_other_physics(config: TrainConfig, robot: Robot, state: dict[str, Any]) -> bool:
    """Whether a policy's robot differs from the one it was trained on by simulation options alone;
    a warning then says which."""
    if state.get("fingerprint") == robot.fingerprint or config.robot not in packaged("robots"):
        return False
    trained = read_description(resolve("robots", config.robot))
    before, now = to_dict(trained.options), to_dict(robot.description.options)
    differ = [name for name in now if now[name] != before[name]]
    alike = differ and in_physics_of(robot, trained).fingerprint == state.get("fingerprint")
    if not alike:
        return False
    words = [f"{name} {_option(now[name])} instead of {_option(before[name])}" for name in differ]
    warnings.warn(f"{config.robot}: simulated otherwise than the policy was trained: "
                  f"{', '.join(words)}", PoiseWarning, stacklevel=4)  # fmt: skip
    return True


def _option(value: object) -> str:
    return "the model's own" if value is None else str(value)


def locate_policy(folder: str | Path | None) -> Path:
    """Return the folder that `load_policy` reads; raises ConfigError where there is none."""
    name = SHIPPED if folder is None else str(folder)
    if name in packaged("policies"):
        path = packaged_folder("policies") / name
    else:
        path = Path(name)
        path = find_checkpoint(path / BEST) or find_checkpoint(path) or path
        if not is_folder(path):
            raise ConfigError(
                "no such folder, and no packaged policy", source=path, choices=packaged("policies")
            )
    for name in FILES:
        if not is_file(path / name):
            raise ConfigError(
                f"no {name}: a policy folder holds {', '.join(FILES)}", source=path, field=name
            )
    return path


def _read_statistics(path: Path) -> tuple[np.ndarray, np.ndarray, float, float]:
    found = read_statistics(path, ("obs_mean", "obs_var", "clip_obs", "epsilon"))
    mean, var, clip, epsilon = found.values()
    if mean.ndim != 1 or mean.shape != var.shape or clip.shape or epsilon.shape:
        raise ConfigError("holds numbers that are not statistics: they have other shapes",
                          source=path)  # fmt: skip
    return mean, var, float(clip), float(epsilon)


def _read_weights(path: Path) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return (weight (in, out), bias) of the actor's layers."""
    weights = read_weights(path)
    with parsing(path):
        actor = [key.rsplit(".", 1)[0] for key in weights if key.startswith(ACTOR)]
        names = sorted(set(actor), key=lambda name: int(name.rsplit(".", 1)[1]))
        layers = [
            (weights[f"{name}.weight"].double().numpy().T.copy(),
             weights[f"{name}.bias"].double().numpy().copy())
            for name in [*names, "action_net"]
        ]  # fmt: skip
        if any(weight.ndim != 2 for weight, _ in layers):
            raise ValueError("a layer is no matrix")
        if any(a[0].shape[1] != b[0].shape[0] for a, b in pairwise(layers)):
            raise ValueError("layers do not fit each other")
        if any(bias.shape != (weight.shape[1],) for weight, bias in layers):
            raise ValueError("a bias does not fit its layer")
    return layers
