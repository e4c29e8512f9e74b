"""baselines/environments/guard: when it takes over from a walker, with what, and hands back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from poise.baselines.environments.guard.config import GuardConfig
from poise.baselines.environments.guard.env import GuardedEnv
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.errors import ConfigError
from poise.envs.balance.mdp.termination import uprightness
from poise.envs.balance.vector.batch import replicate
from poise.envs.sensing.config import RAW, EstimatorConfig
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.realism import load_realism
from tests.support.policies import linear, write_onnx, write_yaml
from tests.support.shared import robot as shared_robot

COMMAND = {"ahead": 0.3, "turn": 0.2}
PUSH = {"impulse": 22.0, "direction": 30.0, "duration": 0.1, "start": 0.1, "body": "torso_link"}
CALM = {"closes": 0.2, "opens": 0.2, "tilt": 0.5, "speed": 0.5, "joint_speed": 5.0}
FAR = {"margin": 9.0, "tilt": 3.1}  # [m], [rad] beyond what a robot on its feet comes to


@pytest.fixture(scope="module")
def walker(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A small policy that sees a command, and stands around the standing posture."""
    folder, standing = tmp_path_factory.mktemp("walker"), shared_robot("compact").standing_qpos[7:]
    names, n = shared_robot("compact").joint_names, len(standing)
    write_onnx(folder / "policy.onnx", linear(3 + n, n))
    return str(write_yaml(
        folder / "own.yaml", kind="policy-file", policy="policy.onnx", joints=list(names),
        default=[float(q) for q in standing],
        stiffness=[400.0 if any(p in x for p in ("hip", "knee", "ankle")) else 60.0 for x in names],
        damping=5.0, action_scale=0.03, observations=[{"term": "command"}, {"term": "dof_pos"}],
    ))  # fmt: skip


def guarded(walker: str, limits: dict[str, float], **more: Any) -> GuardedEnv:
    guard = GuardConfig(walker=walker, recovery="", **limits)
    given = {"duration": 2.0, "pushes": None, **more}
    return GuardedEnv(shared_robot("compact"), controller=walker, guard=guard, **given)


def standing(env: ResidualBalanceEnv) -> np.ndarray:
    """The action whose servos hold the standing posture."""
    return np.zeros(env.action_space.shape)


def is_off(env: GuardedEnv, limits: dict[str, float]) -> bool:
    """Whether the limits are passed by what is believed now, computed apart."""
    state = env.state_source.state
    polygon, point = state.support_polygon, state.capture_point
    edges = np.roll(polygon, -1, axis=0) - polygon
    outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    outside = np.max(np.sum(outward * (point - polygon), axis=1))
    tilt = np.arccos(uprightness(env.arrays, env.state_source.state_arrays))
    return bool(outside > limits["margin"] or tilt > limits["tilt"])


def test_within_its_limits_the_walker_is_alone_bit_for_bit(walker: str) -> None:
    """Pushed until it falls; whatever the recovery policy wants."""
    env = guarded(walker, FAR)
    plain = ResidualBalanceEnv(shared_robot("compact"), controller=walker, duration=2.0,
                               pushes=None)  # fmt: skip
    ends = []
    for each, action in ((plain, standing(plain)), (env, np.ones(env.action_space.shape))):
        each.reset(seed=3, options={"push": PUSH, "command": COMMAND})
        while each.episode.running:
            each.step_without_info(action)
        ends.append(np.concatenate([each.data.qpos, each.data.qvel, each.data.ctrl]))
    np.testing.assert_array_equal(*ends)
    assert plain.fallen and env.takeovers == 0


@pytest.mark.parametrize(
    ("limits", "level"),
    [
        ({**FAR, "margin": 0.03}, {}),
        ({**FAR, "tilt": 0.1}, {}),
        ({**FAR, "margin": 0.03}, {"latency": {"sense": 0.02}}),
    ],
)
def test_it_takes_over_at_its_limits_by_what_is_believed(
    walker: str, limits: dict[str, float], level: dict[str, Any]
) -> None:
    """In the policy step before which a limit is first passed, and in none before that."""
    env = guarded(walker, limits, realism=level) if level else guarded(walker, limits)
    env.reset(seed=3, options={"push": PUSH, "noise": 0.0})
    for _ in range(60):
        off = is_off(env, limits)
        env.step_without_info(standing(env))
        assert env.authority == float(off) and env.takeovers == int(off)
        if off:
            break
    assert off and env.simulation.time > 0.1


