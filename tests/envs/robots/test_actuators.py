"""Actuators of any kind become plain torque motors with the right limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.robots.actuators import proposed_armature
from poise.envs.robots.robot import Robot, load_robot
from tests.support.small_biped import JOINTS, LEG, motors, write_biped

NAMES = [f"{side}_{joint}" for side in ("left", "right") for joint in JOINTS]


def limits(robot: Robot) -> dict[str, float]:
    names = [robot.joint_names[i - 6] for i in robot.motor_dofs]
    return dict(zip(names, robot.torque_limit, strict=True))


def section(line: str, extra: str = "") -> str:
    """An actuator section with this line for each joint, ``{}`` standing for the joint."""
    return f"<actuator>{''.join(line.format(name) for name in NAMES)}{extra}</actuator>"


SERVOS = {
    "motor: ctrlrange × gear": ('<motor joint="{}" gear="50" ctrlrange="-.4 .4"/>', 20),
    "motor: forcerange × gear": ('<motor joint="{}" gear="5" forcerange="-3 3"/>', 15),
    "motor: the smaller of both": (
        '<motor joint="{}" gear="2" ctrlrange="-9 9" forcerange="-7 7"/>',
        14,
    ),
    "motor: the smaller side": ('<motor joint="{}" ctrlrange="-8 20"/>', 8),
    "motor: negative gear": ('<motor joint="{}" gear="-10" ctrlrange="-1 1"/>', 10),
    "position: forcerange": ('<position joint="{}" kp="9" forcerange="-30 30"/>', 30),
    "velocity: forcerange": ('<velocity joint="{}" kv="9" forcerange="-6 6"/>', 6),
    "general: forcerange × gear": (
        '<general joint="{}" gainprm="9" biastype="affine" biasprm="0 -9 0" gear="3" '
        'ctrlrange="-1 1" forcerange="-4 4"/>',
        12,
    ),
    "position and velocity: the stronger": (
        '<position joint="{0}" kp="9" forcerange="-30 30"/>'
        '<velocity joint="{0}" kv="1" forcerange="-5 5"/>',
        30,
    ),
}


@pytest.mark.parametrize(("line", "limit"), SERVOS.values(), ids=SERVOS)
def test_limits_of_the_model(tmp_path: Path, line: str, limit: float) -> None:
    """Each kind of actuator gives one motor with the torque that its own limits allow."""
    robot = load_robot(write_biped(tmp_path, extra=section(line)))
    assert limits(robot) == pytest.approx(dict.fromkeys(NAMES, limit))
    assert np.all(robot.model.actuator_gear[:, 0] == 1)


def test_joint_force_range_bounds(tmp_path: Path) -> None:
    """The joint's actuatorfrcrange bounds servos that have no limit, and stronger motors."""
    leg = LEG.replace('axis="0 1 0"', 'axis="0 1 0" actuatorfrcrange="-17 17"')
    leg = leg.replace('axis="1 0 0"', 'axis="1 0 0" actuatorfrcrange="-17 17"')
    for extra in (section('<position joint="{}" kp="100"/>'), motors(ctrlrange="-99 99")):
        robot = load_robot(write_biped(tmp_path, leg=leg, extra=extra))
        assert set(limits(robot).values()) == {17}
    robot = load_robot(write_biped(tmp_path, leg=leg, extra=motors(ctrlrange="-9 9")))
    assert set(limits(robot).values()) == {9}


def test_description_wins(tmp_path: Path) -> None:
    """The description's limits win over the model's; a name wins over patterns, in their order."""
    leg = LEG.replace("range=", 'actuatorfrcrange="-17 17" range=')
    torque_limits = {"*_ankle*": 30, "*": 40, "left_knee": 90}
    robot = load_robot(write_biped(tmp_path, leg=leg, torque_limits=torque_limits))
    found = limits(robot)
    assert found["left_ankle"] == found["right_ankle_roll"] == 30
    assert found["left_hip"] == found["right_knee"] == 40
    assert found["left_knee"] == 90
    assert not robot.model.jnt_actfrclimited.any(), "nothing else may clip the torque"


def test_joint_without_actuator(tmp_path: Path) -> None:
    """A joint without an actuator stays passive, unless the description gives it a limit."""
    trunk = '<body><joint name="tail"/><geom size="0.02" pos="0 0 0.2"/></body>'
    robot = load_robot(write_biped(tmp_path, trunk=trunk))
    assert "tail" in robot.joint_names and "tail" not in limits(robot)
    robot = load_robot(write_biped(tmp_path, trunk=trunk, torque_limits={"tail": 2}))
    assert limits(robot)["tail"] == 2


def test_model_without_actuators(tmp_path: Path) -> None:
    """Limits alone give motors to a model that has none."""
    robot = load_robot(write_biped(tmp_path, extra="", torque_limits={"*": 25}))
    assert limits(robot) == dict.fromkeys(NAMES, 25)


