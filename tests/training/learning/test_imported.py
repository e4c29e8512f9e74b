"""An external policy as the first weights: it does what it did, where servos are moved."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.policy_files.layers import read_layers
from poise.baselines.policy_files.reading import policy_config
from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.balance.config import ObservationConfig
from poise.envs.balance.servos import ServoConfig
from poise.training.learning.config import TrainConfig
from poise.training.learning.imported import import_policy
from poise.training.learning.policy import load_policy
from poise.training.learning.train import (
    _training_envs,
    first_policy,
    make_model,
    train,
)
from tests.support.policies import write_layers, write_onnx, write_yaml
from tests.support.shared import robot, tiny_config

TERMS = ("root_vel", "root_rate", "gravity", "joint_pos", "joint_vel", "last_action", "com")
HIDDEN = (12, 9)


def policy(folder: Path, network: Path | None = None, **changes: Any) -> Path:
    """A policy of all joints but one, in an order of its own; it moves all of these but two."""
    names = [name for name in robot().joint_names if name != "abdomen_z"]
    order = np.random.default_rng(5).permutation(len(names))
    n, moved = len(names), [int(i) for i in order[:-2]]
    inputs = 3 + 3 + 3 + 3 + n + n + len(moved)
    network = network or write_layers(folder / "policy.onnx", [inputs, *HIDDEN, len(moved)])
    fields = {
        "kind": "policy-file",
        "policy": network.name,
        "joints": [names[i] for i in order],
        "default": [0.01 * i for i in range(n)],
        "action_joints": moved,
        "action_scale": [0.1 + 0.01 * i for i in range(len(moved))],
        "action_offset": [-0.02 * i for i in range(len(moved))],
        "command": [0.4, 0.1, -0.2],
        "observations": [
            {"term": "base_lin_vel", "scale": 2.0},
            {"term": "base_ang_vel", "scale": [0.2, 0.3, 0.4]},
            {"term": "projected_gravity"},
            {"term": "velocity_commands", "scale": 3.0},
            {"term": "joint_pos_rel"},
            {"term": "joint_vel", "scale": 0.05},
            {"term": "last_action"},
        ],
    }
    return write_yaml(folder / "policy.yaml", **{**fields, **changes})


def config(start: Path | None, action: str = "whole", **changes: Any) -> TrainConfig:
    """A run that takes seconds and starts from a policy."""
    tiny = tiny_config(action=action, start_from=None if start is None else str(start), **changes)
    ppo = replace(tiny.ppo, net_arch=HIDDEN, critic_arch=(7,), activation="elu", actor_rate=0.1)
    return replace(
        tiny,
        ppo=ppo,
        servos=build(ServoConfig, {"reach": {"*": 30.0}}, "test"),  # no action is cut off
        env=replace(tiny.env, observation=ObservationConfig(TERMS)),
    )


def imported(chosen: TrainConfig) -> tuple[Any, Any]:
    """The model whose actor is the policy, and the environments."""
    normalize = _training_envs(chosen, robot())
    model, start = make_model(chosen, normalize), first_policy(chosen.start_from)
    import_policy(start, chosen.make_env(robot()), model, normalize)
    return model, normalize


@pytest.mark.parametrize("action", ["whole", "position"])
def test_it_does_what_the_policy_does(action: str, tmp_path: Path) -> None:
    """The same targets in the same states, after the same action; other motors are held."""
    model, normalize = imported(config(policy(tmp_path), action))
    env = normalize.venv.batch.envs[0]
    player = PolicyFile(env.robot, policy_config(tmp_path / "policy.yaml"))
    joints, servos, rng = player.joints, env.servos, np.random.default_rng(1)
    env.reset(seed=2, options={"push": []})
    player.reset(env.simulation.state)
    motors = [list(servos.dofs - 6).index(joint) for joint in joints.moved]
    others = [i for i in range(len(servos.dofs)) if i not in motors]
    for _ in range(5):
        before = rng.uniform(-0.002, 0.002, env.action_space.shape)
        if action == "whole":
            before[-1] = 0.0
        env.step_without_info(before)
        targets = (servos.hold + servos.reach * before[: len(servos.hold)])[motors]
        player.action[:] = (targets - joints.offset) / joints.scale
        player._state = env.simulation.state
        player._ask()
        seen = normalize.normalize_obs(env.episode.observation)
        assert abs(seen).max() < 10.0  # none is cut off
        found, _ = model.predict(seen, deterministic=True)
        moved = (servos.hold + servos.reach * found[: len(servos.hold)])[motors]
        np.testing.assert_allclose(moved, player._servos.target[joints.moved], atol=2e-5)
        assert np.ptp(moved) > 0.1
        assert np.all(found[others] == 0.0) and (action != "whole" or found[-1] == 1.0)


@pytest.mark.parametrize("history", ["term", "frame"])
def test_the_command_is_the_environments(history: str, tmp_path: Path) -> None:
    """Where commands change, the targets are those of the policy that is given the same ones."""
    names = [name for name in robot().joint_names if name != "abdomen_z"]
    known = {"base_ang_vel": 3, "velocity_commands": 3, "joint_pos_rel": len(names)}
    network = write_layers(tmp_path / "policy.onnx", [3 * sum(known.values()), *HIDDEN, len(names)])
    terms: list[dict[str, Any]] = [{"term": term, "history": 3} for term in known]
    terms[1]["scale"] = [2.0, 0.5, 3.0]
    fields: dict[str, Any] = {"joints": names, "default": 0.0, "action_joints": []}
    standing = dict(zip(robot().joint_names, robot().standing_qpos[7:].tolist(), strict=True))
    fields |= {"action_scale": 0.05, "action_offset": [standing[name] for name in names]}
    start = policy(tmp_path, network, observations=terms, history=history, **fields)
    chosen = config(start, "velocity")
    own = ("root_rate", "command_velocity", "command_turn", "joint_pos")
    chosen = replace(chosen, env=replace(chosen.env, observation=ObservationConfig(own, history=3)))
    model, normalize = imported(chosen)
    env = normalize.venv.batch.envs[0]
    player = PolicyFile(env.robot, policy_config(start))
    servos, joints = env.servos, player.joints
    course = [{"ahead": 0.3, "turn": -0.2}, {"left": 0.4, "ahead": -0.1, "start": 0.06}]
    env.reset(seed=2, options={"push": [], "command": course})
    player.reset(env.simulation.state)
    motors = [list(servos.dofs - 6).index(joint) for joint in joints.moved]
    found, rng = [], np.random.default_rng(1)
    for _ in range(8):
        assert player.orders is not None
        player.orders[:] = env.command.array()
        player._state = env.simulation.state
        player._ask()
        seen = normalize.normalize_obs(env.episode.observation)
        action, _ = model.predict(seen, deterministic=True)
        found.append((servos.hold + servos.reach * action)[motors])
        np.testing.assert_allclose(found[-1], player._servos.target[joints.moved], atol=2e-5)
        env.step_without_info(rng.uniform(-0.002, 0.002, env.action_space.shape))
    assert abs(found[0] - found[-1]).max() > 1e-2  # the command does something


@pytest.mark.parametrize("history", ["term", "frame"])
@pytest.mark.parametrize("order", [{}, {"newest_first": True}, {"lag": 1}])
def test_a_policy_that_shows_several_steps(history: str, order: dict, tmp_path: Path) -> None:
    """The same targets, step after step, while its own action is taken."""
    known = {"base_ang_vel": 3, "projected_gravity": 3, "joint_pos_rel": 15, "joint_vel": 15}
    names = [name for name in robot().joint_names if name != "abdomen_z"]
    known.update(joint_pos_rel=len(names), joint_vel=len(names), last_action=len(names))
    steps = 2 if order else 3
    network = write_layers(
        tmp_path / "policy.onnx", [steps * sum(known.values()), *HIDDEN, len(names)]
    )
    terms = [{"term": term, "history": steps, **order} for term in known]
    fields: dict[str, Any] = {"joints": names, "default": 0.0, "action_joints": []}
    standing = dict(zip(robot().joint_names, robot().standing_qpos[7:].tolist(), strict=True))
    fields |= {"action_scale": 0.05, "action_offset": [standing[name] for name in names]}
    fields["history"] = history
    chosen = config(policy(tmp_path, network, observations=terms, **fields))
    seen = replace(chosen.env.observation, history=3)
    model, normalize = imported(replace(chosen, env=replace(chosen.env, observation=seen)))
    env = normalize.venv.batch.envs[0]
    player = PolicyFile(env.robot, policy_config(tmp_path / "policy.yaml"))
    joints, servos = player.joints, env.servos
    env.reset(seed=2, options={"push": []})
    player.reset(env.simulation.state)
    motors = [list(servos.dofs - 6).index(joint) for joint in joints.moved]
    before, found, rng = np.zeros(env.action_space.shape), [], np.random.default_rng(1)
    for _ in range(6):
        targets = (servos.hold + servos.reach * before[: len(servos.hold)])[motors]
        player.action[:] = (targets - joints.offset) / joints.scale
        player._state = env.simulation.state
        player._ask()
        shown = normalize.normalize_obs(env.episode.observation)
        action, _ = model.predict(shown, deterministic=True)
        moved = (servos.hold + servos.reach * action[: len(servos.hold)])[motors]
        np.testing.assert_allclose(moved, player._servos.target[joints.moved], atol=2e-5)
        found.append(moved)
        before = rng.uniform(-0.002, 0.002, env.action_space.shape)
        before[-1] = 0.0
        env.step_without_info(before)
    assert np.ptp(found, axis=0).min() > 1e-3


def test_a_run_starts_from_it(tmp_path: Path) -> None:
    """Statistics stay those of the policy; what is trained is loaded and acts as in training."""
    chosen, out = config(policy(tmp_path)), tmp_path / "run"
    _, normalize = imported(chosen)
    train(chosen, out, progress=False)
    with np.load(out / "last" / "vecnormalize.npz") as stored:
        np.testing.assert_allclose(stored["obs_mean"], normalize.obs_rms.mean, atol=1e-6)
        np.testing.assert_allclose(stored["obs_var"], normalize.obs_rms.var, rtol=1e-6)
    trained = load_policy(out / "last")
    env = trained.make_env()
    env.reset(seed=0)
    seen = env.episode.observation.copy()
    action = trained.act(seen)
    assert action.shape == env.action_space.shape and abs(action[-1] - 1.0) < 0.1


def test_a_slow_actor_moves_by_its_share() -> None:
    """A step of the optimizer moves the actor by a tenth of Adam's first, the critic by all."""
    chosen = config(None)
    model = make_model(chosen, _training_envs(chosen, robot()))
    before = {name: p.detach().clone() for name, p in model.policy.named_parameters()}
    for parameter in model.policy.parameters():
        parameter.grad = parameter.detach() * 0.0 + 1.0
    rate = model.policy.optimizer.param_groups[0]["lr"]
    model.policy.optimizer.step()
    for name, parameter in model.policy.named_parameters():
        moved = (before[name] - parameter.detach()).abs().max().item()
        assert moved == pytest.approx(rate if "value" in name else 0.1 * rate, rel=1e-2), name


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"observations": [{"term": "phase"}]}, r"observations\[0\].*does not tell phase"),
        (
            {"observations": [{"term": "joint_vel", "history": 2}]},
            r"observations\[0\]: shows joint_vel of 1 steps ago: observation.history must be 2",
        ),
        ({"observations": [{"term": "joint_vel", "clip": [-1.0, 1.0]}]}, "with limits"),
        ({"law": {"*": {"pitch": 0.1}}}, "law: targets that follow the attitude"),
    ],
)
def test_what_cannot_be_imported_is_said(changes: dict, named: str, tmp_path: Path) -> None:
    """One line names the file, the term and why."""
    with pytest.raises(ConfigError, match=named):
        imported(config(policy(tmp_path, **changes)))


