"""Points fixed to a body: where they are, how they move, and the Jacobian of both."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.robots.robot import Robot

from .arrays import dof_chain
from .jacobian import point_jacobian
from .kinematics import StateArrays
from .legs import standing_data
from .state import RobotState


@dataclass(frozen=True, eq=False)
class BodyPoint(Block):
    """A point that is fixed to a body, and where a tick puts its motion (nv degrees of freedom)."""

    body: int
    offset: np.ndarray  # (3,) from the body's origin, in its axes [m]
    chain: np.ndarray  # (k,) int: the degrees of freedom that move the body
    position: Annotated[np.ndarray, 3]  # world [m]
    J: Annotated[np.ndarray, 6, "nv"]  # linear, then angular velocity, world axes
    J_v: Annotated[np.ndarray, 6]
    Jdot_v: Annotated[np.ndarray, 6]


def body_point(robot: Robot, body: str, offset: tuple[float, float, float]) -> BodyPoint:
    """The point of `body` at `offset` [m] in the body's axes.

    Raises ConfigError with the bodies that there are, for one that does not exist or never moves.
    """
    model = robot.model
    moving = {model.body(i).name: i for i in range(1, model.nbody) if model.body_weldid[i] > 0}
    if body not in moving:
        raise ConfigError(f"the robot has no body {shown(body)}", field="body", choices=moving)
    return BodyPoint.allocate(
        {"nv": model.nv},
        body=moving[body],
        offset=np.array(offset, dtype=float),
        chain=np.array(dof_chain(model, moving[body]), dtype=np.int64),
    )


@compiled
def update_point(s: StateArrays, point: BodyPoint):
    """Fill the point's position, J, J v and J̇ v for the state."""
    for a in range(3):
        total = s.body_position[point.body, a]
        for b in range(3):
            total += s.body_axes[point.body, a, b] * point.offset[b]
        point.position[a] = total
    point_jacobian(
        s.dof_axes, s.dof_axes_dot, s.qvel, point.chain, point.chain.shape[0],
        point.position[0] - s.tree_com[0], point.position[1] - s.tree_com[1],
        point.position[2] - s.tree_com[2], point.J, point.J_v, point.Jdot_v,
    )  # fmt: skip


class PointMotion(NamedTuple):
    """The place of a point of a body and its motion, world axes."""

    position: np.ndarray  # (3,) [m]
    axes: np.ndarray  # (3, 3) of the body, as columns
    J: np.ndarray  # (6, nv) linear, then angular velocity
    J_v: np.ndarray  # (6,)
    Jdot_v: np.ndarray  # (6,)


def point_motion(state: RobotState, point: BodyPoint) -> PointMotion:
    """The same as `update_point`, in NumPy, from the point's body, offset and chain alone.

    With the axes s = [ω; v] of a degree of freedom at the subtree CoM o, a point at o + r has the
    columns [v + ω × r; ω], and J̇ v = Σ q̇ [v̇ + ω̇ × r; ω̇] + [ω × ṙ; 0].
    """
    s, chain = state.arrays, point.chain
    axes = s.body_axes[point.body].copy()
    position = s.body_position[point.body] + axes @ point.offset
    r = position - s.tree_com
    J = np.zeros((6, len(s.qvel)))
    J[:, chain] = _at(s.dof_axes[chain], r).T
    J_v = J @ s.qvel
    Jdot_v = s.qvel[chain] @ _at(s.dof_axes_dot[chain], r)
    Jdot_v[:3] += np.cross(J_v[3:], J_v[:3])
    return PointMotion(position, axes, J, J_v, Jdot_v)


def _at(spatial: np.ndarray, r: np.ndarray) -> np.ndarray:
    """(k, 6) linear and angular part at r of spatial vectors [ω; v] at the origin."""
    angular, linear = spatial[:, :3], spatial[:, 3:]
    return np.hstack([linear + np.cross(angular, r), angular])


def standing_frame(robot: Robot, point: BodyPoint) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) [m] of the point and axes (3, 3) of its body in the standing posture."""
    data = standing_data(robot)
    axes = data.xmat[point.body].reshape(3, 3).copy()
    return data.xpos[point.body] + axes @ point.offset, axes
