"""The task of the QP that a reference model has: accelerations of a stance leg's knee and hip."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from poise.baselines.whole_body.tasks.task import BoundTask, Rows, Task, TaskTick
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.state import RobotState

from .reference import Reference


@dataclass(frozen=True, eq=False)
class LegRowsBlock(Block):
    """A leg, and the reference whose answers its rows are."""

    leg: int
    reference: Reference


@compiled
def fill_leg_rows(t: TaskTick[LegRowsBlock]) -> None:
    """The rows of a leg, see `LegRows`."""
    leg, r, rows = t.task.leg, t.task.reference, t.rows
    rows.A[0, r.legs.knee_dof[leg]] = r.legs.knee_sign[leg]
    rows.A[1, r.legs.hip_dof[leg]] = r.legs.hip_sign[leg]
    rows.b[0], rows.weights[0] = r.knee[leg, 0], r.knee[leg, 1]
    rows.b[1], rows.weights[1] = r.hip[leg, 0], r.hip[leg, 1]


@dataclass(frozen=True)
class LegRows(Task[LegRowsBlock]):
    """± q̈_knee = β̈ and ± q̈_hip = φ̈ of a stance leg [Zhao, OBJ2].

    It has no `kind`: its accelerations and weights come from a reference model.
    """

    size: ClassVar[int] = 2
    kernel = staticmethod(fill_leg_rows)

    def rows(self, state: RobotState, block: LegRowsBlock) -> Rows:
        """The rows in v̇, in NumPy."""
        r, leg = block.reference, block.leg
        A = np.zeros((2, len(state.qvel)))
        A[0, r.legs.knee_dof[leg]] = r.legs.knee_sign[leg]
        A[1, r.legs.hip_dof[leg]] = r.legs.hip_sign[leg]
        asked = np.array([r.knee[leg], r.hip[leg]])
        return Rows(A, asked[:, 0], asked[:, 1])


def leg_task(leg: int, reference: Reference) -> BoundTask:
    """The task of the QP for one leg."""
    return BoundTask(LegRows(), LegRowsBlock(leg, reference))
