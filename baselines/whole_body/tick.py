"""The compiled control tick of the momentum QP: assemble, solve, accept or fall back."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.solvers.dual_active_set import solve_dual
from poise.baselines.solvers.scaled_rows import INFEASIBLE
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Kernel, call
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.maths.vectors import copy_into
from poise.envs.physics.kinematics import StateArrays

from .parameters import QPParameters
from .reduced_qp import Assembly, recover
from .workspace import Workspace

MAX_ITERATIONS = 200


@dataclass(frozen=True, eq=False)
class Memory(Block):
    """All that outlives a tick: the torques to fall back on and the count of failures."""

    torques: np.ndarray  # (nj,) of the last solved tick [N·m]
    damping: np.ndarray  # (nj,) joint-space damping to fall back on [N·m·s/rad]
    streak: np.ndarray  # (1,) int: failures since then
    failures: np.ndarray  # (1,) int: failures since the reset


def allocate_memory(torque_limit: np.ndarray) -> Memory:
    """Return an empty memory for joints with `torque_limit` (nj,) [N·m]."""
    return Memory(
        torques=guarded_zeros(len(torque_limit)),
        damping=torque_limit / FALLBACK_SPEED,
        streak=guarded_zeros(1, dtype=np.int64),
        failures=guarded_zeros(1, dtype=np.int64),
    )


def forget(memory: Memory) -> None:
    """Put the memory back to what it was before the first tick."""
    memory.torques[:] = 0.0
    memory.streak[0] = memory.failures[0] = 0


FALLBACK_DECAY = 0.8  # per tick: the fraction that the last good torques keep
FALLBACK_SPEED = 10.0  # joint speed [rad/s] at which damping alone uses the whole torque limit


@compiled
def release_joints(ws: Workspace):
    """Take away the joint limits and what follows, the limits that a configuration adds."""
    ws.l[ws.first_joint :] = -np.inf
    ws.u[ws.first_joint :] = np.inf


@compiled
def solve(ws: Workspace):
    """Solve the assembled problem, starting from the last tick's active rows."""
    for _ in range(2):
        ws.status[0] = solve_dual(
            ws.H, ws.g, ws.C, ws.l, ws.u, ws.x, ws.lam, ws.scratch, ws.iscratch, MAX_ITERATIONS,
            True,
        )  # fmt: skip
        if ws.status[0] != INFEASIBLE:
            return
        release_joints(ws)  # always their fault, and the joints hold their limits by themselves


@compiled
def accept(s: StateArrays, p: QPParameters, ws: Workspace, memory: Memory):
    """Take torques from a solved QP; otherwise blend the last good ones into damping."""
    if ws.status[0] == 0:
        recover(p, ws)
        if np.all(np.isfinite(ws.tau)):
            copy_into(ws.tau, memory.torques)
            memory.streak[0] = 0
            return
    memory.streak[0] += 1
    memory.failures[0] += 1
    keep = FALLBACK_DECAY ** memory.streak[0]
    ws.root_wrench[:] = 0.0
    for a in range(ws.tau.shape[0]):
        speed = s.qvel[6 + a] if np.isfinite(s.qvel[6 + a]) else 0.0
        torque = keep * memory.torques[a] - (1.0 - keep) * memory.damping[a] * speed
        ws.tau[a] = min(max(torque, -p.torque_limit[a]), p.torque_limit[a])


@dataclass(frozen=True, eq=False)
class Tick(Block):
    """All that a control tick works on; the kernels of its stages are called by their addresses."""

    problem: Assembly
    memory: Memory
    assemble: Kernel[Assembly]  # `assemble`, of `problem`
    solve: Kernel[Workspace]  # `solve`, of the problem's workspace


@compiled
def momentum_tick(t: Tick):
    """Run one control tick: `tau` (nj,) of the workspace then holds torques."""
    a = t.problem
    call(t.assemble, a)
    call(t.solve, a.workspace)
    accept(a.state, a.parameters, a.workspace, t.memory)
