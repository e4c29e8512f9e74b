"""A policy from outside as the first weights of a run: what it did is where learning begins.

Its observations and actions are affine in those of the environment, so that its network becomes
the actor's, number by number: nothing is fitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.policy_files.config import PolicyFileConfig
from poise.baselines.policy_files.joints import JointServos, joint_servos
from poise.baselines.policy_files.observations import ALIASES
from poise.configs.errors import ConfigError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv

from .symmetry import MirroredMeanStd

FIRM = 1e12  # observations that the imported statistics count for: they stay as they are
AUTHORITY = 1.0  # of the imported policy: it takes over wherever it may

#: a policy's terms, the environment's, and the field of `Scales` (times a factor) they differ by
SAME = {
    "base_ang_vel": ("root_rate", "omega", 1.0),
    "base_lin_vel": ("root_vel", "velocity", 1.0),
    "projected_gravity": ("gravity", None, 1.0),
    "joint_vel": ("joint_vel", "omega", 3.0),
}


@dataclass(frozen=True)
class Layers:
    """A network: normalised inputs (x − mean)/scale, then layers with ELU between them."""

    mean: np.ndarray  # (n,)
    scale: np.ndarray  # (n,)
    weights: list[np.ndarray]  # (out, in)
    biases: list[np.ndarray]  # (out,)


def read_layers(path: Path) -> Layers:
    """The layers of an ONNX file: Sub and Div or none, then Gemm and Elu in turn.

    Raises ConfigError naming the file: another network, or the package onnx is missing.
    """
    try:
        import onnx
    except ImportError:
        raise ConfigError("needs the package onnx: pip install onnx", source=path) from None
    graph = onnx.load(str(path)).graph
    arrays = {t.name: np.array(onnx.numpy_helper.to_array(t), float) for t in graph.initializer}
    kinds = [node.op_type for node in graph.node]
    normalised = kinds[:2] == ["Sub", "Div"]
    gemms = [node for node in graph.node if node.op_type == "Gemm"]
    rest = kinds[2:] if normalised else kinds
    if not gemms or rest != ["Gemm", *["Elu", "Gemm"] * (len(gemms) - 1)]:
        raise ConfigError(f"is no chain of layers with ELU between them: {', '.join(kinds)}",
                          source=path)  # fmt: skip
    weights, biases = [], []
    for node in gemms:
        transposed = {a.name: a.i for a in node.attribute}.get("transB", 0)
        matrix = arrays[node.input[1]]
        weights.append(matrix if transposed else matrix.T)
        biases.append(arrays[node.input[2]].ravel())
    n = weights[0].shape[1]
    mean, scale = np.zeros(n), np.ones(n)
    if normalised:
        mean, scale = (arrays[node.input[1]].ravel() for node in graph.node[:2])
    return Layers(mean, scale, weights, biases)


@dataclass(frozen=True)
class Affine:
    """x = gain · o[index] + offset; an index of −1 stands for a constant, `offset`."""

    index: np.ndarray  # (n,) int
    gain: np.ndarray  # (n,)
    offset: np.ndarray  # (n,)


def inputs_from(env: BalanceEnv, config: PolicyFileConfig, joints: JointServos) -> Affine:
    """A policy's observation, as the environment's observation tells it.

    Raises ConfigError for a term that is not told, with a history, or with limits.
    """
    places, first = {}, 0
    for term in env.terms:
        places[term.name] = np.arange(first, first + term.size)
        first += term.size
    motors = motor_places(env, joints)
    reach, hold = env.servos.reach[motors], env.servos.hold[motors]
    index, gain, offset = [], [], []
    for i, described in enumerate(config.observations):
        name, factor = ALIASES.get(described.term, described.term), 1.0
        own = SAME[name][0] if name in SAME else name
        own = {"joint_pos_rel": "joint_pos"}.get(own, own)
        if described.history > 1 or described.clip is not None:
            raise ConfigError("with a history or limits it cannot be imported",
                              source=config.described_in, field=f"observations[{i}]")  # fmt: skip
        if name == "velocity_commands":
            where, plus = np.full(3, -1), np.array(config.command)
        elif own not in places:
            raise ConfigError(f"the environment does not tell {name}: add its term {own}",
                              source=config.described_in, field=f"observations[{i}]",
                              choices=places)  # fmt: skip
        elif own == "last_action":
            actions = len(env.action_names) - len(env.servos.hold)
            skipped = actions - (1 if isinstance(env, ResidualWholeEnv) else 0)
            where = places[own][skipped + motors]
            factor, plus = reach / joints.scale, (hold - joints.offset) / joints.scale
        elif own == "joint_pos":
            where = places[own][joints.index]
            plus = env.arrays.q_standing[joints.index]
            plus = plus - joints.default if name == "joint_pos_rel" else plus
        else:
            where = places[own][joints.index] if own == "joint_vel" else places[own]
            _, unit, times = SAME[name]
            factor, plus = times * (getattr(env.scales, unit) if unit else 1.0), 0.0
        scale = np.broadcast_to(described.scale, where.shape)
        index.append(where)
        gain.append(np.broadcast_to(factor, where.shape) * scale)
        offset.append(np.broadcast_to(plus, where.shape) * scale)
    return Affine(np.concatenate(index), np.concatenate(gain), np.concatenate(offset))


def motor_places(env: BalanceEnv, joints: JointServos) -> np.ndarray:
    """(na,) int: the motor of each of the policy's actions."""
    dofs = list(env.servos.dofs - 6)
    return np.array([dofs.index(joint) for joint in joints.moved])


