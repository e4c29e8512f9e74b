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
from poise.baselines.registry import load_controller
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.vector.batch import EnvBatch, replicate
from poise.envs.robots.menagerie import WHEEL
from poise.envs.robots.robot import Robot
from tests.support.policies import linear, onnx_session, write_onnx, write_recurrent, write_yaml
from tests.support.rivals import network
from tests.support.shared import robot as shared_robot

STEPS, SUBSTEPS = 200, 10
SHAKY = {"push": [], "noise": 1.0}
#: of all joints, so that no list says how many there are
ONE_NUMBER = {"default": 0.1, "stiffness": 40.0, "damping": 1.0, "action_scale": 0.1}


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


@pytest.mark.parametrize("copies", [1, 2, 5])
def test_copies_take_turns(robot: Robot, own: Path, copies: int) -> None:
    """Each observes frames a policy period apart, and its own last action; the next trial too."""
    fields = {**described(robot), "copies": copies, "policy": str(own.with_name("policy.onnx"))}
    env = make_env(robot, str(write_yaml(own.with_name(f"copies{copies}.yaml"), **fields)))
    policy = env.controller
    asked, act = [], policy.network.act

    def watched(inputs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        answer = act(inputs)
        asked.append((inputs[""].copy(), answer["action"].copy()))
        return answer

    policy.network.act = watched
    n = len(policy.action)
    older, newer = slice(15, 15 + n), slice(15 + n, 15 + 2 * n)
    last = slice(15 + 3 * n, 15 + 4 * n)
    for _ in range(2):
        asked.clear()
        env.reset(seed=3, options=SHAKY)
        for _ in range(6):
            env.step(np.zeros(4))
        assert len(asked) == 6 * copies
        for k in range(copies, len(asked)):
            (seen, _), (before, action) = asked[k], asked[k - copies]
            np.testing.assert_array_equal(seen[older], before[newer])
            np.testing.assert_allclose(seen[last], action, atol=1e-6)
        assert np.ptp([seen[newer] for seen, _ in asked], axis=0).max() > 1e-4


@pytest.mark.parametrize(("copies", "part"), [(3, "do not divide"), (0, "at least 1")])
def test_copies_share_the_steps_of_a_period(
    robot: Robot, own: Path, copies: int, part: str
) -> None:
    fields = {**described(robot), "copies": copies, "policy": str(own.with_name("policy.onnx"))}
    with pytest.raises(ConfigError, match=part):
        make_env(robot, str(write_yaml(own.with_name("shared.yaml"), **fields)))


def test_a_policy_that_remembers_has_one_copy(robot: Robot, tmp_path: Path) -> None:
    n = len(robot.joint_names)
    write_recurrent(tmp_path / "policy.onnx", n)
    fields = {"kind": "policy-file", "policy": "policy.onnx", "joints": list(robot.joint_names),
              "observations": [{"term": "dof_pos"}]}  # fmt: skip
    make_env(robot, str(write_yaml(tmp_path / "one.yaml", **fields)))
    with pytest.raises(ConfigError, match="copies: a policy that remembers"):
        make_env(robot, str(write_yaml(tmp_path / "two.yaml", **fields, copies=2)))


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

    def act(self, observations: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {"action": np.array([self.value, np.nan, np.nan])}


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
         ("observations: policy.onnx does not take 3 numbers (base_ang_vel 3): it takes 1 × 112",)),
        ({"observations": [{"term": "joint_torques"}]},
         ("observations[0].term: no such term: 'joint_torques'", "projected_gravity", "dof_pos")),
        ({"observations": [{"term": "phase", "scale": [1.0, 1.0, 1.0]}]},
         ("observations[0].scale: has 3 numbers, phase has 2",)),
        ({"joints": ["left_knee", "tail"]}, ("joints: 'compact' lacks tail", "choices")),
        ({"joints": [], "motors": [3, 400]}, ("motors: number 400", "'compact'")),
        ({"joints": [], "motors": [3, 3]}, ("motors: must be different",)),
        ({"joints": [], **ONE_NUMBER},
         ("does not take", "without joints or motors they are the first 25 of 'compact'")),
        ({"default": [0.1, 0.2]}, ("default: has 2 numbers for 23 joints",)),
        ({"default": {"*_knee*": 17.0, "*": 0.0}}, ("default: 17 rad is far outside of the",)),
        ({"action_scale": 1e300}, ("action_scale: must be at most 1000",)),
        ({"stiffness": {"*_knee*": 3.0}}, ("stiffness: has nothing for", "ankle")),
        ({"stiffness": {"*_tail": 3.0}}, ("stiffness: no joint is called '*_tail'", "choices")),
        ({"action_joints": [1, 1]}, ("action_joints: must be different places in 23 joints",)),
        ({"action_joints": [1, 23]}, ("action_joints: must be different places in 23 joints",)),
        ({"action_joints": [0, 1]}, ("does not take",)),
        ({"action_clip": [[-1.0, 1.0]] * 2}, ("action_clip: has 2 pairs for 23",)),
        ({"held": [0.1]}, ("held: has 1 numbers for 23 joints",)),
        ({"held": {"left_tail": 0.1}}, ("held: no joint is called 'left_tail'", "choices")),
        ({"outputs": {"torque": "actions"}}, ("outputs: no such output: 'torque'", "stiffness")),
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


def test_joints_that_are_not_given_are_all_of_the_robot(robot: Robot, own: Path) -> None:
    """In its order, where no list says how many; as many as the network has actions."""
    n = len(robot.joint_names)
    write_onnx(own.with_name("all.onnx"), linear(n, n))
    fields = {**described(robot), **ONE_NUMBER, "observations": [{"term": "actions"}]}
    fields |= {"policy": "all.onnx", "joints": []}
    controller = load_controller(str(write_yaml(own.with_name("all.yaml"), **fields)), robot)
    np.testing.assert_array_equal(controller.joints.index, np.arange(n))


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


def test_a_public_policy_recovers_on_the_g1_by_steps(g1: Robot) -> None:
    """Unitree's policy recovers, after steps, what no controller of feet in place survives."""
    network("unitree-g1-velocity")
    env = ResidualBalanceEnv(g1, controller="unitree-g1-velocity", pushes=None, duration=5.0)
    push = {"impulse": 0.9 * g1.mass, "direction": 0.0, "duration": 0.1, "start": 0.3}
    env.reset(seed=0, options={"push": push})
    actions_here(env, env.max_steps)
    assert env.recovered and not env.fallen
    assert env.simulation.state.com[0] > 0.2


def test_a_policy_for_walking_follows_what_is_asked(g1: Robot) -> None:
    """It walks at the commanded velocity, turns to another one, and stands at zero again."""
    network("unitree-g1-velocity")
    env = ResidualBalanceEnv(g1, controller="unitree-g1-velocity", pushes=None, duration=9.0)
    course = [{"ahead": 0.5}, {"left": 0.5, "start": 3.0}, {"start": 6.0}]
    env.reset(seed=0, options={"command": course, "push": []})
    places = []
    for _ in range(3):
        actions_here(env, 150)
        places.append(env.simulation.state.com[:2].copy())
    assert env.command is not None and env.command.speed == 0.0 and not env.fallen
    assert np.linalg.norm(env.simulation.state.com_vel[:2]) < 0.1
    assert places[0][0] > 0.8 and abs(places[0][1]) < 0.3
    assert places[1][1] - places[0][1] > 0.8 and abs(places[1][0] - places[0][0]) < 0.5


def test_a_command_moves_what_is_seen_and_the_clock(robot: Robot, own: Path) -> None:
    """The command of the environment takes the place of the description's; a reset forgets it."""
    fields = described(robot)
    fields |= {"phase_runs": "commanded", "command": [0.0, 0.0, 0.0]}
    path = write_yaml(own.with_name("told.yaml"), **fields)
    env = make_env(robot, str(path))
    seen: list[np.ndarray] = []
    act = env.controller.network.act
    env.controller.network.act = lambda given: seen.append(given[""].copy()) or act(given)
    env.reset(seed=3, options={**SHAKY, "command": {"ahead": 0.5, "turn": 0.4, "start": 0.04}})
    actions_here(env, 5)
    rows, n = np.array(seen), len(fields["joints"])
    np.testing.assert_allclose(rows[:, 12:15], [[0, 0, 0]] * 2 + [[1.0, 0.0, 0.1]] * 3)
    angles = 2 * np.pi * np.array([0.0, 0.0, 0.0, 0.02, 0.04]) / 0.8
    clock = 15 + 2 * n + n + n
    np.testing.assert_allclose(rows[:, clock], np.sin(angles), atol=1e-9)
    env.command = {"left": 0.25}
    actions_here(env, 1)
    np.testing.assert_allclose(seen[-1][12:15], [0.0, 0.5, 0.0])
    env.reset(seed=3, options=SHAKY)
    assert env.command.speed == 0.0


def test_a_policy_without_a_command_does_not_walk(robot: Robot, own: Path) -> None:
    """Which is said when it is told one."""
    write_onnx(own.with_name("blind.onnx"), linear(3, len(robot.joint_names) - 2))
    fields = {
        **described(robot),
        "policy": "blind.onnx",
        "observations": [{"term": "base_ang_vel"}],
    }
    env = make_env(robot, str(write_yaml(own.with_name("blind.yaml"), **fields)))
    assert env.command is None
    with pytest.raises(ConfigError, match="PolicyFile does not walk"):
        env.reset(options={"command": {"ahead": 0.5}})


def test_joints_that_the_action_does_not_move_are_held(robot: Robot, own: Path) -> None:
    """Where `held` says, with gains of their own; others as without it."""
    fields = described(robot)
    *moved, last = fields["joints"]
    lost = [name for name in robot.joint_names if name not in fields["joints"]]
    held = {last: 0.2, lost[0]: {"position": 0.1, "stiffness": 77.0}}
    fields |= {"action_joints": list(range(len(moved))), "observations": [{"term": "actions"}],
               "policy": "few.onnx"}  # fmt: skip
    write_onnx(own.with_name("few.onnx"), linear(len(moved), len(moved)))
    without, by_name, by_list = (
        load_controller(str(write_yaml(own.with_name("held.yaml"), **fields, **more)), robot).joints
        for more in ({}, {"held": held}, {"held": [0.3] * len(fields["joints"])})
    )
    place, other = robot.joint_names.index(last), robot.joint_names.index(lost[0])
    changed = {i: (0.2 if i == place else 0.1) for i in (place, other)}
    for i in range(len(robot.joint_names)):
        assert by_name.target[i] == changed.get(i, without.target[i])
    assert by_name.stiffness[other] == 77.0 and by_name.damping[other] == without.damping[other]
    assert by_list.target[place] == 0.3 and by_list.target[other] == without.target[other]


def test_gains_may_come_with_the_action(robot: Robot, own: Path) -> None:
    """Of the joints that it moves; they are the description's again in a new trial."""
    env = make_env(robot, str(own))
    env.reset(seed=3, options=SHAKY)
    moved, before = env.controller.joints.moved, env.controller.joints.stiffness.copy()
    act = env.controller.network.act
    gains = {"stiffness": np.full(len(moved), 33.0), "damping": np.full(len(moved), -1.0)}
    env.controller.network.act = lambda given: {**act(given), **gains}
    actions_here(env, 1)
    servos = env.controller.gains()
    assert np.all(servos.stiffness[moved] == 33.0) and np.all(servos.damping[moved] == 0.0)
    env.reset(seed=3, options=SHAKY)
    np.testing.assert_array_equal(servos.stiffness, before)
