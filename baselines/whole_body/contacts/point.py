"""A point of a body on a surface that does not move, such as a hand on a wall."""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.body_points import BodyPoint, body_point, point_motion, update_point
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .contact import Contact, ContactRows, PointTick


@dataclass(eq=False)
class PointContactBlock(Block):
    """A point contact in SI units. Write `force` and `largest` to lean more or less on it."""

    point: BodyPoint
    normal: np.ndarray  # (3,) out of the surface, world
    cone: np.ndarray  # (5, 3) cone · f ≤ (0, 0, 0, 0, largest)
    force: Mutable[float]  # along the normal, desired [N]
    largest: Mutable[float]  # along the normal [N]
    force_weight: float  # per N²
    damping: float  # k_v [1/s]


@compiled
def fill_point(t: PointTick[PointContactBlock]):
    """The rows of a point contact, see `PointContact`."""
    c, rows = t.contact, t.rows
    point = c.point
    update_point(t.state, point)
    for a in range(3):
        rows.position[a] = point.position[a]
        rows.accel[a] = -c.damping * point.J_v[a] - point.Jdot_v[a]
        rows.weights[a] = c.force_weight
        rows.force[a] = c.force * c.normal[a]
        copy_into(point.J[a], rows.J[a])
    for r in range(5):
        copy_into(c.cone[r], rows.cone[r])
        rows.bound[r] = c.largest if r == 4 else 0.0


@dataclass(frozen=True)
class PointContact(Contact[PointContactBlock]):
    """J v̇ + J̇ v = −k_v J v and |f_1| + |f_2| ≤ μ f_n, f_n ≤ f_max: a point that does not move and
    transmits no moment, with ½ ω_f ‖f − f_des n‖² added to the objective.

    f is the surface's force on the robot, n the normal out of the surface, f_1 and f_2 its parts
    along two tangents. A point that leaves its place is not brought back.
    """

    cone_rows: ClassVar[int] = 5
    kernel = staticmethod(fill_point)

    body: str  #: name of the body
    normal: tuple[float, float, float]  #: n, world axes; of any length
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: in the body's axes [m]
    kind: Literal["point"] = "point"
    friction: float = field(default=0.5, metadata={"above": 0.0})  #: μ that may be used
    force: float = field(default=0.0, metadata={"min": 0.0})  #: f_des in m g
    largest_force: float = field(default=0.5, metadata={"above": 0.0})  #: f_max in m g
    force_weight: float = field(default=1.0, metadata={"above": 0.0})  #: ω_f per (m g)²
    damping: float = field(default=5.0, metadata={"min": 0.0})  #: k_v in ω

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.normal) > 0.0:
            raise ValueError("normal: must not be zero")

    def bind(self, robot: Robot) -> PointContactBlock:
        """The contact in SI units, its normal of length one."""
        units = robot.units
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        return PointContactBlock(
            point=body_point(robot, self.body, self.point), normal=normal,
            cone=force_cone(normal, self.friction),
            force=float(self.force * units.force),
            largest=float(self.largest_force * units.force),
            force_weight=float(self.force_weight / units.force**2),
            damping=float(self.damping * units.omega),
        )  # fmt: skip

    def chain(self, block: PointContactBlock) -> np.ndarray:
        return block.point.chain

    def rows(self, state: RobotState, block: PointContactBlock) -> ContactRows:
        motion = point_motion(state, block.point)
        return ContactRows(
            position=motion.position,
            J=motion.J[:3],
            accel=-block.damping * motion.J_v[:3] - motion.Jdot_v[:3],
            cone=block.cone,
            bound=np.array([0.0, 0.0, 0.0, 0.0, block.largest]),
            weights=np.full(3, block.force_weight),
            force=block.force * block.normal,
        )


def force_cone(normal: np.ndarray, friction: float) -> np.ndarray:
    """(5, 3) rows of ±f_1 ± f_2 − μ f_n ≤ 0 and of f_n, for a unit normal in world axes.

    The tangents are horizontal and across, as far as the normal is not vertical.
    """
    away = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    first = np.cross(away, normal)
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    signs = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    return np.vstack([signs @ np.array([first, second]) - friction * normal, normal])
