"""What the clip asks of every frame, and the clearance of links; needs mink."""

from collections.abc import Sequence

import numpy as np

from poise.baselines.motion.retargeting.clearance import ClearanceLimit, GeometryPair
from poise.baselines.motion.retargeting.targets import BodyTargets
from poise.baselines.motion.retargeting.tasks import FrameTasks
from poise.baselines.motion.space_time.constraints.constraint import Constraint
from poise.baselines.motion.space_time.constraints.scene import ConstraintRows, Scene
from poise.baselines.motion.space_time.constraints.touch import Touch

ENDLESS = np.array([np.inf])


class Asked:
    """Errors of the tasks of single frames, and rows of what a body must not do.

    Links that a user asks to touch may: their pair keeps a distance of 0 in its period.
    """

    def __init__(self, scene: Scene, targets: BodyTargets, constraints: Sequence[Constraint]):
        self.targets = targets
        self.tasks = FrameTasks(scene.robot, scene.limbs, list(targets.directions))
        self.limit = ClearanceLimit(scene.robot, self.tasks.configuration.data)
        self.touching: dict[int, set[frozenset[int]]] = {}
        for constraint in constraints:
            if isinstance(constraint, Touch):
                geom, others = constraint.geoms(scene)
                for frame in constraint.frames(scene).tolist():
                    pairs = self.touching.setdefault(frame, set())
                    pairs |= {frozenset((geom, other)) for other in others}

    def errors(self, scene: Scene, frame: int) -> np.ndarray:
        """(m,) W e of a frame."""
        self.tasks.configuration.update(scene.qpos[frame])
        self.tasks.aim(self.targets, frame)
        return self.tasks.errors()

    def clearance(self, scene: Scene, frame: int) -> list[ConstraintRows]:
        """d ≥ d₀ for the pairs of geometries that are near, see `ClearanceLimit`."""
        data, found = scene.at(frame), []
        for pair in self._near(scene, frame):
            distance, row = self.limit.row(data, pair)
            if row is not None:
                least = np.array([pair.kept])
                found.append(
                    ConstraintRows({frame: row[None]}, np.array([distance]), least, ENDLESS)
                )
        return found

    def too_near(self, scene: Scene, frame: int) -> float:
        """Σ (d₀ − d) over the pairs that are nearer than they are to be [m]."""
        data, ends, total = scene.at(frame), np.empty(6), 0.0
        for pair in self._near(scene, frame):
            total += max(pair.kept - self.limit.distance(data, pair, ends), 0.0)
        return total

    def _near(self, scene: Scene, frame: int) -> list[GeometryPair]:
        """The pairs that are near, and how far apart each is to be."""
        touching = self.touching.get(frame, ())
        return [pair._replace(kept=0.0) if frozenset(pair[:2]) in touching else pair
                for pair in self.limit.candidates(scene.at(frame))]  # fmt: skip
