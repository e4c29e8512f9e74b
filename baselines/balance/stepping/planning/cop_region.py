"""The region of centres of pressure that soles reach with their ankles' torques [Koolen12]."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.balance.references.legs import bearing_polygon, nominal_feet
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.polygons import convex_hull, stacked
from poise.envs.compiled.maths.vectors import placed, turned
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.robots.robot import Robot

_ANGLES = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
# fractions of the load on the first sole, for which the region of two soles is computed
LOAD_FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)
LINE = 1e-12  # [m] a corner that is nearer to the line of its neighbours is none


@dataclass(frozen=True, eq=False)
class CopRegion(Block):
    """The region in which soles can put the centre of pressure p with their ankles' torques.

    A sole under a load of λ m g reaches the p of its polygon with |N p − o| ≤ b/λ, see
    `ankle_limits`. Two soles reach p = λ p_0 + (1 − λ) p_1, with p_i what sole i reaches under its
    load: the less a foot carries, the further its ankle can move the pressure. All is in the frames
    of the soles.
    """

    alone: np.ndarray  # (ns, k, 2) corners of what each sole reaches alone [m]
    corners: np.ndarray  # (ns,) int: how many of them count
    middle: np.ndarray  # (ns, 2) their mean [m]
    sums: np.ndarray  # (5, n, 2) corners of what two reach, beside λ p_0 + (1 − λ) p_1 [m]
    support: np.ndarray  # (5, 48) how far these go along each direction [m]
    directions: np.ndarray  # (48, 2) unit vectors
    load_fractions: np.ndarray  # (5,) λ

    def both(self, points: np.ndarray, yaw: float) -> np.ndarray:
        """(k, 2) The region of two soles at `points` (2, ≥ 2), turned by `yaw` [m]."""
        cloud = guarded_zeros((self.sums.shape[0] * self.sums.shape[1], 2))
        out = guarded_zeros((2 * len(cloud) + 1, 2))
        n = double_support_region(self, np.array(points), np.cos(yaw), np.sin(yaw), cloud, out)
        return out[:n]


@compiled
def distance_beyond(
    r: CopRegion,
    fx: float,
    fy: float,
    sx: float,
    sy: float,
    cos: float,
    sin: float,
    x: float,
    y: float,
) -> float:
    """Return how far (x, y) lies outside the region of two soles [m]; < 0 inside.

    The soles are at (fx, fy) and (sx, sy), their heading is (cos, sin). The distance is
    measured along 48 DIRECTIONS only, which lets corners reach some millimetres further.
    """
    worst = -np.inf
    for d in range(r.directions.shape[0]):
        # the direction, turned
        dx, dy = turned(cos, sin, r.directions[d, 0], r.directions[d, 1])
        a, b = fx * dx + fy * dy, sx * dx + sy * dy
        edge = -np.inf
        for k in range(r.load_fractions.shape[0]):
            edge = max(
                edge,
                r.support[k, d] + r.load_fractions[k] * a + (1.0 - r.load_fractions[k]) * b,
            )
        worst = max(worst, x * dx + y * dy - edge)
    return worst


@compiled
def single_support_region(
    r: CopRegion, sole: int, point: np.ndarray, cos: float, sin: float, out: np.ndarray
) -> int:
    """The corners of what a sole at `point` (≥ 2,) reaches alone into rows of `out` (≥ k, 2) [m];
    how many they are."""
    for i in range(r.corners[sole]):
        u, v = r.alone[sole, i, 0], r.alone[sole, i, 1]
        out[i, 0], out[i, 1] = placed(point[0], point[1], cos, sin, u, v)
    return r.corners[sole]


@compiled
def double_support_region(
    r: CopRegion, points: np.ndarray, cos: float, sin: float, cloud: np.ndarray, out: np.ndarray
) -> int:
    """The hull of what two soles at `points` (2, ≥ 2) reach under all fractions of the load, into
    rows of `out` (10 n + 1, 2) [m]; how many corners it has.

    `cloud` (5 n, 2) is scratch.
    """
    n = 0
    for k in range(r.load_fractions.shape[0]):
        a, b = r.load_fractions[k], 1.0 - r.load_fractions[k]
        x, y = a * points[0, 0] + b * points[1, 0], a * points[0, 1] + b * points[1, 1]
        for i in range(r.sums.shape[1]):
            u, v = r.sums[k, i, 0], r.sums[k, i, 1]
            cloud[n, 0], cloud[n, 1] = placed(x, y, cos, sin, u, v)
            n += 1
    return convex_hull(cloud, n, LINE, out)


def cop_region(robot: Robot, fraction: float = 0.95) -> CopRegion:
    """The region of a robot with two soles; only `fraction` of each polygon and of each torque
    limit counts."""
    alone = [bearing_polygon(robot, i, 1.0, fraction) for i in range(2)]
    sums = []
    for load in LOAD_FRACTIONS:
        first = load * bearing_polygon(robot, 0, load, fraction)
        second = (1.0 - load) * bearing_polygon(robot, 1, 1.0 - load, fraction)
        sums.append((first[:, None] + second[None]).reshape(-1, 2))
    return CopRegion(
        alone=stacked(alone),
        corners=np.array([len(corners) for corners in alone]),
        middle=np.array([polygon.mean(axis=0) for polygon in alone]),
        sums=stacked(sums),
        support=np.array([(corners @ DIRECTIONS.T).max(axis=0) for corners in sums]),
        directions=DIRECTIONS,
        load_fractions=np.array(LOAD_FRACTIONS),
    )


def rest_ahead(robot: Robot, region: CopRegion) -> float:
    """How far the CoM of the standing posture is ahead of the middle of both soles' region [m].

    Zero for a robot that does not stand as described, see `PostureDescription`.
    """
    if robot.description.posture.com == "controller":
        return 0.0
    return float(robot.com_ahead - region.both(nominal_feet(robot), 0.0).mean(axis=0)[0])
