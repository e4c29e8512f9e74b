"""The task of a posture: joints and the root's orientation follow their references."""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import turn_error
from poise.envs.physics.arrays import RobotArrays, robot_arrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .task import Rows, Task, TaskInput, TaskSpace, TaskTick


@dataclass(frozen=True, eq=False)
class PostureBlock(Block):
    """A posture task in SI units, for nv degrees of freedom."""

    weight: np.ndarray  # (nv,) per (rad/s²)²
    far_share: float  # the fraction of these weights with the CoM far from c_ref
    far_distance: float  # [m]
    stiffness: np.ndarray  # (nv,) k_t [1/s²]
    damping: np.ndarray  # (nv,) d_t [1/s]
    error: Annotated[np.ndarray, 3]  # scratch
    BBt: Annotated[np.ndarray, 6, 6]  # scratch
    y: Annotated[np.ndarray, 6]  # scratch


@compiled
def fill_posture(t: TaskTick[PostureBlock]):
    """The rows of a posture, see `Posture`."""
    s, targets, p, desired = t.state, t.targets, t.task, t.rows.b
    fraction = posture_fraction(p, s.com, targets.com)
    for j in range(desired.shape[0]):
        t.rows.weights[j] = fraction * p.weight[j]
    error = p.error
    scale = turn_error(s.root_axes, targets.root_axes, error)
    for a in range(3):
        desired[a] = -p.damping[a] * s.qvel[a]
        desired[3 + a] = (
            targets.root_acc[a]
            + p.stiffness[3 + a] * scale * error[a]
            + p.damping[3 + a] * (targets.root_vel[a] - s.qvel[3 + a])
        )
    for j in range(targets.q_ref.shape[0]):
        desired[6 + j] = (
            targets.a_ref[j]
            + p.stiffness[6 + j] * (targets.q_ref[j] - s.qpos[7 + j])
            + p.damping[6 + j] * (targets.v_ref[j] - s.qvel[6 + j])
        )
    carry_momentum(t)


@compiled
def carry_momentum(t: TaskTick[PostureBlock]):
    """Let the posture carry L_ref: b += d_t V z, with the least z that has B z = [0; L_ref].

    The soles and the CoM stay where they are (A_P V z = 0), so this asks the trunk and arms to
    turn, which is what the posture's own damping holds back.
    """
    L, m, p = t.targets.angular_momentum, t.motion, t.task
    if L[0] == 0.0 and L[1] == 0.0 and L[2] == 0.0:
        return
    G, y = p.BBt, p.y
    trace = 0.0
    for a in range(6):
        for b in range(6):
            total = 0.0
            for i in range(m.first, m.last):
                total += m.B[a, i] * m.B[b, i]
            G[a, b] = total
        trace += G[a, a]
        y[a] = L[a - 3] if a >= 3 else 0.0
    for a in range(6):  # a robot of few joints may not reach every direction
        G[a, a] += 1e-9 * trace
    for k in range(6):  # Gauss: G is symmetric positive definite
        for a in range(k + 1, 6):
            factor = G[a, k] / G[k, k]
            for b in range(k, 6):
                G[a, b] -= factor * G[k, b]
            y[a] -= factor * y[k]
    for a in range(5, -1, -1):
        for b in range(a + 1, 6):
            y[a] -= G[a, b] * y[b]
        y[a] /= G[a, a]
    for i in range(m.first, m.last):
        z = 0.0
        for a in range(6):
            z += m.B[a, i] * y[a]
        for j in range(3, m.V.shape[0]):
            t.rows.b[j] += p.damping[j] * m.V[j, i] * z


@compiled
def posture_fraction(p: PostureBlock, com: np.ndarray, com_ref: np.ndarray) -> float:
    """The fraction β = s + (1 − s) exp(−(|c − c_ref|/d)²), horizontally, that the weights of the
    posture keep."""
    x, y = com[0] - com_ref[0], com[1] - com_ref[1]
    away = (x * x + y * y) / (p.far_distance * p.far_distance)
    return p.far_share + (1.0 - p.far_share) * np.exp(-away)