def test_another_network_is_refused(tmp_path: Path) -> None:
    """One that is no chain of layers with ELU, and one of other sizes than `net_arch`."""
    start = policy(tmp_path, write_onnx(tmp_path / "tanh.onnx", np.zeros((5, 14), np.float32)))
    with pytest.raises(ConfigError, match=r"tanh.onnx: is no chain of layers.*MatMul, Tanh"):
        imported(config(start))
    chosen = config(policy(tmp_path / "other"))
    small = replace(chosen, ppo=replace(chosen.ppo, net_arch=(12, 8)))
    with pytest.raises(ConfigError, match=r"ppo.net_arch: must be \[12, 9\]"):
        imported(small)


def write_script(path: Path, activation: torch.nn.Module) -> Path:
    """TorchScript with layers and a normaliser, as Booster's."""

    class Network(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.actor = torch.nn.Sequential(
                torch.nn.Linear(6, 5), activation, torch.nn.Linear(5, 2)
            )
            self._mean = torch.nn.Parameter(torch.linspace(-1.0, 1.0, 6)[None])
            self.register_buffer("_std", torch.linspace(0.5, 2.0, 6)[None])

        def forward(self, x: torch.Tensor) -> torch.Tensor:
            return self.actor((x - self._mean) / self._std)

    torch.manual_seed(3)
    torch.jit.script(Network()).save(str(path))
    return path


def test_layers_of_torchscript(tmp_path: Path) -> None:
    """Their outputs are the network's; one with another activation is refused."""
    path = write_script(tmp_path / "elu.pt", torch.nn.ELU())
    given = np.random.default_rng(4).normal(size=(7, 6))
    expected = torch.jit.load(str(path))(torch.from_numpy(given).float()).detach().numpy()
    np.testing.assert_allclose(read_layers(path).outputs(given), expected, atol=1e-6)
    with pytest.raises(ConfigError, match=r"tanh.pt: is no chain of layers with ELU"):
        read_layers(write_script(tmp_path / "tanh.pt", torch.nn.Tanh()))
    torch.jit.script(torch.nn.GRU(4, 3)).save(str(tmp_path / "gru.pt"))
    with pytest.raises(ConfigError, match=r"gru.pt: is no chain of layers: it has other weights"):
        read_layers(tmp_path / "gru.pt")


def test_only_servos_can_start_from_it(tmp_path: Path) -> None:
    """An action of targets or torques has no joints to aim."""
    with pytest.raises(ConfigError, match=r"action: must be position or whole"):
        imported(config(policy(tmp_path), "torque"))