def import_policy(config: PolicyFileConfig, model: PPO, normalize: VecNormalize) -> None:
    """Make the actor of `model` do what the policy `config` does, where servos are moved.

    The statistics that normalise its observations become the policy's own, and stay. Inputs that
    it does not know have weights of zero. `authority` is 1.

    Raises ConfigError where the policy and the environment do not fit: see `read_layers` and
    `inputs_from`; another number of joints or layers; actions without servos.
    """
    env, path = normalize.venv.batch.envs[0], Path(config.policy)
    if not isinstance(env, (PositionBalanceEnv, ResidualWholeEnv)):
        raise ConfigError("must be position or whole to start from joint targets", field="action")
    joints, layers = joint_servos(env.robot, config), read_layers(path)
    affine = inputs_from(env, config, joints)
    _import_statistics(affine, layers, normalize)
    weights, biases = list(layers.weights), list(layers.biases)
    weights[0], biases[0] = _inputs(affine, layers, normalize)
    weights[-1], biases[-1] = _outputs(env, joints, weights[-1], biases[-1])
    actor = model.policy.mlp_extractor.policy_net
    linear = [layer for layer in actor if isinstance(layer, torch.nn.Linear)]
    linear.append(model.policy.action_net)
    shapes = [tuple(layer.weight.shape) for layer in linear]
    if shapes != [weight.shape for weight in weights]:
        sizes = [len(bias) for bias in biases[:-1]]
        raise ConfigError(f"must be {sizes} to start from {path.name}", field="ppo.net_arch")
    with torch.no_grad():
        for layer, weight, bias in zip(linear, weights, biases, strict=True):
            layer.weight.copy_(torch.as_tensor(weight))
            layer.bias.copy_(torch.as_tensor(bias))


def _inputs(
    affine: Affine, layers: Layers, normalize: VecNormalize
) -> tuple[np.ndarray, np.ndarray]:
    """The first layer, for observations that are normalised by the statistics of `normalize`."""
    known, moments = affine.index >= 0, normalize.obs_rms
    mean, scale = np.zeros(len(known)), np.zeros(len(known))
    mean[known] = moments.mean[affine.index[known]]
    scale[known] = np.sqrt(moments.var + normalize.epsilon)[affine.index[known]]
    weight, bias = layers.weights[0], layers.biases[0]
    bias = bias + weight @ ((affine.gain * mean + affine.offset - layers.mean) / layers.scale)
    columns = weight * (affine.gain * scale / layers.scale)
    first = np.zeros((len(bias), len(moments.mean)))
    first[:, affine.index[known]] = columns[:, known]
    return first, bias


def _outputs(
    env: BalanceEnv, joints: JointServos, weight: np.ndarray, bias: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The last layer: targets offset + scale · a' as hold + reach · a, other entries constant."""
    n, whole = len(env.action_names), isinstance(env, ResidualWholeEnv)
    first = n - len(env.servos.hold) - (1 if whole else 0)
    motors = motor_places(env, joints)
    reach, hold = env.servos.reach[motors], env.servos.hold[motors]
    all_weights, all_biases = np.zeros((n, weight.shape[1])), np.zeros(n)
    all_weights[first + motors] = (joints.scale / reach)[:, None] * weight
    all_biases[first + motors] = (joints.offset + joints.scale * bias - hold) / reach
    if whole:
        all_biases[-1] = AUTHORITY
    return all_weights, all_biases


def _import_statistics(affine: Affine, layers: Layers, normalize: VecNormalize) -> None:
    """Means and variances with which (o − mean)/√var is the policy's normalised input.

    Those of a symmetric policy are alike on both sides.
    """
    known, moments = affine.index >= 0, normalize.obs_rms
    index = affine.index[known]
    mean, var = np.zeros(moments.mean.shape), np.ones(moments.mean.shape)
    mean[index] = ((layers.mean - affine.offset) / affine.gain)[known]
    var[index] = (layers.scale / affine.gain)[known] ** 2
    if isinstance(moments, MirroredMeanStd):
        mean, var = moments.alike(mean, var)
    moments.mean, moments.var, moments.count = mean, var - normalize.epsilon, FIRM
