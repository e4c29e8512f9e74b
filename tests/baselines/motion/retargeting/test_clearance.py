"""Links keep off the floor and off each other, and part where they have met."""

import mink
import mujoco
import numpy as np
import pytest

from poise.baselines.motion.retargeting.clearance import APART, FLOOR, ClearanceLimit
from tests.support.physics import robot_named
from tests.support.shared import robot


def limit_at(
    angles: dict[str, float], height: float = 0.0, tilt: float = 0.0
) -> tuple[ClearanceLimit, mink.Configuration]:
    """The limit of the humanoid, and a configuration with these joints [rad] and root."""
    robot = robot_named("humanoid")
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_kinematics(robot.model, data)
    limit, qpos = ClearanceLimit(robot, data), robot.standing_qpos.copy()
    for name, angle in angles.items():
        qpos[7 + robot.joint_names.index(name)] = angle
    qpos[2] += height
    qpos[3:7] = [np.cos(0.5 * tilt), np.sin(0.5 * tilt), 0.0, 0.0]
    return limit, mink.Configuration(robot.model, q=qpos)


def test_standing_lacks_nothing_and_soles_may_touch() -> None:
    limit, configuration = limit_at({})
    assert limit.depth(configuration.data) == 0.0
    assert not limit.lacking(configuration.data).size
    names = {limit.model.geom(pair.first).name for pair in limit.pairs}
    assert "floor" in names and len(limit.pairs) > 50
    floors = {limit.model.geom(p.second).name for p in limit.pairs if p.kept == FLOOR}
    assert "right_hand" in floors and "right_sole" not in floors


def test_a_row_is_the_rate_of_the_distance() -> None:
    """Against differences, for hands near the floor and for an arm in waist and thigh.

    The robot is tilted: where a level link lies over the floor the distance has a kink.
    """
    arm = {"left_shoulder1": -1.02, "left_shoulder2": 0.57, "left_elbow": -1.0}
    for angles, height in (({}, -0.68), (arm, 0.0)):
        limit, configuration = limit_at(angles, height, tilt=0.1)
        rng, h, checked = np.random.default_rng(0), 1e-4, 0
        for pair in limit.pairs:
            distance, row = limit.row(configuration.data, pair)
            if row is None or abs(distance) < 2e-3:
                continue
            way = rng.normal(size=limit.model.nv)
            ends = [configuration.integrate(way, sign * h) for sign in (-1.0, 1.0)]
            before, after = (
                limit.distance(mink.Configuration(limit.model, q=q).data, pair, np.empty(6))
                for q in ends
            )
            assert row @ way == pytest.approx((after - before) / (2 * h), abs=0.02)
            checked += 1
        assert checked > 4


def test_what_has_met_is_parted() -> None:
    """Steps within the limit alone bring a robot that is 10 cm in the floor out of it."""
    limit, configuration = limit_at({"right_hip_y": -1.5, "right_knee": -2.0}, -0.72)
    assert limit.depth(configuration.data) > 0.05
    for _ in range(60):
        rows = limit.compute_qp_inequalities(configuration, 1.0)
        if rows.inactive:
            break
        step = -np.linalg.lstsq(rows.G, np.maximum(-rows.h, 0.0), rcond=None)[0]
        configuration.integrate_inplace(step, 1.0)
    assert limit.depth(configuration.data) == 0.0
    assert limit.lacking(configuration.data).max(initial=0.0) < APART


def test_an_ankle_just_above_its_sole_may_roll() -> None:
    """The links of the G1's feet stand nearer to the floor than others are to come."""
    g1 = robot("unitree_g1")
    data = mujoco.MjData(g1.model)
    data.qpos[:] = g1.standing_qpos
    mujoco.mj_kinematics(g1.model, data)
    limit, near = ClearanceLimit(g1, data), 0
    for pair in limit.pairs:
        if 0 in g1.model.geom_bodyid[list(pair[:2])]:
            distance = limit.distance(data, pair, np.empty(6))
            assert pair.kept == FLOOR or pair.kept <= 0.6 * distance
            near += pair.kept < FLOOR
    assert near