@dataclass(frozen=True)
class Posture(Task[PostureBlock]):
    """h_t = β ‖v̇ − (a_ref + k_t (q_ref ⊖ q) + d_t (v_ref + v* − v))‖², weights per kind of joint.

    Joints are classified by what they carry: legs move one sole, the trunk moves several, the
    rest (arms, head) none. Damping is d_t = 2 ζ √k_t. All weights fall to a fraction of themselves
    as the CoM leaves c_ref: β = s + (1 − s) exp(−(|c − c_ref|/d)²), horizontally [Abe07]; then
    balance counts more than the posture. The root's q_ref ⊖ q is the rotation vector of RᵀR_ref, in
    body axes like its velocity. Its three linear rows have no weight: the CoM says where the root
    is. v* carries the angular momentum L_ref of the targets.
    """

    space: ClassVar[TaskSpace] = TaskSpace.ACCELERATION
    kernel = staticmethod(fill_posture)

    kind: Literal["posture"] = field(default="posture", metadata={"omit": "default"})
    leg_weight: float = field(default=1.0, metadata={"above": 0.0})  #: per (g/h)²
    trunk_weight: float = field(default=1.0, metadata={"above": 0.0})
    free_weight: float = field(default=1.0, metadata={"above": 0.0})
    root_weight: float = field(default=1.0, metadata={"min": 0.0})  #: orientation of the root
    stiffness: float = field(default=2.5, metadata={"min": 0.0})  #: k_t in ω²
    free_stiffness: float = field(default=2.5, metadata={"min": 0.0})
    root_stiffness: float = field(default=2.5, metadata={"min": 0.0})
    damping_ratio: float = field(default=1.0, metadata={"min": 0.0})  #: ζ
    far_share: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0})  #: s; 1: no fall
    far_distance: float = field(default=0.02, metadata={"above": 0.0})  #: d, in h

    def bind(self, robot: Robot) -> PostureBlock:
        """The task in SI units."""
        omega = robot.units.omega
        kinds = joint_kinds(robot_arrays(robot))
        weight = np.choose(
            np.minimum(kinds, 2), [self.free_weight, self.leg_weight, self.trunk_weight]
        )
        if len(robot.soles) == 1:  # with one sole nothing tells its leg from a trunk
            weight = np.where(kinds > 0, self.leg_weight, self.free_weight)
        gain = np.where(kinds == 0, self.free_stiffness, self.stiffness)
        stiffness = np.concatenate([np.zeros(3), np.full(3, self.root_stiffness), gain])
        weights = np.concatenate([np.zeros(3), np.full(3, self.root_weight), weight])
        return PostureBlock.allocate(
            weight=weights / omega**4, far_share=self.far_share,
            far_distance=self.far_distance * robot.height_com, stiffness=stiffness * omega**2,
            damping=2.0 * self.damping_ratio * np.sqrt(stiffness) * omega,
        )  # fmt: skip

    def rows(self, t: TaskInput, block: PostureBlock) -> Rows:
        state, targets = t.state, t.targets
        turn = Rotation.from_matrix(state.root_axes.T @ targets.root_axes).as_rotvec()
        error = np.concatenate([np.zeros(3), turn, targets.q_ref - state.q])
        v_ref = np.concatenate([np.zeros(3), targets.root_vel, targets.v_ref])
        a_ref = np.concatenate([np.zeros(3), targets.root_acc, targets.a_ref])
        v_ref = v_ref + carrying_velocity(t.support, targets.angular_momentum)
        desired = a_ref + block.stiffness * error + block.damping * (v_ref - state.qvel)
        fraction = posture_fraction(block, state.com, targets.com)
        return Rows(np.eye(len(desired)), desired, fraction * block.weight)


def carrying_velocity(support: RobotState, angular_momentum: np.ndarray) -> np.ndarray:
    """(nv,) least v* that has A_L v* = L_ref and moves neither the soles nor the CoM."""
    rows = np.vstack([support.J, support.A])
    desired = np.concatenate([np.zeros(len(rows) - 3), angular_momentum])
    return np.linalg.lstsq(rows, desired, rcond=None)[0]


def joint_kinds(robot: RobotArrays) -> np.ndarray:
    """(nv−6,) how many soles each joint carries: 0 free (arms), 1 leg, more: trunk."""
    carried = np.zeros(len(robot.q_standing), dtype=int)
    for chain, length in zip(robot.chain, robot.chain_length, strict=True):
        for dof in chain[:length]:
            if dof >= 6:
                carried[dof - 6] += 1
    return carried


def no_posture(nv: int) -> PostureBlock:
    """The gains of a QP without posture: all zero."""
    return PostureBlock.allocate(
        weight=np.zeros(nv), far_share=1.0, far_distance=1.0, stiffness=np.zeros(nv),
        damping=np.zeros(nv),
    )  # fmt: skip
