"""The compiled control ticks of the momentum QP: assemble, solve, accept or fall back.

One is of all soles, the other of a subset that may change from tick to tick (`contact_sets.py`).
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.solvers.dual_active_set import solve_dual
from poise.baselines.solvers.scaled_rows import INFEASIBLE
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Kernel, call_named
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.kinematics import StateArrays

from .compensation import Compensation, compensate
from .parameters import QPParameters
from .reduced_qp import Assembly, assemble, recover
from .tasks.posture import PostureBlock
from .workspace import Workspace

MAX_ITERATIONS = 200


@dataclass(eq=False)
class Memory(Block):
    """All that outlives a tick: the torques to fall back on and the count of failures."""

    torques: Annotated[np.ndarray, "nj"]  # of the last solved tick [N·m]
    damping: np.ndarray  # (nj,) joint-space damping to fall back on [N·m·s/rad]
    streak: Mutable[int]  # failures since then
    failures: Mutable[int]  # failures since the reset


def allocate_memory(torque_limit: np.ndarray) -> Memory:
    """Return an empty memory for joints with `torque_limit` (nj,) [N·m]."""
    return Memory.allocate({"nj": len(torque_limit)}, damping=torque_limit / FALLBACK_SPEED)


def forget(memory: Memory) -> None:
    """Put the memory back to what it was before the first tick."""
    memory.torques[:] = 0.0
    memory.streak = memory.failures = 0


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
        ws.status = solve_dual(
            ws.H, ws.g, ws.C, ws.l, ws.u, ws.x, ws.lam, ws.scratch, ws.iscratch, MAX_ITERATIONS,
            True,
        )  # fmt: skip
        if ws.status != INFEASIBLE:
            return
        release_joints(ws)  # always their fault, and the joints hold their limits by themselves


@compiled
def accept(s: StateArrays, p: QPParameters, ws: Workspace, memory: Memory):
    """Take torques from a solved QP; otherwise blend the last good ones into damping."""
    if ws.status == 0:
        recover(p, ws)
        if np.all(np.isfinite(ws.tau)):
            copy_into(ws.tau, memory.torques)
            memory.streak = 0
            return
    memory.streak += 1
    memory.failures += 1
    keep = FALLBACK_DECAY**memory.streak
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
    compensation: Compensation  # of the problem's targets, where it is active
    assemble: Kernel[Assembly]  # `assemble`, of `problem`
    solve: Kernel[Workspace]  # `solve`, of the problem's workspace


@compiled
def momentum_tick(t: Tick):
    """Run one control tick: `tau` (nj,) of the workspace then holds torques."""
    a = t.problem
    if t.compensation.active:
        compensate(t.compensation)
    call_named(assemble, t.assemble, a)
    call_named(solve, t.solve, a.workspace)
    accept(a.state, a.parameters, a.workspace, t.memory)


@dataclass(eq=False)
class ContactTick(Block):
    """All that a tick of one subset works on."""

    problem: Assembly  # of a state whose arrays of soles are views: these soles only
    memory: Memory
    posture: PostureBlock  # gains of the task `posture`; zero without one
    load_limits: Annotated[np.ndarray, "nc"]  # [N]
    limited: Mutable[int]  # 1 where these limits count
    applied: np.ndarray  # (nv−6,) torques of the last tick [N·m]
    slew: np.ndarray  # (nv−6,) the most that they may change [N·m]
    follows: Mutable[int]  # 1 where there was a last tick
    chosen: Mutable[int]  # the subset of the last tick, −1: none
    index: int  # number of this subset
    assemble: Kernel[Assembly]  # `assemble`, of `problem`
    solve: Kernel[Workspace]  # `solve`, of the problem's workspace


@compiled
def update_origin(s: StateArrays):
    """Set the origin of a state with some of the soles to the mean of these."""
    nc = s.sole_point.shape[0]
    s.origin[:] = 0.0
    for i in range(nc):
        for a in range(3):
            s.origin[a] += s.sole_point[i, a]
    for a in range(3):
        s.origin[a] /= nc


@compiled
def choose_set(t: ContactTick):
    """Forget what this subset remembers of earlier ticks, if the last one was another's."""
    if t.chosen != t.index:
        ws, t.chosen = t.problem.workspace, t.index
        ws.cop_prev[0] = ws.cop_prev[1] = np.nan
        for i in range(ws.iscratch.shape[0]):
            ws.iscratch[i] = 0


@compiled
def assemble_contacts(t: ContactTick):
    """The reduced QP of a subset."""
    ws, cone = t.problem.workspace, t.problem.parameters.cone
    choose_set(t)
    update_origin(t.problem.state)
    call_named(assemble, t.assemble, t.problem)
    if t.limited:
        for i in range(cone.shape[0]):
            row = (i + 1) * cone.shape[1] - 1
            copy_into(ws.E[6 * i + 2], ws.C[row])
            ws.u[row] = t.load_limits[i] - ws.w0[6 * i + 2]
    if t.follows:
        bound_torques(t, True)


@compiled
def bound_torques(t: ContactTick, rate_limited: bool):
    """Keep τ = τ₀ + T x within its limits, and within `slew` of the last tick's or not."""
    ws, limit = t.problem.workspace, t.problem.parameters.torque_limit
    first = ws.first_torque
    for a in range(limit.shape[0]):
        low, high = -limit[a], limit[a]
        if rate_limited:
            low, high = max(low, t.applied[a] - t.slew[a]), min(high, t.applied[a] + t.slew[a])
        ws.l[first + a], ws.u[first + a] = low - ws.tau0[a], high - ws.tau0[a]


@compiled
def solve_subset(t: ContactTick):
    """Torques from the assembled problem, none of which changes by more than `slew`."""
    ws = t.problem.workspace
    call_named(solve, t.solve, ws)
    if ws.status != 0 and t.follows:
        bound_torques(t, False)
        call_named(solve, t.solve, ws)
    accept(t.problem.state, t.problem.parameters, ws, t.memory)
    for a in range(ws.tau.shape[0]):
        if t.follows:
            ws.tau[a] = min(max(ws.tau[a], t.applied[a] - t.slew[a]), t.applied[a] + t.slew[a])
        t.applied[a] = ws.tau[a]
    t.follows = 1


@compiled
def contact_tick(t: ContactTick):
    """Run one tick with a subset: its workspace's `tau` (nv−6,) then holds torques."""
    assemble_contacts(t)
    solve_subset(t)


@compiled
def go_on_from(t: ContactTick, torques: np.ndarray) -> None:
    """Let the next tick change these `torques` (nv−6,) of the last one no more than it may."""
    copy_into(torques, t.applied)
    copy_into(torques, t.memory.torques)
    t.follows = 1
