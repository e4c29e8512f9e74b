"""A controller in a loop of LowState and LowCmd."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose
from poise.training.deploy.standalone.controller import load_standalone
from poise.training.deploy.standalone.readings import Measurement, Readings
from poise.training.deploy.standalone.sensed import MotorCommand

from .ground import LegForces
from .messages import PERIOD, SLOTS, LowCmd, checksum

STIFFNESS, DAMPING = 100.0, 5.0  # [N·m/rad], [N·m·s/rad] of motors that take targets alone
DAMPED = 3.0  # [N·m·s/rad] of motors of a robot that falls
TILT = 60.0  # [deg] of the pelvis: a robot that leans further falls


class LowCmdBridge:
    """Answers every LowState, 500 a second, with a LowCmd.

    The first one is of a robot that stands on both feet. A controller that runs at 250 Hz changes
    its answer at every second one. The wrench of the ground, which no sensor of a G1 measures,
    comes from the torques of its legs. A robot that leans by 60° is damped from then on.

    Args:
        controller: as `load_standalone` takes it.
        robot: whose motors are in the order of the messages.
        realism: the level that says what is known of delays, motors and noise.
        targets: command positions with gains instead of torques.
        allow: as of `load_policy`.

    Attributes:
        make: makes an empty LowCmd: that of `messages`, or `unitree_hg_msg_dds__LowCmd_` of
            Unitree's package.
        falls: whether the robot leant too far, and is damped.

    Raises ConfigError as `load_standalone`; for a robot that is not simulated at 500 Hz, or has
    more than 35 motors.
    """

    def __init__(
        self,
        controller: str = "momentum-qp-g1",
        robot: str | Path | Robot = "unitree_g1",
        *,
        realism: str = "field",
        targets: bool = False,
        allow: str | Iterable[str] = (),
    ):
        self.controller = load_standalone(controller, robot, realism=realism, allow=allow)
        self.robot, period = self.controller.robot, self.controller.sensor_period
        if abs(period - PERIOD) > 1e-9 or len(self.robot.motor_names) > SLOTS:
            raise ConfigError(f"is simulated every {1000 * period:g} ms with "
                              f"{len(self.robot.motor_names)} motors, and messages go every "
                              f"{1000 * PERIOD:g} ms with {SLOTS}", source=self.robot.name,
                              field="robot")  # fmt: skip
        self._targets = targets
        self.make: Callable[[], Any] = LowCmd
        self._motors = np.array(self.robot.motor_dofs) - 6
        self._legs = LegForces(self.robot)
        self._heard: list[Measurement] = []
        self._asked: MotorCommand | None = None
        self.falls = False

    def __call__(self, state: Any) -> Any:
        """The LowCmd that answers a LowState."""
        motors = state.motor_state[: len(self._motors)]
        q, dq, torque = (np.array([getattr(m, name) for m in motors], dtype=float)
                         for name in ("q", "dq", "tau_est"))  # fmt: skip
        imu = state.imu_state
        attitude = np.array(imu.quaternion, dtype=float)
        gyro = np.array(imu.gyroscope, dtype=float)
        upright = 1.0 - 2.0 * (attitude[1] ** 2 + attitude[2] ** 2)
        self.falls |= not upright > np.cos(np.radians(TILT))  # not a number falls, too
        if self.falls:
            return self._message(state, np.zeros((3, len(q))), np.full(len(q), DAMPED))
        if self._asked is None:
            weight = np.array([0.0, 0.0, 9.81 * self.robot.mass, 0.0, 0.0, 0.0])
            down = [True] * len(self.robot.soles)
            first = Measurement(attitude, np.zeros(3), np.array(imu.accelerometer), q,
                                np.zeros(len(q)), weight, down)  # fmt: skip
            self.controller.reset(self._standing(attitude, q), first)
            self._asked = self.controller.command()
        else:
            wrench, touching = self._legs(attitude, gyro, q, dq, torque)
            self._heard.append(
                Measurement(attitude, gyro, np.array(imu.accelerometer), q, dq, wrench, touching)
            )
            if len(self._heard) == self.controller.measurements:
                self._asked = self.controller.command(self._heard)
                self._heard = []
        asked = self._asked
        if self._targets:
            gains = np.full(len(q), STIFFNESS), np.full(len(q), DAMPING)
            asked = asked.targets(q, dq, *gains)
        return self._message(state, np.stack(asked[:3]), asked.damping)

    def serve(self, interface: str, seconds: float = np.inf) -> None:
        """Answer ``rt/lowstate`` on ``rt/lowcmd`` of a network interface, such as ``lo``.

        Raises ConfigError without the package unitree_sdk2py; if no LowState comes for 5 s.
        """
        from .dds import control

        control(self, interface, seconds)

    def _standing(self, attitude: np.ndarray, q: np.ndarray) -> Readings:
        """Where the robot stands at first: as measured, its lowest sole on the ground."""
        data = mujoco.MjData(self.robot.model)
        data.qpos[:] = self.robot.standing_qpos
        data.qpos[3:7], data.qpos[7:] = attitude, q
        mujoco.mj_kinematics(self.robot.model, data)
        data.qpos[2] -= min(float(sole_pose(data, sole)[0][2]) for sole in self.robot.soles)
        return Readings.of_mujoco(data.qpos, np.zeros(self.robot.model.nv))

    def _message(self, state: Any, asked: np.ndarray, damping: np.ndarray) -> Any:
        """A LowCmd of torques, targets and stiffness (3, nu), and damping (nu,)."""
        cmd = self.make()
        cmd.mode_pr, cmd.mode_machine = 0, state.mode_machine
        for slot, tau, q, kp, kd in zip(cmd.motor_cmd, *asked, damping, strict=False):
            slot.mode, slot.tau, slot.q, slot.dq = 1, float(tau), float(q), 0.0
            slot.kp, slot.kd = float(kp), float(kd)
        cmd.crc = checksum(cmd)
        return cmd
