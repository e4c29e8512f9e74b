"""A robot in plain MuJoCo that takes LowCmd and publishes LowState, late and with noise."""

from collections import deque
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot, load_robot
from poise.envs.sensing.realism import load_realism
from poise.training.deploy.standalone.sensed import typical

from .messages import LowState


class LowCmdRobot:
    """Stands where its model stands; no band holds it.

    Motors do τ = tau + kp (q − q_m) + kd (dq − q̇_m) on their own encoders in each physics step,
    within their limits, after a lag.

    Args:
        robot: whose motors are in the order of the messages.
        realism: the level whose delays, motor lag and sensor noise it has; of a range the middle.
        seed: of the noise.

    Raises ConfigError as `load_robot` and `load_realism`.

    Attributes:
        model, data: MuJoCo's.
        robot: the description.
    """

    def __init__(
        self, robot: str | Path | Robot = "unitree_g1", *, realism: str = "field", seed: int = 0
    ):
        self.robot = robot if isinstance(robot, Robot) else load_robot(robot)
        self.model, self.data = self.robot.model, mujoco.MjData(self.robot.model)
        level, step = typical(load_realism(realism)), self.model.opt.timestep
        self._noise, self._rng = level.sensors, np.random.default_rng(seed)
        self._share = step / (step + float(np.mean(level.motors.lag)))
        late = [round(float(np.mean(each)) / step) for each in (level.latency.command,
                                                                level.latency.sense)]  # fmt: skip
        self.data.qpos[:] = self.robot.standing_qpos
        mujoco.mj_forward(self.model, self.data)
        self._torque = np.zeros(self.model.nu)
        self._motors = np.array(self.robot.motor_dofs)
        self._force = -self.model.opt.gravity.copy()
        self._commands: deque[Any] = deque(maxlen=late[0] + 1)
        self._states: deque[LowState] = deque([self._measure()], maxlen=late[1] + 1)
        self._push = (0, np.zeros(3), 0.0, 0.0)

    def push(self, body: str, force: tuple[float, float, float], start: float, end: float) -> None:
        """Push a body with a force [N], world axes, from `start` to `end` [s]."""
        self._push = (self.model.body(body).id, np.array(force), start, end)

    def step(self, cmd: Any) -> LowState:
        """Take a LowCmd, simulate for 2 ms, and return the LowState that is known then."""
        data, model = self.data, self.model
        self._commands.append(np.array([(m.tau, m.q, m.dq, m.kp, m.kd) for m in
                                        cmd.motor_cmd[: model.nu]]).T)  # fmt: skip
        tau, q, dq, kp, kd = self._commands[0]
        wanted = tau + kp * (q - data.qpos[1 + self._motors]) + kd * (dq - data.qvel[self._motors])
        limit = self.robot.torque_limit
        self._torque += self._share * (np.clip(wanted, -limit, limit) - self._torque)
        data.ctrl[:] = self._torque
        body, force, start, end = self._push
        data.xfrc_applied[body, :3] = force if start <= data.time < end else 0.0
        before = data.qvel[:3].copy()
        mujoco.mj_step(model, data)
        axes = data.xmat[self.robot.root_body_id].reshape(3, 3)
        self._force = axes.T @ ((data.qvel[:3] - before) / model.opt.timestep - model.opt.gravity)
        self._states.append(self._measure())
        return self._states[0]

    def state(self) -> LowState:
        """The LowState that is known now."""
        return self._states[0]

    def serve(self, interface: str, seconds: float = np.inf) -> None:
        """Publish ``rt/lowstate`` every 2 ms and take ``rt/lowcmd`` with the right checksum.

        Until the first LowCmd the robot waits as it stands. Raises ConfigError without the package
        unitree_sdk2py.
        """
        from .dds import simulate_over_dds

        simulate_over_dds(self, interface, seconds)

    @property
    def stands(self) -> bool:
        """Whether the CoM is above 0.8 of its height in the standing posture."""
        lowest = min(float(self.data.xpos[sole.body_id, 2]) for sole in self.robot.soles)
        com = float(self.data.subtree_com[self.robot.root_body_id, 2])
        return com - lowest > 0.8 * self.robot.height_com - 0.05

    def _measure(self) -> LowState:
        data, noise, rng = self.data, self._noise, self._rng
        state = LowState(tick=round(1000.0 * data.time))
        imu, n = state.imu_state, len(self._motors)
        imu.quaternion = data.qpos[3:7].tolist()
        imu.gyroscope = (data.qvel[3:6] + noise.gyro_noise * rng.standard_normal(3)).tolist()
        imu.accelerometer = (self._force + noise.accelerometer_noise
                             * rng.standard_normal(3)).tolist()  # fmt: skip
        q = data.qpos[1 + self._motors] + noise.encoder_noise * rng.standard_normal(n)
        dq = data.qvel[self._motors] + noise.velocity_noise * rng.standard_normal(n)
        for motor, *values in zip(state.motor_state, q, dq, self._torque, strict=False):
            motor.q, motor.dq, motor.tau_est = map(float, values)
        return state
