"""Limbs are found on every packaged robot, where a person would point at them."""

import mujoco
import numpy as np
import pytest

from poise.baselines.motion.retargeting.limbs import find_limbs
from tests.support.physics import robot_named

ROBOTS = ("humanoid", "compact", "tall", "toddler")


@pytest.mark.parametrize("name", ROBOTS)
def test_limbs_are_in_order_and_on_their_side(name: str) -> None:
    robot = robot_named(name)
    limbs, data = find_limbs(robot), mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(robot.model, data)
    at = {role: point.place(data) for role, point in limbs.points.items()}
    assert limbs.has_arms
    for side, sign in (("left", 1.0), ("right", -1.0)):
        legs = [at[f"{role}_{side}"][2] for role in ("hip", "knee", "ankle")]
        arms = [at[f"{role}_{side}"][2] for role in ("shoulder", "elbow", "hand")]
        assert legs == sorted(legs, reverse=True) and arms == sorted(arms, reverse=True)
        assert all(sign * at[f"{role}_{side}"][1] > 0.03 for role in ("hip", "ankle", "hand"))
        assert at[f"knee_{side}"][0] > at[f"hip_{side}"][0]  # knees stand bent forward
    assert at["chest"][2] > at["pelvis"][2] + 0.2
    assert 0.8 < limbs.leg_length / (at["pelvis"] - at["feet"])[2] < 1.2


def test_the_jacobian_of_a_point_is_its_derivative() -> None:
    robot = robot_named("humanoid")
    model, data, point = robot.model, mujoco.MjData(robot.model), find_limbs(robot).points["chest"]
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    jacobian, start = point.jacobian(model, data), point.place(data)
    direction = np.random.default_rng(0).normal(size=model.nv)
    mujoco.mj_integratePos(model, data.qpos, direction, 1e-6)
    mujoco.mj_kinematics(model, data)
    assert (point.place(data) - start) / 1e-6 == pytest.approx(jacobian @ direction, abs=1e-4)
