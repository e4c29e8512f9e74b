"""The CoM of a motion with steps: over its ZMP, which the planted soles bear."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.references.foot_steps import FootStep, Waypoint, plan_steps
from poise.baselines.balance.references.footing import sole_poses
from poise.baselines.balance.references.footwork import (
    NotReached,
    com_over,
    perform_plan,
    plan_zmp,
    real_zmp,
)
from poise.baselines.balance.references.legs import nominal_feet
from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import RATE
from poise.baselines.motion.feasibility.check import check_motion
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease
from poise.envs.robots.robot import Robot
from tests.support.physics import robot_named


def test_the_com_is_that_of_a_pendulum_over_its_zmp() -> None:
    """c − s Δ²c = p in every frame but the ends, which are given."""
    rng = np.random.default_rng(0)
    zmp, share = rng.normal(size=(50, 2)), rng.uniform(50.0, 90.0, 50)
    com = com_over(zmp, share, np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    second = com[2:] - 2.0 * com[1:-1] + com[:-2]
    assert com[1:-1] - share[1:-1, None] * second == pytest.approx(zmp[1:-1], abs=1e-9)
    assert com[[0, -1]] == pytest.approx(np.array([[1.0, 2.0], [3.0, 4.0]]))


def test_what_packaged_motions_ask_for_the_robot_has() -> None:
    """By inverse dynamics, 100 times a second: ZMP, friction, every motor; one sole bears all."""
    for name in ("kick", "step_in_place"):
        judged = check_motion(load_motion(name, robot_named("humanoid")), robot_named("humanoid"))
        assert judged.feasible, judged.reason
        assert judged.zmp_margin.min() > 0.03


def test_the_zmp_goes_from_foot_to_foot() -> None:
    robot = robot_named("humanoid")
    frames = 130
    joints = np.tile(robot.standing_qpos[7:], (frames, 1))
    steps = [FootStep("left", 1.4, 2.4, (Waypoint(1.9, up=0.1),), ahead=0.1)]
    plan = plan_steps(steps, joints, np.zeros((frames, 3)), robot, "x")
    feet = nominal_feet(robot)
    rest = com_of(robot, robot.standing_qpos)[:2] - feet[:, :2].mean(axis=0)
    zmp = plan_zmp(robot, plan, rest)
    a, b = round(1.4 / RATE), round(2.4 / RATE)
    assert zmp[a + 1 : b, 1] == pytest.approx(np.full(b - a - 1, feet[1, 1]))  # on the right sole
    middle = feet[:, :2].mean(axis=0) + rest
    assert zmp[0] == pytest.approx(middle)
    assert zmp[-1] == pytest.approx(middle + [0.05 * robot.height_com, 0.0])
    assert np.abs(np.diff(zmp, axis=0)).max() < 0.02  # and nowhere at once
    qpos = perform_plan(robot, plan, "x")
    com = np.array([com_of(robot, q) for q in qpos]) - [0.0, 0.0, feet[:, 2].mean()]
    assert real_zmp(robot, qpos, com, RATE) == pytest.approx(zmp, abs=0.02)


def com_of(robot: Robot, qpos: np.ndarray) -> np.ndarray:
    data = mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    mujoco.mj_comPos(robot.model, data)
    return np.array(data.subtree_com[robot.root_body_id])


def test_a_step_beyond_the_legs_is_refused() -> None:
    robot = robot_named("humanoid")
    joints = np.tile(robot.standing_qpos[7:], (120, 1))
    steps = [FootStep("left", 1.4, 2.0, (Waypoint(1.7, up=0.1),), ahead=1.5)]
    plan = plan_steps(steps, joints, np.zeros((120, 3)), robot, "far")
    with pytest.raises(ConfigError, match="far: feet: "):
        perform_plan(robot, plan, "far")


def test_what_legs_lack_by_little_the_body_sinks() -> None:
    """Only near where they lack it, without a corner, and soles are where they were to be."""
    robot, frames = robot_named("humanoid"), 150
    joints = np.tile(robot.standing_qpos[7:], (frames, 1))
    steps = [FootStep("left", 1.4, 2.0, (Waypoint(1.7, up=0.1),), ahead=0.43)]
    plan = plan_steps(steps, joints, np.zeros((frames, 3)), robot, "far")
    low = ease(np.clip(np.minimum(np.arange(frames), np.arange(frames)[::-1]) / 30.0, 0.0, 1.0))
    plan = plan._replace(height=plan.height * (1.0 - 0.06 * low))
    with pytest.raises(NotReached, match=r"cannot reach at 1\.\d\d s: \d\.\d cm lack") as lacking:
        perform_plan(robot, plan, "far")
    assert 0.002 < lacking.value.by < 0.01
    com, places, _ = sole_poses(robot, perform_plan(robot, plan, "far", 0.04))
    sunk = plan.height - com[:, 2]
    assert 0.004 < sunk.max() <= 0.04 + 1e-6 and sunk.min() > -1e-6
    assert sunk[:30] == pytest.approx(0.0, abs=1e-6)  # before the first step
    assert np.abs(np.diff(sunk, 2)).max() / RATE**2 < 3.0  # [m/s²]
    assert places[plan.planted] == pytest.approx(plan.places[plan.planted], abs=2.5e-3)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("steps: [{foot: left, lift: 0.5, land: 0.55}]", "times must rise"),
        ("steps: [{foot: left, lift: 1.4, land: 2}, {foot: right, lift: 1.7, land: 2.5}]",
         "one after the other"),
        ("steps: [{foot: left, lift: 1.4, land: 2.9}]", "1.3 s of standing are needed"),
        ("loop: true\nsteps: [{foot: left, lift: 1.4, land: 1.7}]", "not with loop"),
        ("steps: [{foot: middle, lift: 1, land: 2}]", "left, right"),
    ],
)  # fmt: skip
def test_wrong_steps_are_one_line(text: str, reason: str, tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text("keyframes: [{time: 0}, {time: 3}]\n" + text)
    with pytest.raises(ConfigError, match=reason):
        load_motion(path, robot_named("humanoid"))
