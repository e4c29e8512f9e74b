"""A controller on Unitree's messages: their checksum, the wrench from the legs, and standing."""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.training.deploy.lowcmd.bridge import LowCmdBridge
from poise.training.deploy.lowcmd.dds import INSTALL
from poise.training.deploy.lowcmd.ground import LegForces
from poise.training.deploy.lowcmd.messages import LowCmd, checksum, mpeg2
from poise.training.deploy.lowcmd.simulated import LowCmdRobot
from tests.support.physics import robot_named
from tests.support.small_urdf import write_urdf


def test_the_checksum_is_crc_32_mpeg_2() -> None:
    """Its check value; and of a message that of Unitree's own library (crc_amd64.so)."""
    assert mpeg2(b"123456789") == 0x0376E6E7
    cmd = LowCmd(mode_machine=5)
    for i, motor in enumerate(cmd.motor_cmd[:29]):
        motor.mode, motor.q, motor.kp, motor.kd, motor.tau = 1, 0.1 * i, 60.0, 1.0, float(-i)
    assert checksum(cmd) == 2620383363
    cmd.motor_cmd[28].q += 1e-3
    assert checksum(cmd) != 2620383363


def test_the_wrench_of_the_ground_comes_from_the_legs() -> None:
    """Standing, that of the simulator's own contacts to 1 %."""
    robot = robot_named("unitree_g1")
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[:] = robot.standing_qpos
    motors = np.array(robot.motor_dofs)
    for _ in range(400):
        gap = robot.standing_qpos[7:][motors - 6] - data.qpos[1 + motors]
        data.ctrl[:] = 300.0 * gap - 5.0 * data.qvel[motors]
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    wrench, touching = LegForces(robot)(data.qpos[3:7], data.qvel[3:6], data.qpos[7:],
                                        data.qvel[6:], data.actuator_force)  # fmt: skip
    weight = robot.mass * 9.81
    axes = data.xmat[robot.root_body_id].reshape(3, 3)
    assert touching == [True, True]
    assert axes @ wrench[:3] == pytest.approx(data.qfrc_constraint[:3], abs=0.01 * weight)
    assert wrench[3:] == pytest.approx(data.qfrc_constraint[3:6], abs=0.01 * weight)


@pytest.mark.parametrize(
    ("controller", "impulse"),
    [("momentum-qp-g1", 10.0), pytest.param("walk-off-g1-field", 15.0, marks=pytest.mark.weekly)],
)
def test_a_g1_stands_without_a_band_and_recovers_from_a_push(
    controller: str, impulse: float
) -> None:
    """10 s with delays, motors and noise of `field`; the push is at 2 s."""
    bridge = LowCmdBridge(controller)
    robot = LowCmdRobot(bridge.robot)
    robot.push("torso_link", (10.0 * impulse, 0.0, 0.0), start=2.0, end=2.1)
    state, fastest = robot.state(), 0.0
    while robot.data.time < 10.0:
        cmd = bridge(state)
        state = robot.step(cmd)
        fastest = max(fastest, float(robot.data.qvel[0]))
    assert robot.stands and not bridge.falls
    assert cmd.crc == checksum(cmd) and cmd.motor_cmd[0].mode == 1
    assert fastest > 0.1  # it was pushed
    assert np.linalg.norm(robot.data.qvel[:3]) < 0.2


def test_positions_with_gains_stand_too() -> None:
    """For motors that take no torques: 3 s in `lab`."""
    bridge = LowCmdBridge(realism="lab", targets=True)
    robot = LowCmdRobot(bridge.robot, realism="lab")
    state = robot.state()
    while robot.data.time < 3.0:
        cmd = bridge(state)
        state = robot.step(cmd)
    assert robot.stands and not bridge.falls
    assert all(m.tau == 0.0 and m.kp > 0.0 for m in cmd.motor_cmd[:29])


def test_a_robot_that_leans_is_damped() -> None:
    """No torques and no targets: motors brake the fall."""
    bridge = LowCmdBridge("momentum-qp-g1", realism="lab")
    robot = LowCmdRobot(bridge.robot, realism="lab")
    robot.data.qpos[3:7] = [np.cos(0.6), 0.0, np.sin(0.6), 0.0]
    state = robot.step(LowCmd())
    for _ in range(5):  # until the state that is known is that one
        state = robot.step(LowCmd())
    cmd = bridge(state)
    assert bridge.falls
    assert all(m.kp == 0.0 and m.tau == 0.0 and m.kd > 0.0 for m in cmd.motor_cmd[:29])
    assert cmd.motor_cmd[29].mode == 0


def test_the_network_needs_unitree_s_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "unitree_sdk2py", None)
    robot = LowCmdRobot("unitree_g1")
    with pytest.raises(ConfigError, match="needs Unitree's package") as error:
        robot.serve("lo", 0.0)
    assert INSTALL in str(error.value)


def test_a_robot_that_is_not_simulated_at_500_hz_is_refused(tmp_path: Path) -> None:
    slow = write_urdf(tmp_path, armature={"*": 0.01}, options={"timestep": 0.004})
    with pytest.raises(ConfigError, match="simulated every 4 ms with 10 motors.*every 2 ms"):
        LowCmdBridge("momentum-qp", slow, realism="lab")
