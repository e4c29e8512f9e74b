"""One policy step of a controller and the physics, compiled."""

from dataclasses import dataclass

import numpy as np

from poise.envs.arrays import Plant, RobotArrays
from poise.envs.block import Block, call
from poise.envs.episode import (
    ROOT_FORCE,
    ROOT_MOMENT,
    EpisodeArrays,
    Judge,
    judge_step,
    record_tick,
)
from poise.envs.jit import compiled
from poise.envs.kinematics import StateArrays, update_state
from poise.envs.observation import Scales
from poise.envs.simulation import advance

from .reduced_qp import TargetArrays
from .targets import Motion, update_targets


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


@dataclass(frozen=True, eq=False)
class ResidualStep(Block):
    """All that a policy step works on."""

    robot: RobotArrays
    plant: Plant
    state: StateArrays
    clock: np.ndarray  # (1,) int
    address: int  # of the controller's tick
    tick: Block  # what it works on
    tau: np.ndarray  # (nj,) what it finds [N·m]
    root_wrench: np.ndarray  # (6,) of a soft root
    soft_root: bool
    targets: TargetArrays
    motion: Motion
    com_offset: float  # [m]
    residual: np.ndarray  # (9,) see `update_targets`
    scales: Scales
    judge: Judge
    ticks: int
    substeps: int  # physics steps of each
    episode: EpisodeArrays


@compiled
def residual_step(step: ResidualStep, pushes: np.ndarray) -> float:
    """One policy step: `ticks` times the controller, each held for `substeps` physics steps."""
    robot, plant, s, clock, motion = step.robot, step.plant, step.state, step.clock, step.motion
    t, e, tau, w = step.targets, step.episode, step.tau, step.root_wrench
    period = step.substeps * robot.timestep
    for _ in range(step.ticks):
        update_targets(
            robot, s, motion, clock[0] * robot.timestep, step.com_offset, step.residual, t
        )
        call(step.address, step.tick)
        for i in range(plant.ctrl.shape[0]):
            plant.ctrl[i] = tau[robot.motor_dofs[i] - 6]
        if step.soft_root:
            soft_root_force(s, w, plant.qfrc_applied)
            m = e.metrics
            m[ROOT_FORCE] = max(m[ROOT_FORCE], np.sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2))
            m[ROOT_MOMENT] = max(m[ROOT_MOMENT], np.sqrt(w[3] ** 2 + w[4] ** 2 + w[5] ** 2))
        record_tick(robot, s, plant.ctrl, period, e)
        for _ in range(step.substeps):
            advance(robot, plant, pushes, clock)
        update_state(robot, plant, s)
    now = clock[0] * robot.timestep
    return judge_step(robot, s, step.scales, step.judge, t.q_ref, plant.ctrl, now, e)
