"""ONNX and safetensors act as the policy does, and say what it is; or are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.environments.stepping import ResidualStepEnv
from poise.baselines.environments.terms import STEP_TERMS
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.baselines.registry import load_controller
from poise.configs.errors import ConfigError, PoiseError
from poise.training.deploy.export.check import COUNT, check_onnx, observations
from poise.training.deploy.export.export import safetensors_bytes
from poise.training.deploy.export.metadata import metadata, scale_of
from poise.training.deploy.export.onnx_graph import onnx_bytes
from poise.training.learning.policy import ACTIVATIONS, Policy
from tests.support.exported import SHIPPED, SYMMETRIC, policy, spoiled
from tests.support.policies import onnx, onnx_session
from tests.support.shared import robot
from tests.support.weekly import daily

safetensors = pytest.importorskip("safetensors.numpy")


def written(policy: Policy, path: Path) -> Path:
    path.write_bytes(onnx_bytes(policy, {}))
    return path


def normalised(policy: Policy, seen: np.ndarray) -> np.ndarray:
    return (seen - policy.mean) * policy.scale


@pytest.mark.parametrize("name", daily(["run", *SHIPPED], 6))
def test_onnx_acts_as_the_policy(name: str, tmp_path: Path) -> None:
    """On observations within and beyond the limits of the normalised one, to 1e-6."""
    count = COUNT // 5
    seen = observations(policy(name), count)
    assert seen.shape == (count, len(policy(name).mean)) and COUNT == 10_000
    far = np.abs(normalised(policy(name), seen)) > policy(name).clip
    assert 0.01 < far.mean() < 0.9 and np.any(far.any(axis=1)) and not np.all(far.any(axis=1))
    path = written(policy(name), tmp_path / "policy.onnx")
    (actions,) = onnx_session(path).run(["actions"], {"obs": seen})
    expected, _ = policy(name).predict(seen)
    assert actions.dtype == np.float32 and actions.shape == expected.shape
    np.testing.assert_allclose(actions, expected, rtol=0.0, atol=1e-6)
    assert check_onnx(path, policy(name), count) == np.abs(actions - expected).max()
    if name != "run":  # a policy that has learned something
        assert np.ptp(expected) > 0.5 and np.mean(np.abs(expected) < 1.0) > 0.05


def test_one_observation_is_a_batch_of_one(tmp_path: Path) -> None:
    path = written(policy("residual"), tmp_path / "policy.onnx")
    seen = observations(policy("residual"), 3)
    (alone,) = onnx_session(path).run(None, {"obs": seen[:1]})
    np.testing.assert_allclose(alone[0], policy("residual").act(seen[0]), atol=1e-6)


def test_the_same_policy_gives_the_same_bytes() -> None:
    said = metadata(policy("residual"), policy("residual").make_env())
    assert onnx_bytes(policy("residual"), said) == onnx_bytes(policy("residual"), said)


@pytest.mark.parametrize(("layer", "entry"), [(0, 0.01), (-1, 1e-4), (1, np.nan), (0, np.inf)])
def test_another_weight_is_refused(layer: int, entry: float, tmp_path: Path) -> None:
    path = written(spoiled(policy(SYMMETRIC), layer, entry), tmp_path / "policy.onnx")
    with pytest.raises(PoiseError, match=r"policy.onnx: its actions differ by .* nothing was writ"):
        check_onnx(path, policy(SYMMETRIC))


def test_the_graph_is_small_and_plain() -> None:
    """Operators that any runtime has, weights of 32 bits."""
    model = onnx.load_from_string(onnx_bytes(policy("residual-lqr-lip"), {}))
    assert {node.op_type for node in model.graph.node} <= {
        "Add", "Cast", "Clip", "Gather", "Gemm", "Mul", "Sub", "Tanh",
    }  # fmt: skip
    kinds = {t.name: t.data_type for t in model.graph.initializer}
    assert kinds["layer0.weight"] == onnx.TensorProto.FLOAT


@pytest.mark.parametrize("name", [*SHIPPED, "run"])
def test_safetensors_hold_all_of_the_policy(name: str) -> None:
    """From them alone, in NumPy: the same bits."""
    found = safetensors.load(safetensors_bytes(policy(name), {}))
    f = ACTIVATIONS[policy(name).config.ppo.activation]
    hidden = sorted((key for key in found if key.startswith("mlp_extractor") and "weight" in key),
                    key=lambda key: int(key.split(".")[2]))  # fmt: skip
    layers = [key.removesuffix(".weight") for key in hidden]
    assert found["action_net.weight"].dtype == np.float32

    def mean(o: np.ndarray) -> np.ndarray:
        limit = found["observation.clip"]
        x = np.clip((o - found["observation.mean"]) * found["observation.scale"], -limit, limit)
        x = x[:, None, :]
        for key in layers:
            x = f(x @ found[f"{key}.weight"].astype(float).T.copy() + found[f"{key}.bias"])
        last = found["action_net.weight"].astype(float).T.copy()
        return (x @ last + found["action_net.bias"])[:, 0, :]

    seen = observations(policy(name), 100)
    action = mean(seen)
    if "observation.order" in found:
        image = mean(found["observation.sign"] * seen[:, found["observation.order"]])
        action = 0.5 * (action + found["action.sign"] * image[:, found["action.order"]])
    assert ("observation.order" in found) == policy(name).config.ppo.symmetric
    np.testing.assert_array_equal(np.clip(action, -1.0, 1.0), policy(name).act(seen))


def listed(text: str) -> list[str]:
    return text.split(",")


@pytest.mark.parametrize("name", daily(SHIPPED, 6))
def test_metadata_say_what_is_observed_and_what_an_action_does(name: str, tmp_path: Path) -> None:
    """As many entries as the network has; in mjlab's words, where it has one."""
    env = policy(name).make_env(robot=robot(policy(name).config.robot))
    path = tmp_path / "policy.onnx"
    path.write_bytes(onnx_bytes(policy(name), metadata(policy(name), env)))
    said = onnx_session(path).get_modelmeta().custom_metadata_map
    sizes = [int(size) for size in listed(said["observation_sizes"])]
    assert sum(sizes) == len(policy(name).mean)
    assert listed(said["observation_names"]) == [term.name for term in env.terms]
    assert listed(said["observation_units"]) == [term.unit for term in env.terms]
    assert listed(said["action_names"]) == list(env.action_names)
    assert len(listed(said["observation_terms_scale"])) == len(env.terms)
    scales = [float(scale) for scale in listed(said["action_scale"])]
    assert len(scales) == len(listed(said["action_units"])) == len(env.action_names)
    assert len(listed(said["joint_names"])) == env.robot.model.nu
    assert said["robot_fingerprint"] == env.robot.fingerprint
    assert float(said["control_period"]) == env.config.policy_period
    values = json.loads(said["units"])
    assert values["omega"] == env.robot.omega and values["m"] == env.robot.mass
    if name == SYMMETRIC:
        entry = listed(said["action_names"]).index("foothold_x")
        assert scales[entry] == policy(name).config.step_residual.foothold
        assert listed(said["action_units"])[entry] == "m"
        assert said["controller"] == "capture-step"
        assert said["controller_fingerprint"] == policy(name).state["controller_fingerprint"]
    if isinstance(env, ResidualWholeEnv):
        assert scales[:-1] == list(env.servos.reach)
        stiffness = [float(value) for value in listed(said["joint_stiffness"])]
        assert stiffness == list(env.servos.stiffness)
    with pytest.raises(ConfigError):  # it moves a controller's targets, no joints
        load_controller(path, env.robot)


