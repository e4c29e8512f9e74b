"""The task of moving a sole along a trajectory: the swing foot's."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into, rotation_error

from .task import Rows, Task, TaskInput, TaskTick


@dataclass(frozen=True, eq=False)
class SolePoseGains(Block):
    """Gains of a sole's pose in SI units."""

    stiffness: float  # k [1/s²]
    damping: float  # d [1/s]
    weight: float  # per (m/s²)²
    turn_weight: float  # per (rad/s²)²
    yaw_weight: float  # the same, about the vertical
    error: Annotated[np.ndarray, 3]  # scratch


@dataclass(frozen=True, eq=False)
class SolePoseBlock(Block):
    """A sole's pose task: whoever moves the sole writes `reference` and `axes`."""

    sole: int
    reference: np.ndarray  # (3, 3) position, velocity, acceleration [m, s]
    axes: np.ndarray  # (3, 3) of the sole
    gains: SolePoseGains


@compiled
def fill_sole_pose(t: TaskTick[SolePoseBlock]):
    """The rows of a sole's pose, see `SolePose`."""
    s, rows, gains = t.state, t.rows, t.task.gains
    sole, reference = t.task.sole, t.task.reference
    k, d, turn = gains.stiffness, gains.damping, gains.error
    rotation_error(s.sole_axes[sole], t.task.axes, turn)
    for a in range(3):
        r = 6 * sole + a
        rows.b[a] = (
            reference[2, a] + k * (reference[0, a] - s.sole_point[sole, a])
            + d * (reference[1, a] - s.J_v[r]) - s.Jdot_v[r]
        )  # fmt: skip
        rows.b[3 + a] = k * turn[a] - d * s.J_v[3 + r] - s.Jdot_v[3 + r]
        rows.weights[a], rows.weights[3 + a] = gains.weight, gains.turn_weight
    rows.weights[5] = gains.yaw_weight
    for r in range(6):
        copy_into(s.J[6 * sole + r], rows.A[r])


@dataclass(frozen=True)
class SolePose(Task[SolePoseBlock]):
    """J_sole v̇ + J̇ v = a_ref + k (x_ref ⊖ x) + d (ẋ_ref − ẋ), linear part, then angular.

    The orientation's x_ref ⊖ x is ½ Σ aᵢ × bᵢ of the axes (see `rotation_error`), its reference is
    at rest. It has no `kind`: its reference and gains come from a controller that steps.
    """

    size: ClassVar[int] = 6
    kernel = staticmethod(fill_sole_pose)

    def rows(self, t: TaskInput, block: SolePoseBlock) -> Rows:
        state = t.state
        gains, reference = block.gains, block.reference
        own = slice(6 * block.sole, 6 * block.sole + 6)
        velocity, axes = state.J_v[own], state.sole_axes[block.sole]
        turn = 0.5 * np.cross(axes.T, block.axes.T).sum(axis=0)
        error = np.concatenate([reference[0] - state.sole_points[block.sole], turn])
        desired = np.concatenate([reference[1], np.zeros(3)])
        b = gains.stiffness * error + gains.damping * (desired - velocity) - state.Jdot_v[own]
        b[:3] += reference[2]
        weights = [gains.weight] * 3 + [gains.turn_weight] * 2 + [gains.yaw_weight]
        return Rows(state.J[own], b, np.array(weights))
