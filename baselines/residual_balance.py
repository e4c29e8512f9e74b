"""`poise/ResidualBalance-v0`: the action moves the targets of a momentum QP."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from poise.envs.arrays import Plant, RobotArrays
from poise.envs.balance import BalanceEnv, EnvConfig
from poise.envs.episode import ROOT_FORCE, ROOT_MOMENT, EpisodeArrays, Judge, judge_step, record_tick
from poise.envs.jit import compiled
from poise.envs.kinematics import StateArrays, update_state
from poise.envs.observation import Scales
from poise.envs.robot import Robot
from poise.envs.simulation import advance

from .controller import Targets
from .momentum_qp import Memory, MomentumQP, momentum_tick
from .motions import ReferenceMotion, load_motion
from .reduced_qp import QPParameters, TargetArrays, Workspace
from .registry import load_controller
from .targets import update_targets


@dataclass(frozen=True)
class ResidualScales:
    """What an action of 1 adds to the targets, heading frame."""

    com: float = field(default=0.2, metadata={"min": 0.0})  # Δc_ref [m]
    cop: float = field(default=0.15, metadata={"min": 0.0})  # Δp_ref [m]


class Motion(NamedTuple):
    """A reference motion as compiled code reads it."""

    knots: np.ndarray
    coeffs: np.ndarray
    loop: bool
    samples: np.ndarray  # scratch


ACTION_NAMES = ("com_x", "com_y", "cop_x", "cop_y")


@compiled
def soft_root_force(s: StateArrays, wrench: np.ndarray, qfrc_applied: np.ndarray):
    """Apply a wrench about the CoM (world axes) on the root's six generalised forces."""
    rx = s.com[0] - s.qpos[0]
    ry = s.com[1] - s.qpos[1]
    rz = s.com[2] - s.qpos[2]
    nx = wrench[3] + ry * wrench[2] - rz * wrench[1]
    ny = wrench[4] + rz * wrench[0] - rx * wrench[2]
    nz = wrench[5] + rx * wrench[1] - ry * wrench[0]
    for a in range(3):
        qfrc_applied[a] = wrench[a]
        qfrc_applied[3 + a] = (
            s.root_axes[0, a] * nx + s.root_axes[1, a] * ny + s.root_axes[2, a] * nz
        )


@compiled
def residual_step(
    robot: RobotArrays,
    plant: Plant,
    s: StateArrays,
    pushes: np.ndarray,
    clock: np.ndarray,
    p: QPParameters,
    t: TargetArrays,
    ws: Workspace,
    memory: Memory,
    motion: Motion,
    com_offset: float,
    residual: np.ndarray,
    scale: Scales,
    j: Judge,
    ticks: int,
    substeps: int,
    e: EpisodeArrays,
) -> float:
    """One policy step: `ticks` times the QP, each held for `substeps` physics steps."""
    period = substeps * robot.timestep
    for _ in range(ticks):
        update_targets(
            robot, s, motion.knots, motion.coeffs, motion.loop, clock[0] * robot.timestep,
            com_offset, residual, motion.samples, t,
        )  # fmt: skip
        momentum_tick(robot, s, p, t, period, ws, memory)
        for i in range(plant.ctrl.shape[0]):
            plant.ctrl[i] = ws.tau[robot.motor_dofs[i] - 6]
        if p.soft_root:
            soft_root_force(s, ws.root_wrench, plant.qfrc_applied)
            w, m = ws.root_wrench, e.metrics
            m[ROOT_FORCE] = max(m[ROOT_FORCE], np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2))
            m[ROOT_MOMENT] = max(m[ROOT_MOMENT], np.sqrt(w[3] ** 2 + w[4] ** 2 + w[5] ** 2))
        record_tick(robot, s, plant.ctrl, period, e)
        for _ in range(substeps):
            advance(robot, plant, pushes, clock)
        update_state(robot, plant, s)
    return judge_step(robot, s, scale, j, t.q_ref, plant.ctrl, clock[0] * robot.timestep, e)


class ResidualBalanceEnv(BalanceEnv):
    """Keep a pushed robot on its feet by moving the targets of the momentum QP.

    Action: Box(−1, 1, (4,)): Δc_ref (x, y) and Δp_ref (x, y) over `residual.com` and
    `residual.cop` [m], heading frame, held for one policy step while the QP runs at its own
    period. Zero is the controller alone, bit for bit.
    """

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | dict | None = None,
        *,
        controller: Any = "momentum-qp",
        motion: str | Path | ReferenceMotion = "standing",
        residual: ResidualScales | None = None,
        **overrides: Any,
    ):
        super().__init__(robot, config, **overrides)
        self.residual = residual or ResidualScales()
        self.controller: MomentumQP = load_controller(controller, self.robot)
        self.motion = (
            motion if isinstance(motion, ReferenceMotion) else load_motion(motion, self.robot)
        )
        self.control_substeps = self._whole(
            self.controller.period, self.arrays.timestep, "controller period"
        )
        self.ticks = self._whole(
            self.config.policy_period, self.controller.period, "policy_period"
        )
        self.targets = Targets.standing(self.robot, self.simulation.state)
        self._targets = self.targets.arrays()
        columns = self.motion.coeffs.shape[2]
        self._motion = Motion(
            self.motion.knots, self.motion.coeffs, self.motion.loop, np.zeros((3, columns))
        )
        scale = self.residual
        self._scale = np.array([scale.com, scale.com, scale.cop, scale.cop])

    def _action_names(self) -> tuple[str, ...]:
        return ACTION_NAMES

    def _references(self) -> tuple[np.ndarray, np.ndarray]:
        return self.targets.q_ref, self.targets.v_ref

    def _begin(self) -> None:
        self.controller.reset(self.simulation.state)
        update_targets(
            self.arrays, self.simulation.state_arrays, *self._motion[:3], 0.0,
            self.controller.com_offset, np.zeros(4), self._motion.samples, self._targets,
        )  # fmt: skip

    def _advance(self) -> float:
        sim, controller = self.simulation, self.controller
        return residual_step(
            self.arrays, sim.plant, sim.state_arrays, sim.push_table, sim.clock,
            controller.parameters, self._targets, controller.workspace, controller.memory,
            self._motion, controller.com_offset, self._scale * self.episode.action,
            self.scales, self.judge, self.ticks, self.control_substeps, self.episode,
        )  # fmt: skip

    def _failures(self) -> int:
        return self.controller.failures

    def _root_wrench(self) -> np.ndarray:
        return self.controller.root_wrench
