"""A limit of mink that keeps a robot's links off the floor and off each other."""

from itertools import combinations
from typing import NamedTuple

import mink
import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

FLOOR = 0.03  # [m] kept from the floor: what touches it has fallen
SHARE = 0.5  # of the distance to the floor of what stands nearer than that
APART = 0.01  # [m] kept between links
NEAR = 0.03  # [m] beyond what is kept, within which a pair is looked at
GAIN = 0.5  # of what a pair may approach, or is to part, in one step
FASTEST = 0.02  # [m] by which a pair is to part in one step


class GeometryPair(NamedTuple):
    """Two geometries that must not meet, and the distance that is kept [m]."""

    first: int
    second: int
    kept: float


class ClearanceLimit(mink.Limit):
    """−∂d/∂q Δq ≤ γ (d − d₀) for every pair of geometries at a distance d < d₀ + 3 cm.

    d₀ is 3 cm to the floor and 1 cm between links. What is nearer in the standing posture keeps
    half of its distance to the floor, all of it to another link. Pairs are those that collide in
    the simulation, but for the soles and the floor. Unlike mink's own limit it also parts what is
    too near already.
    """

    def __init__(self, robot: Robot, data: mujoco.MjData):
        self.model = robot.model
        self.pairs = find_pairs(robot, data)
        self.parting = True  # off: what is too near only comes no nearer

    def compute_qp_inequalities(
        self, configuration: mink.Configuration, dt: float
    ) -> mink.Constraint:
        """G Δq ≤ h, a row for each pair that is near."""
        rows, bounds = [], []
        for pair in self.candidates(configuration.data):
            distance, row = self.row(configuration.data, pair)
            if row is not None:
                room = GAIN * (distance - pair.kept)
                rows.append(-row)
                bounds.append(max(room, -FASTEST if self.parting else 0.0))
        if not rows:
            return mink.Constraint()
        return mink.Constraint(G=np.array(rows), h=np.array(bounds))

    def lacking(self, data: mujoco.MjData) -> np.ndarray:
        """(k,) by how much pairs are nearer than they are to be [m]; empty if none is."""
        pairs = self.candidates(data)
        gaps = [pair.kept - self.distance(data, pair, np.empty(6)) for pair in pairs]
        return np.array([gap for gap in gaps if gap > 0.0])

    def depth(self, data: mujoco.MjData) -> float:
        """Depth of the deepest penetration [m]; 0 without one."""
        pairs = self.candidates(data)
        return max(0.0, *(-self.distance(data, pair, np.empty(6)) for pair in pairs), 0.0)

    def candidates(self, data: mujoco.MjData) -> list[GeometryPair]:
        """The pairs whose bounding spheres are near; a plane is never left out."""
        if not self.pairs:
            return []
        first, second, kept = (np.array(column) for column in zip(*self.pairs, strict=True))
        radius, places = self.model.geom_rbound, data.geom_xpos
        between = np.linalg.norm(places[first] - places[second], axis=1)
        endless = (radius[first] == 0.0) | (radius[second] == 0.0)
        near = between - radius[first] - radius[second] < kept + NEAR
        return [self.pairs[i] for i in np.flatnonzero(near | endless)]

    def distance(self, data: mujoco.MjData, pair: GeometryPair, ends: np.ndarray) -> float:
        """Between the geometries of a pair [m], at most 3 cm more than what is kept; `ends` (6,)
        become the nearest points."""
        reach = pair.kept + NEAR
        return float(mujoco.mj_geomDistance(self.model, data, *pair[:2], reach, ends))

    def row(self, data: mujoco.MjData, pair: GeometryPair) -> tuple[float, np.ndarray | None]:
        """The distance, and its derivative (nv,); None where the pair is far or just touches."""
        ends = np.empty(6)
        distance = self.distance(data, pair, ends)
        normal = ends[3:] - ends[:3]
        length = float(np.linalg.norm(normal))
        if distance >= pair.kept + NEAR or length < 1e-9:
            return distance, None
        normal *= np.sign(distance) / length
        jacobians = np.empty((2, 3, self.model.nv))
        for i, geom in enumerate(pair[:2]):
            body = int(self.model.geom_bodyid[geom])
            mujoco.mj_jac(self.model, data, jacobians[i], None, ends[3 * i : 3 * i + 3], body)
        return distance, normal @ (jacobians[1] - jacobians[0])


def find_pairs(robot: Robot, data: mujoco.MjData) -> tuple[GeometryPair, ...]:
    """Pairs that collide in the simulation, without soles and floor; `data` holds standing.

    MuJoCo lets neither geometries of one body collide nor those of bodies that share a joint.
    """
    model, found = robot.model, []
    feet, ends = {sole.body_id for sole in robot.soles}, np.empty(6)
    for first, second in combinations(range(model.ngeom), 2):
        bodies = [int(model.geom_bodyid[geom]) for geom in (first, second)]
        floor = 0 in bodies
        if not _collide(model, first, second) or (floor and feet & set(bodies)):
            continue
        kept = FLOOR if floor else APART
        now = mujoco.mj_geomDistance(model, data, first, second, kept, ends)
        if now > 0.0:  # links that overlap as they stand are drawn so
            if floor and now < kept:  # an ankle just above its sole: it may roll
                kept = SHARE * now
            found.append(GeometryPair(first, second, float(min(kept, now))))
    return tuple(found)


def _collide(model: mujoco.MjModel, first: int, second: int) -> bool:
    """True if MuJoCo looks for contacts of two geometries."""
    masks = model.geom_contype, model.geom_conaffinity
    if not (masks[0][first] & masks[1][second] or masks[0][second] & masks[1][first]):
        return False
    bodies = sorted(int(model.body_weldid[model.geom_bodyid[geom]]) for geom in (first, second))
    parents = [int(model.body_weldid[model.body_parentid[body]]) for body in bodies]
    related = bodies[0] in (bodies[1], parents[1]) and bodies[0] != 0
    signature = (bodies[0] << 16) + bodies[1]
    return not related and bodies[0] != bodies[1] and signature not in model.exclude_signature
