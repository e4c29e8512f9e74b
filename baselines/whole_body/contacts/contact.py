"""Contacts of the momentum QP: points in contact, and the Jacobian of these and the soles."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, NamedTuple

import numpy as np

from poise.baselines.whole_body.parts.part import B, Bound, Part
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState


class ContactRows(NamedTuple):
    """A point in contact: J v̇ = accel, cone · f ≤ bound, and ½ Σ weights (f − f_des)²."""

    position: np.ndarray  # (3,) world [m]
    J: np.ndarray  # (3, nv) of its velocity, world axes
    accel: np.ndarray  # (3,) that it is to have, less J̇ v [m/s²]
    cone: np.ndarray  # (rows, 3)
    bound: np.ndarray  # (rows,) [N]
    weights: np.ndarray  # (3,) per N²
    force: np.ndarray  # (3,) f_des on the robot, world axes [N]


@dataclass(frozen=True, eq=False)
class ContactRowArrays(Block):
    """The arrays that a contact writes its `ContactRows` to."""

    position: np.ndarray
    J: np.ndarray
    accel: np.ndarray
    cone: np.ndarray
    bound: np.ndarray
    weights: np.ndarray
    force: np.ndarray


@dataclass(frozen=True, eq=False)
class PointTick(Block, Generic[B]):
    """All that a contact's kernel works on."""

    state: StateArrays
    contact: B  # the contact's own block, made by `bind`
    rows: ContactRowArrays


@dataclass(frozen=True)
class Contact(Part[B]):
    """Base of contacts other than those of the feet, see `Part`: a point with a force that has a
    cone. `rows` is the specification; `kernel`, of a `PointTick`, fills the same."""

    room: ClassVar[str] = str(__package__)
    cone_rows: ClassVar[int]  #: of `cone`

    def chain(self, block: B) -> np.ndarray:
        """The degrees of freedom that move the point."""
        raise NotImplementedError

    def rows(self, state: RobotState, block: B) -> ContactRows:
        """Motion, cone and load in NumPy."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class ContactArrays(Block):
    """Everything in contact: the soles, six rows each, then np points, three rows each."""

    J: np.ndarray  # (k, nv); without points that of the state
    positions: np.ndarray  # (np, 3) of the points [m]
    cone: np.ndarray  # (rows, 3) of the points, one below the other
    rows: np.ndarray  # (np + 1,) int: the first row of each point's cone; the last one's end
    bound: np.ndarray  # (rows,) [N]
    fill: Program  # the kernels of the points, each with its rows


def contact_arrays(
    state: StateArrays,
    points: Sequence[Bound[Contact]] = (),
    accel: np.ndarray | None = None,
    weights: np.ndarray | None = None,
    force: np.ndarray | None = None,
) -> ContactArrays:
    """The soles of a state, and further points.

    Args:
        accel, weights, force: (k,) of a workspace, into which the points write.
    """
    soles, nv = state.J.shape
    ends = np.cumsum([0, *(contact.cone_rows for contact, _ in points)])
    J = guarded_zeros((soles + 3 * len(points), nv)) if points else state.J
    positions, cone = guarded_zeros((len(points), 3)), guarded_zeros((int(ends[-1]), 3))
    bound = guarded_zeros(len(cone))
    calls = []
    for i, (contact, block) in enumerate(points):
        assert accel is not None and weights is not None and force is not None
        own, rows = slice(soles + 3 * i, soles + 3 * i + 3), slice(ends[i], ends[i + 1])
        tick = PointTick(state, block, ContactRowArrays(
            positions[i], J[own], accel[own], cone[rows], bound[rows], weights[own], force[own],
        ))  # fmt: skip
        calls.append((contact.kernel, tick))
    return ContactArrays(J, positions, cone, ends.astype(np.int64), bound, Program.of(calls))
