"""An external policy as the first weights of a run: what it did is where learning begins.

Its observations and actions are affine in those of the environment, so that its network becomes
the actor's, number by number: nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize

from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.policy_files.config import ObservationTerm, PolicyFileConfig
from poise.baselines.policy_files.joints import joint_servos
from poise.baselines.policy_files.layers import NetworkLayers, read_layers
from poise.baselines.policy_files.terms import meaning
from poise.configs.errors import ConfigError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv

from .symmetry import MirroredMeanStd

FIRM = 1e12  # observations that the imported statistics count for: they stay as they are
AUTHORITY = 1.0  # of the imported policy: it takes over wherever it may

COMMAND = ("command_velocity", "command_turn")  #: terms of an environment that has a command
#: a policy's term, the environment's, and the unit of this: a factor, and a field of `Scales`
SAME = {
    "base_ang_vel": ("root_rate", 1.0, "omega"),
    "base_lin_vel": ("root_vel", 1.0, "velocity"),
    "projected_gravity": ("gravity", 1.0, None),
    "joint_pos": ("joint_pos", 1.0, None),
    "joint_pos_rel": ("joint_pos", 1.0, None),
    "joint_vel": ("joint_vel", 3.0, "omega"),
    "last_action": ("last_action", 1.0, None),
}


@dataclass(frozen=True, eq=False)
class Affine:
    """x = gain · o[index] + offset; an index of −1 stands for a constant, `offset`."""

    index: np.ndarray  # (n,) int
    gain: np.ndarray  # (n,)
    offset: np.ndarray  # (n,)

    def scaled(self, scale: float | tuple[float, ...]) -> Affine:
        """Its numbers times `scale`."""
        return Affine(self.index, self.gain * scale, self.offset * scale)


class Translation:
    """Between a policy's observations and actions and those of an environment with servos.

    Raises ConfigError for an environment without servos, for a law of attitude, and as
    `joint_servos` does.
    """

    def __init__(self, env: BalanceEnv, config: PolicyFileConfig):
        if not isinstance(env, (PositionBalanceEnv, ResidualWholeEnv)):
            raise ConfigError(
                "must be position or whole to start from joint targets", field="action"
            )
        self.env, self.config = env, config
        self.joints = joint_servos(env.robot, config)
        if np.any(self.joints.law):
            raise ConfigError("targets that follow the attitude cannot be imported",
                              source=config.described_in, field="law")  # fmt: skip
        driven = [int(dof) - 6 for dof in env.servos.dofs]
        motors = np.array([driven.index(int(joint)) for joint in self.joints.moved])
        after = 1 if isinstance(env, ResidualWholeEnv) else 0  # entries behind the motors'
        #: (na,) int: the environment's entry of each of the policy's actions
        self.entries = len(env.action_names) - after - len(driven) + motors
        # action of the environment = gain · action of the policy + offset
        reach, hold = env.servos.reach[motors], env.servos.hold[motors]
        self.gain = self.joints.scale / reach
        self.offset = (self.joints.offset - hold) / reach
        places = np.cumsum([0, *(term.size for term in env.terms)])
        self._places = {
            term.name: np.arange(first, first + term.size)
            for term, first in zip(env.terms, places, strict=False)
        }

    def observation(self) -> Affine:
        """Return the policy's observation as a function of the environment's.

        Raises ConfigError for a term that the environment's lacks, in an older step than its
        observation has, with limits, or in part.
        """
        (terms, *more) = self.config.inputs.values()
        if more:
            raise self._wrong(0, "with several inputs it cannot be imported")
        if self.config.history == "frame":
            order = [(i, term, age) for age in _ages(terms[0]) for i, term in enumerate(terms)]
        else:
            order = [(i, term, age) for i, term in enumerate(terms) for age in _ages(term)]
        parts = [self._term(*each) for each in order]
        columns = [[p.index for p in parts], [p.gain for p in parts], [p.offset for p in parts]]
        return Affine(*(np.concatenate(column) for column in columns))

    def _term(self, i: int, described: ObservationTerm, age: int) -> Affine:
        name = meaning(described)
        plain = replace(described, history=1, lag=0, newest_first=False)
        if described.frame or plain != ObservationTerm(described.term, described.scale):
            raise self._wrong(
                i, "with limits it cannot be imported, nor with zeros before the start, nor in part"
            )
        if isinstance(described.scale, dict):
            raise self._wrong(i, "with factors by name it cannot be imported")
        if name == "velocity_commands":
            return self._command(i, age).scaled(described.scale)
        own, factor, unit = SAME.get(name, (None, 1.0, None))
        if own not in self._places:
            raise self._wrong(i, f"the environment does not tell {name}")
        index = self._shown(i, own, age)
        if own == "last_action":
            entries = Affine(index[self.entries], 1.0 / self.gain, -self.offset / self.gain)
            return entries.scaled(described.scale)
        if own in ("joint_pos", "joint_vel"):
            index = index[self.joints.index]
        gain = factor * (getattr(self.env.scales, unit) if unit else 1.0)
        offset = np.zeros(len(index))
        if own == "joint_pos":
            offset = offset + self.env.arrays.q_standing[self.joints.index]
        if name == "joint_pos_rel":
            offset = offset - self.joints.default
        return Affine(index, np.full(len(index), gain), offset).scaled(described.scale)

    def _command(self, i: int, age: int) -> Affine:
        """Return the command: that of the environment, or the policy's own where there is none."""
        places = [self._shown(i, name, age) for name in COMMAND if name in self._places]
        if not places:
            return Affine(np.full(3, -1), np.ones(3), np.array(self.config.command))
        units = [self.env.scales.velocity] * 2 + [0.2 * self.env.scales.omega]
        return Affine(np.concatenate(places), np.array(units), np.zeros(3))

    def _shown(self, i: int, own: str, age: int) -> np.ndarray:
        """Return the places of the environment's term `own` as it was `age` policy steps ago."""
        shown = f"{own}[-{age}]" if age else own
        if shown not in self._places:
            raise self._wrong(i, f"shows {own} of {age} steps ago: observation.history must be "
                              f"{age + 1} or more")  # fmt: skip
        return self._places[shown]

    def _wrong(self, i: int, problem: str) -> ConfigError:
        return ConfigError(problem, source=self.config.described_in, field=f"observations[{i}]",
                           choices=self._places)  # fmt: skip

    def last_layer(self, weight: np.ndarray, bias: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The policy's last layer as the actor's; entries that it does not have are constant."""
        n = len(self.env.action_names)
        weights, biases = np.zeros((n, weight.shape[1])), np.zeros(n)
        weights[self.entries] = self.gain[:, None] * weight
        biases[self.entries] = self.gain * bias + self.offset
        if isinstance(self.env, ResidualWholeEnv):
            biases[-1] = AUTHORITY
        return weights, biases


def _ages(term: ObservationTerm) -> list[int]:
    """Return the policy steps ago that a term shows, in the order in which it shows them."""
    ages = list(range(term.lag, term.lag + term.history))
    return ages if term.newest_first else ages[::-1]


def import_policy(
    config: PolicyFileConfig, env: BalanceEnv, model: PPO, normalize: VecNormalize
) -> None:
    """Make the actor of `model`, which acts in `env`, do what the policy `config` does.

    The statistics that normalise its observations become the policy's own, and stay. Inputs that
    it does not know have weights of zero. `authority` is 1.

    Raises ConfigError where the policy and the environment do not fit: see `read_layers` and
    `Translation`; or where the actor has other layers.
    """
    translation, path = Translation(env, config), Path(config.policy)
    inputs, layers = translation.observation(), read_layers(path)
    moments = normalize.obs_rms
    assert isinstance(moments, RunningMeanStd)  # observations are arrays
    import_statistics(inputs, layers, moments, normalize.epsilon)
    weights, biases = list(layers.weights), list(layers.biases)
    weights[0], biases[0] = first_layer(inputs, layers, moments, normalize.epsilon)
    weights[-1], biases[-1] = translation.last_layer(weights[-1], biases[-1])
    actor = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    linear = [layer for layer in actor if isinstance(layer, torch.nn.Linear)]
    if [layer.weight.shape for layer in linear] != [weight.shape for weight in weights]:
        sizes = [len(bias) for bias in biases[:-1]]
        raise ConfigError(f"must be {sizes} to start from {path.name}", field="ppo.net_arch")
    with torch.no_grad():
        for layer, weight, bias in zip(linear, weights, biases, strict=True):
            layer.weight.copy_(torch.as_tensor(weight))
            layer.bias.copy_(torch.as_tensor(bias))


def import_statistics(
    inputs: Affine, layers: NetworkLayers, moments: RunningMeanStd, epsilon: float
) -> None:
    """Means and variances with which (o − mean)/√(var + ε) is the policy's normalised input.

    Those of a symmetric policy are made alike on both sides.
    """
    known = inputs.index >= 0
    mean, var = np.zeros(moments.mean.shape), np.ones(moments.mean.shape)
    mean[inputs.index[known]] = ((layers.mean - inputs.offset) / inputs.gain)[known]
    var[inputs.index[known]] = (layers.scale / inputs.gain)[known] ** 2
    if isinstance(moments, MirroredMeanStd):
        mean, var = moments.alike(mean, var)
    moments.mean, moments.var, moments.count = mean, var - epsilon, FIRM


def first_layer(
    inputs: Affine, layers: NetworkLayers, moments: RunningMeanStd, epsilon: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the policy's first layer, for observations that are normalised by these `moments`."""
    known = inputs.index >= 0
    mean, scale = np.zeros(len(known)), np.zeros(len(known))
    mean[known] = moments.mean[inputs.index[known]]
    scale[known] = np.sqrt(moments.var + epsilon)[inputs.index[known]]
    weight, bias = layers.weights[0], layers.biases[0]
    bias = bias + weight @ ((inputs.gain * mean + inputs.offset - layers.mean) / layers.scale)
    columns = weight * (inputs.gain * scale / layers.scale)
    first = np.zeros((len(bias), len(moments.mean)))
    first[:, inputs.index[known]] = columns[:, known]
    return first, bias
