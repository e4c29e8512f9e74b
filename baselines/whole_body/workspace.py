"""The memory of a reduced problem: which part of each array is what, said once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.solvers.dual_active_set import iscratch_size, scratch_size
from poise.baselines.solvers.null_space import NullSpace, allocate_null_space
from poise.envs.compiled.block import Block
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays, sole_chains

from .tasks.task import TaskSpace


@dataclass(eq=False)
class Workspace(Block):
    """Scratch of the reduced problem; `H`, `g`, `C`, `l`, `u` are the QP after `assemble`.

    Unknowns x = (z, y, f, u): what is left of v̇, internal wrenches of the soles, forces of the
    point contacts, a soft root's wrench. Constraints are the soles' cones, the points' cones,
    torque limits, joint limits and further limits. `first_…` is where a part of these begins.
    There are nj = nv − 6 joints, and k contact forces and moments: six a sole, three a point.

    v̇, the total wrench W, the contact wrenches w and the joint torques τ are affine in x:
    V x + v̇₀, B x + W₀, E x + w₀, T x + τ₀. They lie one below the other in `rows` and `offsets`,
    then u, which is x itself, then copies of those that more than one task weighs.
    """

    first_internal: int  # unknown y
    first_force: int  # unknown f
    first_root: int  # unknown u
    first_point: int  # constraint: those before are the soles'
    first_torque: int
    first_joint: int
    rows: Annotated[np.ndarray, "r", "n"]
    offsets: Annotated[np.ndarray, "r"]
    desired: Annotated[np.ndarray, "r"]  # what each should be
    weights: Annotated[np.ndarray, "r"]  # of the squared differences
    weighted: Annotated[np.ndarray, "r", "n"]  # rows times weights
    values: Annotated[np.ndarray, "r"]  # at the solution
    V: np.ndarray  # (nv, n) a view of `rows`; columns span the null space of J, or are 0
    B: np.ndarray  # (6, n) A V, a view
    E: np.ndarray  # (k, n) a view
    T: np.ndarray  # (nj, n) a view
    vdot0: np.ndarray  # (nv,) a view of `offsets`
    W0: np.ndarray  # (6,) A v̇₀ + A_bias, a view
    w0: np.ndarray  # (k,) a view
    tau0: np.ndarray  # (nj,) a view
    copied: np.ndarray  # (c, 3) int: first row of a copy, of what it copies, how many rows
    accel_des: np.ndarray  # (nv,) a view of `desired`
    force_des: np.ndarray  # (k,) a view
    force_weights: np.ndarray  # (k,) a view of `weights`
    space: NullSpace
    sole_accel: Annotated[np.ndarray, "6nc"]  # a of swing feet's soles; zero on the ground
    contact_accel: Annotated[np.ndarray, "k"]  # that the contacts are to have: J v̇ + J̇ v less J̇ v
    cop_prev: Annotated[np.ndarray, 2]  # last measured p
    cop_vel: Annotated[np.ndarray, 2]  # ṗ
    force: Annotated[np.ndarray, 3]  # −m g, which the ground bears at rest
    JtE: Annotated[np.ndarray, "nv", "n"]  # Jᵀ E
    local: Annotated[np.ndarray, 6, "n"]  # E of one sole, its own axes
    local0: Annotated[np.ndarray, 6]  # w₀ of one sole, its own axes
    H: Annotated[np.ndarray, "n", "n"]
    g: Annotated[np.ndarray, "n"]
    C: Annotated[np.ndarray, "m", "n"]
    l: Annotated[np.ndarray, "m"]  # noqa: E741
    u: Annotated[np.ndarray, "m"]
    x: Annotated[np.ndarray, "n"]
    lam: Annotated[np.ndarray, "m"]
    scratch: Annotated[np.ndarray, "floats"]
    iscratch: Annotated[np.ndarray, "ints", np.int64]
    status: Mutable[int]  # how the solution ended, see `solvers/scaled_rows.py`; 0: solved
    vdot: np.ndarray  # (nv,) solution, a view of `values` like the next two
    wrenches: np.ndarray  # (k,) solution
    tau_asked: np.ndarray  # (nj,) solution, to rounding within the limits
    tau: Annotated[np.ndarray, "nj"]  # solution, within the limits
    root_wrench: Annotated[np.ndarray, 6]  # solution, about the CoM; zero with a hard root

    def part(self, quantity: TaskSpace) -> slice:
        """Return which of `rows` a quantity is."""
        nv, k, nj = len(self.vdot0), len(self.w0), len(self.tau0)
        return _part(quantity, nv, len(self.sole_accel), k, nj, len(self.g) - self.first_root)


def _part(quantity: TaskSpace, nv: int, soles: int, k: int, nj: int, nu: int) -> slice:
    """The rows of a quantity where the soles have `soles` wrench entries, and a root nu."""
    first, size = {
        TaskSpace.ACCELERATION: (0, nv),
        TaskSpace.FORCE: (nv, 3),
        TaskSpace.MOMENT: (nv + 3, 3),
        TaskSpace.WRENCHES: (nv + 6, soles),
        TaskSpace.TORQUES: (nv + 6 + k, nj),
        TaskSpace.ROOT: (nv + 6 + k + nj, nu),
    }[quantity]
    return slice(first, first + size)


def allocate_workspace(
    robot: RobotArrays,
    cone_rows: int,
    soft_root: bool,
    point_chains: Sequence[np.ndarray] = (),
    point_rows: int = 0,
    limit_rows: int = 0,
    copies: Sequence[TaskSpace] = (),
) -> Workspace:
    """Zeroed scratch for one robot, whose wrench cones have `cone_rows` rows each.

    Args:
        point_chains: for each point contact the degrees of freedom that move its body.
        point_rows: how many rows the cones of these have together.
        limit_rows: rows of limits in addition to those of torques and joints.
        copies: quantities that one more task weighs, in the order of these tasks.
    """
    space = allocate_null_space(len(robot.q_standing) + 6, sole_chains(robot), point_chains)
    points, nj, nc = len(point_chains), len(robot.q_standing), len(robot.sole_body)
    nv, k = nj + 6, 6 * nc + 3 * points
    first_internal = nv - len(space.beta) + space.spare
    first_force = first_internal + 6 * (nc - 1)
    first_root = first_force + 3 * points
    first_point = nc * cone_rows
    first_torque = first_point + point_rows
    first_joint = first_torque + nj
    nu = 6 if soft_root else 0
    n, m = first_root + nu, first_joint + nj + limit_rows
    r, copied = nv + 6 + k + nj + nu, []
    for quantity in copies:
        part = _part(quantity, nv, 6 * nc, k, nj, nu)
        copied.append((r, part.start, part.stop - part.start))
        r += part.stop - part.start
    rows, offsets, desired, weights, values = (
        guarded_zeros(shape) for shape in ((r, n), r, r, r, r)
    )
    V, B, E = slice(nv), slice(nv, nv + 6), slice(nv + 6, nv + 6 + k)
    T = slice(E.stop, E.stop + nj)
    for i in range(3 * points):  # the forces of points are unknowns themselves
        rows[E][i - 3 * points, first_force + i] = 1.0
    for i in range(nu):
        rows[T.stop + i, first_root + i] = 1.0
    sizes = {"nv": nv, "nj": nj, "nc": nc, "k": k, "r": r, "n": n, "m": m}
    sizes |= {"floats": scratch_size(n, m), "ints": iscratch_size(n, m)}
    ws = Workspace.allocate(
        sizes, first_internal=first_internal, first_force=first_force, first_root=first_root,
        first_point=first_point, first_torque=first_torque, first_joint=first_joint,
        rows=rows, offsets=offsets, desired=desired, weights=weights, values=values,
        V=rows[V], B=rows[B], E=rows[E], T=rows[T],
        vdot0=offsets[V], W0=offsets[B], w0=offsets[E], tau0=offsets[T],
        copied=np.array(copied, dtype=np.int64).reshape(-1, 3), accel_des=desired[V],
        force_des=desired[E], force_weights=weights[E], space=space,
        vdot=values[V], wrenches=values[E], tau_asked=values[T],
    )  # fmt: skip
    ws.cop_prev[:] = np.nan
    return ws
