"""Joint PD to the reference, with feed-forward of what holds the body still [Notes, lecture 9]."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from poise.baselines.controller import BaseController, Targets
from poise.baselines.whole_body.tasks.posture import joint_kinds
from poise.envs.physics.arrays import RobotArrays, robot_arrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .wrenches import joint_torques, sole_wrenches


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
    units = robot.units
    stiffness = units.moment * np.choose(kinds, [gains.free, gains.leg, gains.trunk])
    return stiffness, gains.damping * stiffness / units.omega


def joint_holding_torques(state: RobotState) -> np.ndarray:
    """(nv−6,) torques of v̇ = 0: gravity and bias, carried by the soles with the least effort."""
    return joint_torques(state, sole_wrenches(state, state.A_bias))


class PD(BaseController):
    """τ = τ_hold + K (q_ref − q) + D (v_ref − v), clipped to the motors' limits."""

    def __init__(self, robot: Robot, config: PDConfig | None = None):
        self.robot = robot
        self.config = config or PDConfig()
        self.period = self.config.period
        self.arrays = robot_arrays(robot)
        self.stiffness, self.damping = joint_gains(self.arrays, self.config.gains)

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        tau = self.stiffness * (targets.q_ref - state.q)
        tau += self.damping * (targets.v_ref - state.qvel[6:])
        if self.config.feedforward:
            tau += joint_holding_torques(state)
        return motor_torques(self.arrays, tau)


def motor_torques(robot: RobotArrays, tau: np.ndarray) -> np.ndarray:
    """(nu,) of joint torques (nv−6,), within the limits."""
    return np.clip(tau[robot.motor_dofs - 6], -robot.torque_limit, robot.torque_limit)


#: Compliance of the soles in the predicted step, against soles whose rows depend on each other.
SOLE_COMPLIANCE = 1e-9


@dataclass(frozen=True)
class StablePDConfig(PDConfig):
    """`stable-pd`: the gains of `pd`, implicit."""

    kind: Literal["stable-pd"] = "stable-pd"  # type: ignore[assignment]


class StablePD(PD):
    """τ = τ_hold + K (q_ref − q − Δt v) + D (v_ref − v − Δt v̇), soles at rest.

    v̇ solves, with K and D on the joints only,

        (M + Δt D) v̇ − Jᵀ w = −h + Sᵀ (τ_hold + K (q_ref − q − Δt v) + D (v_ref − v))
        J v̇ = −J̇ v − J v / Δt

    so that gains at which explicit PD diverges stay stable, whatever the period Δt.
    """

    def __init__(self, robot: Robot, config: StablePDConfig | None = None):
        super().__init__(robot, config or StablePDConfig())

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        v = state.qvel[6:]
        tau = self.stiffness * (targets.q_ref - state.q - self.period * v)
        tau += self.damping * (targets.v_ref - v)
        if self.config.feedforward:
            tau += joint_holding_torques(state)
        tau -= self.damping * self.period * self.acceleration(state, tau)[6:]
        return motor_torques(self.arrays, tau)

    def acceleration(self, state: RobotState, tau: np.ndarray) -> np.ndarray:
        """(nv,) v̇ of the next tick under joint torques `tau` (nv−6,) minus Δt D v̇."""
        nv, k = len(state.qvel), len(state.J)
        KKT, rhs = np.zeros((nv + k, nv + k)), np.zeros(nv + k)
        KKT[:nv, :nv] = state.M
        KKT[range(6, nv), range(6, nv)] += self.period * self.damping
        KKT[:nv, nv:], KKT[nv:, :nv] = -state.J.T, state.J
        KKT[range(nv, nv + k), range(nv, nv + k)] = SOLE_COMPLIANCE
        rhs[:nv] = -state.h
        rhs[6:nv] += tau
        rhs[nv:] = -state.Jdot_v - state.J_v / self.period
        return np.linalg.solve(KKT, rhs)[:nv]
