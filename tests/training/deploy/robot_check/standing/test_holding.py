"""training/deploy/robot_check/standing/holding.py and touching.py."""

from __future__ import annotations

from pathlib import Path

import pytest

from poise.envs.robots.robot import load_robot
from poise.training.deploy.robot_check.standing.holding import Holding, holding
from poise.training.deploy.robot_check.touching import self_contacts
from tests.support.small_biped import write_biped
from tests.support.small_urdf import write_urdf

ARM = (
    '<body name="arm" pos="0 0.13 0"><joint name="shoulder" axis="1 0 0" limited="false"/>'
    '<inertial pos="0 0.25 0" mass="2" diaginertia="0.01 0.01 0.01"/></body>'
)
STRONG = {"*": 1000.0}


def on_both(path: Path) -> Holding:
    robot = load_robot(path)
    return holding(robot, robot.standing_qpos, [0, 1])


def test_a_level_arm_asks_for_its_moment(tmp_path: Path) -> None:
    """m g l = 2 kg · 9.81 m/s² · 0.25 m, whatever the ground does."""
    path = write_biped(tmp_path, trunk=ARM, extra="", torque_limits={"shoulder": 9.81, **STRONG})
    found = on_both(path)
    assert found.joint == "shoulder" and found.possible
    assert found.torque_fraction == pytest.approx(0.5, abs=1e-5)
    weak = write_biped(tmp_path, trunk=ARM, extra="", torque_limits={"shoulder": 3.0, **STRONG})
    assert on_both(weak).torque_fraction == pytest.approx(4.905 / 3.0, abs=1e-5)
    assert not on_both(weak).possible


def test_a_joint_without_a_motor_bears_its_friction(tmp_path: Path) -> None:
    """4.905 N·m, or no forces hold the robot."""
    legs = {f"{side}_*": 1000.0 for side in ("left", "right")}
    path = write_biped(tmp_path, trunk=ARM, extra="", torque_limits=legs)
    assert on_both(path) == Holding(None, None) and not on_both(path).possible
    rough = ARM.replace("<joint", '<joint frictionloss="5"')
    assert on_both(write_biped(tmp_path, trunk=rough, extra="", torque_limits=legs)).possible


def test_a_com_beside_the_soles_is_not_held(tmp_path: Path) -> None:
    """On one sole, in the posture of both."""
    robot = load_robot(write_biped(tmp_path))
    assert holding(robot, robot.standing_qpos, [0, 1]).possible
    assert holding(robot, robot.standing_qpos, [0]) == Holding(None, None)


def test_friction_helps(tmp_path: Path) -> None:
    """Legs apart: feet that push outwards take load off the hips; on ice they cannot."""
    apart = {"left_hip_roll": 15, "left_ankle_roll": -15}
    apart |= {name.replace("left", "right"): -angle for name, angle in apart.items()}
    posture = {"joints": {"*_hip": -20, "*_knee": 40, "*_ankle": -20, **apart}}
    robot = load_robot(write_urdf(tmp_path, posture=posture))
    ice = load_robot(write_urdf(tmp_path, posture=posture, options={"friction": 0.001}))
    fraction = holding(robot, robot.standing_qpos, [0, 1]).torque_fraction
    on_ice = holding(ice, ice.standing_qpos, [0, 1])
    assert str(on_ice.joint).endswith("_hip_roll") and on_ice.torque_fraction is not None
    assert fraction is not None and fraction < 0.9 * on_ice.torque_fraction


PAD = '<geom name="pad" type="{kind}" {shape} pos="0 0.1 -0.2"/>'
TETRAHEDRON = '<mesh name="wedge" vertex="0 0 .08  .05 0 -.08  -.05 .05 -.08  -.05 -.05 -.08"/>'


@pytest.mark.parametrize(
    ("kind", "shape"), [("box", 'size="0.02 0.02 0.08"'), ("mesh", 'mesh="wedge"')]
)
def test_bodies_inside_each_other(tmp_path: Path, kind: str, shape: str) -> None:
    """A shape of the trunk inside a shin's, which is not its child; the ground does not count."""
    assert self_contacts(load_robot(write_biped(tmp_path))) == ()
    straight = {"joints": {"*_hip": 0, "*_knee": 5, "*_ankle": -5}}
    pad = PAD.format(kind=kind, shape=shape).replace("-0.2", "-0.5")
    path = write_biped(tmp_path, trunk=pad, asset=TETRAHEDRON, posture=straight)
    (found,) = self_contacts(load_robot(path))
    assert set(found.bodies) == {"trunk", "left_shin"}
    assert found.meshes == (kind == "mesh") and 0.01 < found.depth < 0.1
