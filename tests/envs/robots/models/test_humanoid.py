"""The standard humanoid built from Gymnasium's file."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from poise.envs.robots.models.humanoid import humanoid_path, humanoid_spec
from poise.envs.robots.robot import load_robot


def test_is_the_humanoid_of_the_design() -> None:
    """27 degrees of freedom, 21 motors, 40.9 kg, CoM near 0.8 m, soles of 0.26 m × 0.08 m."""
    robot = load_robot()
    assert (robot.name, robot.model.nq, robot.model.nv, robot.model.nu) == ("humanoid", 28, 27, 21)
    assert robot.mass == pytest.approx(40.9, abs=0.01)
    assert robot.height_com == pytest.approx(0.80, abs=0.02)
    for sole in robot.soles:
        np.testing.assert_allclose(np.ptp(sole.polygon, axis=0), [0.26, 0.08], atol=1e-9)
        geoms = list(sole.geom_ids)
        assert np.all(robot.model.geom_condim[geoms] == 3)
        assert np.all(robot.model.geom_friction[geoms, 0] == 0.8)
    assert not robot.model.geom_margin.any()
    assert robot.model.geom_friction[robot.ground_geom_id, 0] == 0.8


def test_torque_limits() -> None:
    """Limits are gear × 0.4 of Gymnasium's motors, and 20 N·m at the ankles."""
    robot = load_robot()
    limits = dict(
        zip([robot.joint_names[i - 6] for i in robot.motor_dofs], robot.torque_limit, strict=True)
    )
    kinds = {"hip_y": 120, "knee": 80, "hip_x": 40, "hip_z": 40, "ankle_y": 20, "ankle_x": 20}
    kinds |= {"shoulder1": 10, "shoulder2": 10, "elbow": 10}
    expected = {f"{side}_{kind}": v for side in ("left", "right") for kind, v in kinds.items()}
    expected |= {f"abdomen_{axis}": 40 for axis in "xyz"}
    assert limits == pytest.approx(expected)


def test_trunk_is_upright_with_knees_bent() -> None:
    """Standing, the trunk is upright and the knees are bent 40°."""
    robot = load_robot()
    np.testing.assert_allclose(robot.standing_qpos[3:7], [1, 0, 0, 0], atol=1e-12)
    for side in ("left", "right"):
        knee = 7 + robot.joint_names.index(f"{side}_knee")
        assert np.rad2deg(robot.standing_qpos[knee]) == pytest.approx(-40, abs=1)


def test_sides_mirror_each_other() -> None:
    """Equal ankle angles tilt left and right soles as in a mirror."""
    model = humanoid_spec().compile()
    data = mujoco.MjData(model)
    for side in ("left", "right"):
        for name, angle in (("ankle_y", 0.2), ("ankle_x", 0.3)):
            data.joint(f"{side}_{name}").qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    normals = {
        side: data.body(f"{side}_foot").xmat.reshape(3, 3)[:, 2] for side in ("left", "right")
    }
    np.testing.assert_allclose(normals["left"], normals["right"] * [1, -1, 1], atol=1e-12)
    assert abs(normals["left"][1]) > 0.1


def test_keeps_gymnasiums_joints() -> None:
    """What the design does not change is Gymnasium's: ranges, damping, stiffness, armature."""
    ours, theirs = humanoid_spec().compile(), mujoco.MjModel.from_xml_path(str(humanoid_path()))
    for i in range(1, theirs.njnt):
        name = theirs.joint(i).name
        for field in ("range", "damping", "stiffness", "armature", "axis"):
            np.testing.assert_array_equal(
                getattr(ours.joint(name), field), getattr(theirs.joint(name), field)
            )