def test_scales_turn_si_into_observations() -> None:
    """Velocity, joints and the capture point of a pushed robot, from the simulation's own state."""
    env = policy("residual").make_env(robot=robot())
    said = metadata(policy("residual"), env)
    scale = dict(zip(listed(said["observation_names"]), listed(said["observation_terms_scale"]),
                     strict=True))  # fmt: skip
    env.reset(seed=1, options={"push": [], "qvel": np.full(robot().model.nv, 0.05)})
    seen, first = {}, 0
    for term in env.terms:
        seen[term.name] = env.episode.observation[first : first + term.size]
        first += term.size
    state = env.simulation.state
    cos, sin = state.heading
    turn = np.array([[cos, sin], [-sin, cos]])
    xi = turn @ (state.capture_point - state.origin[:2])
    by = np.array([float(part) for part in scale["capture_point"].split(";")])
    np.testing.assert_allclose(seen["capture_point"], by * xi)
    np.testing.assert_allclose(seen["com_vel"][2], float(scale["com_vel"]) * state.com_vel[2])
    np.testing.assert_allclose(seen["joint_vel"], float(scale["joint_vel"]) * state.qvel[6:])
    momentum = float(scale["angular_momentum"]) * state.angular_momentum[2]
    np.testing.assert_allclose(seen["angular_momentum"][2], momentum)


def test_every_unit_of_a_term_is_a_number() -> None:
    extra = ["push", "root_vel", "push_force", "push_mean"]
    env = ResidualStepEnv(robot(), observation={"extra": extra}, pushes=None)
    assert {kind.unit for kind in STEP_TERMS.values()} == {term.unit for term in env.terms}
    assert all(np.isfinite(float(each)) for term in env.terms
               for each in scale_of(term, env.scales).split(";"))  # fmt: skip
