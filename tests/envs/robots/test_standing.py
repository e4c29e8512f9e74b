"""The standing posture: from the description, levelled, turned to face forward."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot, load_robot
from tests.support.refused import invalid
from tests.support.small_biped import BOX_FOOT, LEG, write_biped

POSTURE = {"hip": -20.0, "knee": 40.0, "ankle": -20.0, "ankle_roll": 0.0}


def joint_angles(robot: Robot) -> dict[str, float]:
    """Joint name → angle in degrees."""
    return dict(zip(robot.joint_names, np.rad2deg(robot.standing_qpos[7:]), strict=True))


def posture(**change: float) -> dict:
    return {"joints": {f"*_{joint}": v for joint, v in (POSTURE | change).items()}}


def test_posture_is_the_described_one(tmp_path: Path) -> None:
    """A posture with flat feet is taken as it is; degrees by default, radians on request."""
    expected = {f"{side}_{joint}": v for side in ("left", "right") for joint, v in POSTURE.items()}
    robot = load_robot(write_biped(tmp_path))
    assert joint_angles(robot) == pytest.approx(expected, abs=1e-9)
    radians = {"unit": "radian", "joints": {"*_hip": -0.3, "*_knee": 0.6, "*_ankle": -0.3}}
    robot = load_robot(write_biped(tmp_path, posture=radians))
    assert joint_angles(robot)["left_knee"] == pytest.approx(np.rad2deg(0.6))


def test_keyframe(tmp_path: Path) -> None:
    """A keyframe gives the posture; joints in the description replace its values."""
    legs = "-0.3 0.6 -0.3 0 " * 2
    model = load_robot(write_biped(tmp_path)).model
    assert model.nkey == 0
    key = f'<keyframe><key name="stand" qpos="5 5 5 1 0 0 0 {legs}"/></keyframe>'
    extra = '<actuator><motor joint="left_hip" ctrlrange="-9 9"/></actuator>' + key
    robot = load_robot(write_biped(tmp_path, extra=extra, posture={"keyframe": "stand"}))
    np.testing.assert_allclose(robot.standing_qpos[7:], [-0.3, 0.6, -0.3, 0] * 2, atol=1e-9)
    np.testing.assert_allclose(
        robot.standing_qpos[0], load_robot(tmp_path / "biped.yaml").standing_qpos[0]
    )
    changed = {"keyframe": "stand", "joints": {"*_hip": -20, "*_knee": 40, "*_ankle": -20}}
    robot = load_robot(write_biped(tmp_path, extra=extra, posture=changed))
    assert joint_angles(robot)["right_knee"] == pytest.approx(40)


def test_small_errors_are_levelled(tmp_path: Path) -> None:
    """Feet off by 2° in pitch and roll become flat by small changes of the legs alone."""
    joints = {"left_ankle": -18, "right_ankle": -21, "left_ankle_roll": 2, **posture()["joints"]}
    path = write_biped(tmp_path, posture={"joints": joints})
    robot = load_robot(path)
    np.testing.assert_allclose(robot.standing_qpos[3:7], [1, 0, 0, 0], atol=1e-12)
    angles = joint_angles(robot)
    for side in ("left", "right"):
        pitch = [angles[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle")]
        assert sum(pitch) == pytest.approx(0, abs=1e-6)
        assert angles[f"{side}_ankle_roll"] == pytest.approx(0, abs=1e-6)
        assert pitch == pytest.approx([-20, 40, -20], abs=3)


def test_uneven_legs_are_levelled(tmp_path: Path) -> None:
    """A sole that is 2 mm thicker on one side is made up for by the knees."""
    thicker = BOX_FOOT.replace("-0.04", "-0.042")
    robot = load_robot(write_biped(tmp_path, right_foot=thicker))
    angles = joint_angles(robot)
    assert angles["right_knee"] > angles["left_knee"] + 0.2


def test_leg_joints_stay_in_their_range(tmp_path: Path) -> None:
    """Joints that the description leaves out stay inside their range."""
    joints = {"*_hip": -5, "*_ankle": 0}  # the knee's range begins at 5°
    robot = load_robot(write_biped(tmp_path, posture={"joints": joints}))
    assert joint_angles(robot)["left_knee"] == pytest.approx(5)


@pytest.mark.parametrize("forward", [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (1, 1, 0.2)])
def test_faces_forward(tmp_path: Path, forward: tuple[float, float, float]) -> None:
    """Whatever axis of the root is forward, the standing robot faces along +x, upright."""
    robot = load_robot(write_biped(tmp_path, forward=list(forward)))
    root = Rotation.from_quat(robot.standing_qpos[3:7], scalar_first=True)
    x, y, z = root.apply(forward)
    assert x > 0.9 and y == pytest.approx(0, abs=1e-12) and z == pytest.approx(forward[2])


WRONG = {
    "not flat": ({"posture": posture(ankle=5)}, ["feet[0]", "left_foot", "flat", "15°"]),
    "off by 12°": ({"posture": posture(ankle=-8)}, ["posture", "cannot be made flat"]),
    "unknown joint": (
        {"posture": {"joints": {"tail": 1}}},
        ["posture.joints", "'tail'", "choices"],
    ),
    "out of range": (
        {"posture": posture(knee=-40)},
        ["posture.joints", "-40", "left_knee", "5 to 150"],
    ),
    "no keyframe": ({"posture": {"keyframe": "sit"}}, ["posture.keyframe", "'sit'", "choices"]),
    "unit": ({"posture": {"unit": "grad"}}, ["posture.unit", "degree, radian"]),
    "vertical": ({"forward": [0, 0, 1]}, ["forward", "not level"]),
    "zero": ({"forward": [0, 0, 0]}, ["forward", "zero vector"]),
    "stiff legs": (
        {
            "leg": LEG.replace('<joint name="{side}_ankle_roll"', "<!--").replace(
                'axis="1 0 0" range="-30 30"/>', "-->"
            ),
            "right_foot": BOX_FOOT.replace("/>", ' euler="3 0 0"/>'),
            "extra": '<actuator><motor joint="left_hip" ctrlrange="-9 9"/></actuator>',
        },
        ["posture", "cannot be made flat"],
    ),
}


@pytest.mark.parametrize(("change", "words"), WRONG.values(), ids=WRONG)
def test_wrong_postures(tmp_path: Path, change: dict, words: list[str]) -> None:
    """A posture that cannot stand is refused with the file, the field and the choices."""
    path = write_biped(tmp_path, **change)
    with pytest.raises(ConfigError) as caught:
        load_robot(path)
    for word in [str(path), *words]:
        assert word in str(caught.value)


@pytest.mark.parametrize("single", [False, True])
def test_the_com_goes_over_the_middle(tmp_path: Path, single: bool) -> None:
    """By the legs alone, also where their ankles do not roll; the soles stay flat and apart."""
    leg = LEG.replace('<joint name="{side}_ankle_roll" axis="1 0 0" range="-30 30"/>', "")
    change: dict = {"leg": leg, "extra": "", "torque_limits": {"*": 50}} if single else {}
    (tmp_path / "plain").mkdir()
    plain = load_robot(write_biped(tmp_path / "plain", **change))
    assert abs(plain.com_ahead) > 0.01
    middle = {"joints": {"*_hip": -20, "*_knee": 40, "*_ankle": -20}, "com": "middle"}
    robot = load_robot(write_biped(tmp_path, posture=middle, **change))
    assert robot.com_ahead == pytest.approx(0.0, abs=1e-6)
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    mujoco.mj_forward(robot.model, data)
    for sole, old in zip(robot.soles, plain.soles, strict=True):
        turn = data.xmat[sole.body_id].reshape(3, 3) @ sole.rotation
        np.testing.assert_allclose(turn, np.eye(3), atol=1e-9)
        np.testing.assert_allclose(sole.polygon, old.polygon, atol=1e-9)
    left, right = (data.xpos[s.body_id] for s in robot.soles)
    np.testing.assert_allclose((left - right)[:2], [0.0, 0.2], atol=1e-6)


def test_a_com_that_legs_cannot_bring_there(tmp_path: Path) -> None:
    """How far it is away, in millimetres."""
    weight = '<geom size="0.05" pos="0.9 0 0" mass="60"/>'
    path = write_biped(tmp_path, trunk=weight, posture={**posture(), "com": "middle"})
    with invalid("posture.com"):
        load_robot(path)


def test_straight_legs_do_not_throw_the_levelling(tmp_path: Path) -> None:
    """A knee that does not lengthen its leg is not turned by millions of degrees."""
    leg = LEG.replace('range="5 150"', 'range="0 150"')
    thicker = BOX_FOOT.replace("-0.04", "-0.042")
    path = write_biped(
        tmp_path, leg=leg, right_foot=thicker, posture=posture(hip=0, knee=0, ankle=0)
    )
    with pytest.raises(ConfigError) as caught:
        load_robot(path)
    assert "tilted, 'left_foot' by 0.0° and 'right_foot' by 0.0°, and one is 2.0 mm higher" in str(
        caught.value
    )
