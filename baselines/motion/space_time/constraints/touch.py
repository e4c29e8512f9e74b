"""A part of the body that touches another one."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

import mujoco
import numpy as np

from poise.baselines.motion.retargeting.limbs import Point
from poise.configs.errors import ConfigError

from .constraint import Constraint
from .scene import ConstraintRows, Scene

FAR = 5.0  # [m] beyond which MuJoCo need not look


@dataclass(frozen=True, kw_only=True)
class Touch(Constraint):
    """0 ≤ d ≤ within, d the distance between the surface at a point and that of a body.

    Attributes:
        point: a limb's role such as hand_right; the geometry nearest to it touches.
        body: what is touched: the nearest geometry of this body.
        within: [m].
    """

    point: str
    body: str
    kind: Literal["touch"] = "touch"
    within: float = field(default=0.0, metadata={"min": 0.0})

    def geoms(self, scene: Scene) -> tuple[int, list[int]]:
        """The geometry that touches, and those that it may touch.

        Raises ConfigError for a point or a body without a geometry that can collide.
        """
        point = scene.point(self.point, "point")
        if not isinstance(point, Point) or len(point.parts) != 1:
            raise ConfigError("is not on one body", field="point")
        body, place = point.parts[0]
        own = _solid(scene.model, body, "point")
        nearest = min(own, key=lambda g: float(np.linalg.norm(scene.model.geom_pos[g] - place)))
        other = scene.body(self.body, "body")
        if other == body:
            raise ConfigError(f"{self.body!r} is the body of {self.point}", field="body")
        return nearest, _solid(scene.model, other, "body")

    def rows(self, scene: Scene, frames: Sequence[int]) -> Iterator[ConstraintRows]:
        """One row a frame: the distance to the nearest geometry, below 0 where they overlap."""
        geom, others = self.geoms(scene)
        low, high = np.zeros(1), np.array([self.within])
        for frame in frames:
            data = scene.at(frame)
            found = [_distance(scene.model, data, geom, other) for other in others]
            distance, derivative = min(found, key=lambda each: each[0])
            yield ConstraintRows({frame: derivative}, np.array([distance]), low, high)

    def about(self) -> str:
        return f"{self.point} touches {self.body}"


def _solid(model: mujoco.MjModel, body: int, field: str) -> list[int]:
    found = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body
             and (model.geom_contype[g] or model.geom_conaffinity[g])]  # fmt: skip
    if not found:
        raise ConfigError(f"the body {model.body(body).name!r} has no geometry that collides",
                          field=field)  # fmt: skip
    return found


def _distance(
    model: mujoco.MjModel, data: mujoco.MjData, first: int, second: int
) -> tuple[float, np.ndarray]:
    """The signed distance of two geometries [m] and its derivative (1, nv)."""
    ends = np.empty(6)
    distance = mujoco.mj_geomDistance(model, data, first, second, FAR, ends)
    normal = ends[3:] - ends[:3]
    length = float(np.linalg.norm(normal))
    if length < 1e-9:  # they just touch: the way between their centres
        normal = data.geom_xpos[second] - data.geom_xpos[first]
        length = float(np.linalg.norm(normal))
    elif distance < 0.0:
        normal = -normal
    jacobians = np.empty((2, 3, model.nv))
    for jacobian, geom, end in ((jacobians[0], first, ends[:3]), (jacobians[1], second, ends[3:])):
        mujoco.mj_jac(model, data, jacobian, None, end, int(model.geom_bodyid[geom]))
    return float(distance), normal[None] / length @ (jacobians[1] - jacobians[0])
