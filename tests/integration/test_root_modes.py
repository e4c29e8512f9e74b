"""Hard and soft root: u_root is nothing, or what keeps a game character on its feet."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config
from tests.support.physics import controller, recovery, robot_named


@pytest.fixture(scope="module")
def robot():
    return robot_named("humanoid")


def test_a_heavy_soft_root_is_a_hard_root():
    """As ω_root grows, u_root goes to 0 and the torques to those of a hard root, as 1/ω_root."""
    hard = [tick for tick in recovery() if tick.solved][10::12]
    robot = robot_named("humanoid")
    soft = controller(robot, root="soft")
    root = soft.tasks["root"].block
    light = root.weight.copy()
    errors, leaning = [], []
    for weight in (1e2, 1e4, 1e6, 1e8):
        root.weight[:] = weight * light / 1e3
        differences, wrenches = [], []
        for tick in hard:
            soft.reset()
            soft.workspace.cop_prev[:] = tick.state.cop - soft.period * tick.cop_vel
            torques = soft.torques(tick.state, tick.targets)
            differences.append(np.abs(torques - tick.torques).max())
            wrenches.append(np.abs(soft.root_wrench).max())
        errors.append(max(differences))
        leaning.append(max(wrenches))
    assert leaning[0] > 1.0
    for values in (errors, leaning):
        assert values[1] < 0.2 * values[0]
        assert values[2] < 0.05 * values[1]
        assert values[3] < 0.05 * values[2]
    assert errors[3] < 1e-3


@pytest.mark.parametrize("direction", [0.0, 90.0, 200.0])
def test_a_soft_root_never_falls(robot, direction):
    """A push that no robot could take, 1.5 N·s/kg, and with a soft root it still stands."""
    body = robot.model.body(robot.root_body_id).name
    push = {"impulse": 1.5 * robot.mass, "direction": direction, "duration": 0.1, "start": 0.1,
            "body": body}  # fmt: skip
    fell = {}
    for root in ("soft", "hard"):
        config = replace(controller_config("momentum-qp"), root=root)
        env = ResidualBalanceEnv(robot, controller=config, pushes=None, duration=2.0)
        env.reset(seed=0, options={"push": push})
        for _ in range(env.max_steps):
            env.step_without_info(np.zeros(4))
            if env.fallen:
                break
        fell[root] = env.fallen
        leaned = env.episode.metrics.root_force
        assert (leaned > 50.0) == (root == "soft")  # [N]
        assert np.abs(env.controller.root_wrench).max() > 0.0 or root == "hard"
    assert fell == {"soft": False, "hard": True}