def test_rotor_inertia_goes_to_the_joint(tmp_path: Path) -> None:
    """Armature and damping of the actuator, times gear squared, stay when it is replaced."""
    line = '<motor joint="{}" ctrlrange="-5 5" gear="3" armature="0.01" damping="0.1"/>'
    try:
        robot = load_robot(write_biped(tmp_path, extra=section(line)))
    except ConfigError as error:
        pytest.skip(f"this MuJoCo does not know them: {error}")
    np.testing.assert_allclose(robot.model.dof_armature[6:], 0.09)
    np.testing.assert_allclose(robot.model.dof_damping[6:], 0.9)


def test_keyframes_and_sensors_of_actuators_do_not_hinder(tmp_path: Path) -> None:
    """Keyframes with controls and sensors of actuators are dropped with the actuators."""
    line = '<position name="{0}" joint="{0}" kp="5" forcerange="-9 9"/>'
    ctrl = " ".join(["0"] * 16)
    twice = section(line, section('<velocity joint="{}" kv="1" forcerange="-1 1"/>')[10:-11])
    extra = twice + f'<keyframe><key ctrl="{ctrl}"/></keyframe>'
    extra += '<sensor><actuatorfrc actuator="left_hip"/></sensor>'
    robot = load_robot(write_biped(tmp_path, extra=extra))
    assert robot.model.nu == 8 and robot.model.nsensor == 3


TENDON = '<tendon><fixed name="t"><joint joint="left_hip" coef="1"/></fixed></tendon>'
WRONG = {
    "unlimited": ({"extra": section('<position joint="{}"/>')}, ["torque_limits", "left_hip"]),
    "no actuators": ({"extra": ""}, ["torque_limits", "no actuators", "right_ankle_roll"]),
    "unknown joint": ({"torque_limits": {"tail*": 1}}, ["torque_limits", "'tail*'", "left_hip"]),
    "zero limit": ({"torque_limits": {"*": 0}}, ["torque_limits.*", "above 0"]),
    "tendon": (
        {"extra": TENDON + '<actuator><motor name="pull" tendon="t"/></actuator>'},
        ["source", "'pull'", "hinge or slide"],
    ),
}


@pytest.mark.parametrize(("change", "words"), WRONG.values(), ids=WRONG)
def test_wrong_actuators(tmp_path: Path, change: dict, words: list[str]) -> None:
    """What cannot become a motor is named, with the file, the field and the choices."""
    path = write_biped(tmp_path, **change)
    with pytest.raises(ConfigError) as caught:
        load_robot(path)
    for word in [str(path), *words]:
        assert word in str(caught.value)


def test_force_ranges_without_actuators_are_motors(tmp_path: Path) -> None:
    """As a URDF file's effort; a joint without a range stays passive; one actuator, and they are
    only its bounds."""
    leg = LEG.replace("range=", 'actuatorfrcrange="-17 18" range=', 1)
    robot = load_robot(write_biped(tmp_path, leg=leg, extra=""))
    assert [robot.joint_names[dof - 6] for dof in robot.motor_dofs] == ["left_hip", "right_hip"]
    assert robot.torque_limit.tolist() == [17.0, 17.0]
    extra = '<actuator><motor joint="left_hip" ctrlrange="-5 5"/></actuator>'
    robot = load_robot(write_biped(tmp_path, leg=leg, extra=extra))
    assert robot.torque_limit.tolist() == [5.0]


PASSIVE = {"armature": "dof_armature", "damping": "dof_damping", "frictionloss": "dof_frictionloss"}


@pytest.mark.parametrize("field", PASSIVE)
def test_what_a_description_gives_joints_wins(tmp_path: Path, field: str) -> None:
    """By pattern, an exact name first; other joints keep what the model gives them."""
    leg = LEG.replace('axis="0 1 0"', f'axis="0 1 0" {field}="0.5"')
    given = {"left_knee": 0.25, "*_knee": 0.125, "*_roll": 2}
    robot = load_robot(write_biped(tmp_path, leg=leg, **{field: given}))
    values = dict(zip(robot.joint_names, getattr(robot.model, PASSIVE[field])[6:], strict=True))
    assert values["left_knee"] == 0.25 and values["right_knee"] == 0.125
    assert values["left_ankle_roll"] == 2.0 and values["left_hip"] == 0.5
    (tmp_path / "plain").mkdir()
    plain = load_robot(write_biped(tmp_path / "plain", leg=leg))
    assert robot.fingerprint != plain.fingerprint
    for wrong, text in (({"tail": 1}, "no joint is called 'tail'"), ({"*": -1}, "at least 0")):
        with pytest.raises(ConfigError, match=rf"{field}.*{text}"):
            load_robot(write_biped(tmp_path, **{field: wrong}))


@pytest.mark.parametrize(("limit", "mass", "armature"), [(30, 40, 0.009), (300, 40, 0.02)])
def test_a_rotor_is_proposed_by_torque_and_mass(limit: float, mass: float, armature: float) -> None:
    assert proposed_armature(limit, mass) == armature