def test_the_state_is_estimated_whatever_the_walker_reads(walker: str) -> None:
    """An external policy gets what is measured; the guard asks for velocities."""
    level = load_realism("field")
    plain = ResidualBalanceEnv(shared_robot("compact"), controller=walker, realism=level)
    env = guarded(walker, FAR, realism=level)
    for each, config in ((plain, RAW), (env, EstimatorConfig())):
        assert isinstance(each.state_source, EstimatedState)
        assert each.state_source.config == config


def test_its_servos_have_all_torques(walker: str) -> None:
    """τ = clip(K (q* − q) − D q̇, ± τ_max), whatever `authority` says."""
    env = guarded(walker, {**FAR, "margin": 0.0}, policy_period=0.02)
    env.reset(seed=3, options={"push": PUSH, "noise": 0.0})
    action = np.full(env.action_space.shape, 0.1)
    action[-1] = -1.0
    servos, limit, checked = env.servos, env.robot.torque_limit, 0
    for _ in range(40):
        if env.authority == 0.0:
            env.step_without_info(action)
            continue
        env.set_action(action)
        for _ in range(env.ticks):
            q, v = env.data.qpos[servos.dofs + 1].copy(), env.data.qvel[servos.dofs].copy()
            env.tick()
            target = servos.hold + servos.reach * 0.1
            expected = np.clip(servos.stiffness * (target - q) - servos.damping * v, -limit, limit)
            np.testing.assert_allclose(env.data.ctrl, expected, atol=1e-9 * limit.max())
            checked += 1
        if not env.episode.running:
            break
    assert checked > 50


def test_once_calm_the_walker_begins_anew_with_its_command(walker: str) -> None:
    """Not before it was calm for `calm_time`, each time, and not at a standing command."""
    calm = {**CALM, "speed": 0.1, "calm_time": 0.2}
    env = guarded(walker, {**FAR, "tilt": 0.08}, hand_over=calm, duration=3.0)
    begun: list[int] = []
    reset = env.controller.reset

    def counted(state: Any) -> None:
        begun.append(env.steps)
        reset(state)

    env.controller.reset = counted
    options = {"push": {**PUSH, "impulse": 9.0}, "noise": 0.0, "command": COMMAND}
    env.reset(seed=3, options=options)
    shares = [0.0]
    while env.episode.running:
        env.step_without_info(standing(env))
        shares.append(env.authority)
        assert env.command is not None and env.command.ahead == COMMAND["ahead"]
        assert env.command.turn == COMMAND["turn"]
    taken, given = (np.flatnonzero(np.diff(shares) == sign) for sign in (1.0, -1.0))
    assert not env.fallen and len(taken) == len(given) == env.takeovers > 2
    assert np.all(given - taken >= 0.2 / env.config.policy_period)
    assert begun == [0, *given]
    env.reset(seed=3, options=options)
    assert env.takeovers == 0 and env.authority == 0.0


def test_another_one_like_it_does_the_same(walker: str) -> None:
    """Bit for bit, also after an episode of its own."""
    one, other = replicate(guarded(walker, {**FAR, "margin": 0.02}), 2)
    other.reset(seed=1)
    other.step_without_info(standing(other))
    ends = []
    for env in (one, other):
        env.reset(seed=3, options={"push": PUSH})
        while env.episode.running:
            env.step_without_info(standing(env))
        ends.append(env.data.qpos.copy())
    np.testing.assert_array_equal(*ends)
    assert isinstance(one, GuardedEnv) and one.takeovers > 0


def test_who_sees_no_command_is_no_walker(walker: str) -> None:
    n = len(shared_robot("compact").joint_names)
    write_onnx(Path(walker).with_name("blind.onnx"), linear(n, n))
    text = Path(walker).read_text().replace("policy.onnx", "blind.onnx")
    blind = Path(walker).with_name("blind.yaml")
    blind.write_text(text.replace("- term: command\n", ""))
    with pytest.raises(ConfigError, match="walker: does not walk: it sees no velocity_commands"):
        guarded(str(blind), FAR)
