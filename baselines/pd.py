"""Joint PD to the reference, with feed-forward of what holds the body still [Notes, lecture 9]."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.envs.arrays import RobotArrays, robot_arrays
from poise.envs.copies import Copyable
from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .controller import Targets
from .parameters import joint_kinds
from .support import joint_torques, sole_wrenches


@dataclass(frozen=True)
class PDGains:
    """Unit-free: stiffness in m g h per radian, damping in 1/ω of the stiffness.

    An ankle stiffness of both legs together below 1 cannot hold the inverted pendulum; a joint
    that carries one sole is a leg's, one that carries none is free (arms), others are the trunk's.
    """

    leg: float = field(default=1.2, metadata={"min": 0.0})
    trunk: float = field(default=1.0, metadata={"min": 0.0})
    free: float = field(default=0.03, metadata={"min": 0.0})
    damping: float = field(default=0.12, metadata={"min": 0.0})


@dataclass(frozen=True)
class PDConfig:
    """`pd`: explicit gains."""

    kind: Literal["pd"] = "pd"
    period: float = field(default=0.004, metadata={"above": 0.0, "max": 0.05})  # [s]
    gains: PDGains = field(default_factory=PDGains)
    feedforward: bool = True


def joint_gains(robot: RobotArrays, gains: PDGains) -> tuple[np.ndarray, np.ndarray]:
    """(nv−6,) stiffness [N·m/rad] and damping [N·m·s/rad]."""
    kinds = np.minimum(joint_kinds(robot), 2)
    moment = robot.mass * robot.gravity * robot.height_com
    stiffness = moment * np.choose(kinds, [gains.free, gains.leg, gains.trunk])
    return stiffness, gains.damping * stiffness / np.sqrt(robot.gravity / robot.height_com)


def holding_torques(state: RobotState) -> np.ndarray:
    """(nv−6,) torques of v̇ = 0: gravity and bias, carried by the soles with the least effort."""
    return joint_torques(state, sole_wrenches(state, state.A_bias))


class PD(Copyable):
    """τ = τ_hold + K (q_ref − q) + D (v_ref − v), clipped to the motors' limits."""

    def __init__(self, robot: Robot, config: PDConfig | None = None):
        self.robot = robot
        self.config = config or PDConfig()
        self.period = self.config.period
        self.arrays = robot_arrays(robot)
        self.stiffness, self.damping = joint_gains(self.arrays, self.config.gains)

    def reset(self, state: RobotState | None = None) -> None:
        """Nothing is remembered."""

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        tau = self.stiffness * (targets.q_ref - state.q)
        tau += self.damping * (targets.v_ref - state.qvel[6:])
        if self.config.feedforward:
            tau += holding_torques(state)
        return motor_torques(self.arrays, tau)


def motor_torques(robot: RobotArrays, tau: np.ndarray) -> np.ndarray:
    """(nu,) of joint torques (nv−6,), within the limits."""
    return np.clip(tau[robot.motor_dofs - 6], -robot.torque_limit, robot.torque_limit)
