"""Tasks of mink that hold for any body, and what is asked of the posture of one frame.

mink is imported here and in `solve.py` only, and these only when something is retargeted.
"""

from collections.abc import Mapping, Sequence

import mink
import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

from .limbs import Limbs, LimbVector, Placed, Point
from .targets import LINES, BodyTargets

RANK = 1e-6  # of the largest singular value: smaller ones are rounding
SINGULAR = 0.02  # [m, rad per rad] a motion of the legs that moves the feet less is damped
COM, HEIGHT = 10.0, 5.0  # costs beside those of the segments [1/m]
POSTURE, TRUNK = 0.1, 1.0  # the same of joints out of standing [1/rad]: a deep squat is to be
# shallower rather than made by the waist alone, once the hips are at their limit


class SegmentTask(mink.Task):
    """Segments of the body point where they are to point.

    e = d − d*, with the unit vector d = (b − a)/L from a point a to a point b at distance L:
    J = (I − d dᵀ)(J_b − J_a)/L, three rows a segment. `directions` are set before a solve.
    """

    def __init__(self, limbs: Limbs, names: list[str]):
        weights = np.repeat([LINES[name][2] for name in names], 3)
        super().__init__(cost=weights, gain=1.0, lm_damping=0.0)
        self.names = names
        self.parts, self.differences = _differences(limbs, names)
        self.directions = np.zeros((len(names), 3))

    def aim(self, directions: Mapping[str, np.ndarray], frame: int) -> None:
        """Take the directions of a frame as targets."""
        self.directions = np.array([directions[name][frame] for name in self.names])

    def compute_error(self, configuration: mink.Configuration) -> np.ndarray:
        """(3 S,) differences of the unit vectors."""
        vectors = self._vectors(configuration)
        return (vectors / _norms(vectors) - self.directions).ravel()

    def compute_jacobian(self, configuration: mink.Configuration) -> np.ndarray:
        """(3 S, nv) derivative of the error by the displacement."""
        model, data = configuration.model, configuration.data
        vectors = self._vectors(configuration)
        lengths = _norms(vectors)
        d = vectors / lengths
        of_parts = np.array([part.jacobian(model, data) for part in self.parts])
        moved = np.tensordot(self.differences, of_parts, 1) / lengths[..., None]  # (S, 3, nv)
        moved -= d[:, :, None] * np.einsum("si,sij->sj", d, moved)[:, None, :]
        return moved.reshape(-1, model.nv)

    def _vectors(self, configuration: mink.Configuration) -> np.ndarray:
        """(S, 3) from the first to the second point of every segment [m]."""
        places = np.array([part.place(configuration.data) for part in self.parts])
        return self.differences @ places


class PointTask(mink.Task):
    """The coordinates `axes` of a point of the body, or of one from another, are `goal` [m]."""

    def __init__(self, point: Placed, cost: float, axes: Sequence[int] = (0, 1, 2)):
        super().__init__(cost=np.full(len(axes), cost), gain=1.0, lm_damping=0.0)
        self.point, self.axes, self.goal = point, list(axes), np.zeros(len(axes))

    def compute_error(self, configuration: mink.Configuration) -> np.ndarray:
        """(k,) [m]."""
        return self.point.place(configuration.data)[self.axes] - self.goal

    def compute_jacobian(self, configuration: mink.Configuration) -> np.ndarray:
        """(k, nv)."""
        return self.point.jacobian(configuration.model, configuration.data)[self.axes]


class SolesTask(mink.Task):
    """Feet that stay where they are in `configuration`, as equalities that never contradict.

    The rows of both feet are A = U S Vᵀ. Where the legs' joints can hardly move a foot in some way
    (ankles of one axis) Sᵢ is small, and an error eᵢ = (Uᵀe)ᵢ would ask for a large one. So the
    rows are Vᵢᵀ Δq = −eᵢ Sᵢ/(Sᵢ² + λ²), λ = 0.02: no motion is larger than eᵢ/(2λ).
    """

    def __init__(self, bodies: list[str], configuration: mink.Configuration):
        super().__init__(cost=np.ones(6 * len(bodies)), gain=1.0, lm_damping=0.0)
        self.feet = [mink.FrameTask(body, "body", 1.0, 1.0) for body in bodies]
        for foot in self.feet:
            foot.set_target_from_configuration(configuration)

    def whole_error(self, configuration: mink.Configuration) -> np.ndarray:
        """(6 f,) errors of the feet [m, rad]."""
        errors = [foot.compute_error(configuration) for foot in self.feet]
        return np.concatenate([np.zeros(0), *errors])

    def compute_error(self, configuration: mink.Configuration) -> np.ndarray:
        """(r,) motions along V that undo the errors, damped where they would be large."""
        left, values, _ = self._ranks(configuration)
        return values / (values**2 + SINGULAR**2) * (left.T @ self.whole_error(configuration))

    def compute_jacobian(self, configuration: mink.Configuration) -> np.ndarray:
        """(r, nv)."""
        return self._ranks(configuration)[2]

    def _ranks(self, configuration: mink.Configuration) -> tuple[np.ndarray, ...]:
        rows = np.concatenate([foot.compute_jacobian(configuration) for foot in self.feet])
        left, values, right = np.linalg.svd(rows, full_matrices=False)
        kept = values > RANK * values[0]
        return left[:, kept], values[kept], right[kept]


class FrameTasks:
    """Segments, height of the hips, horizontal place of the CoM, and the standing posture.

    `configuration` is the posture that they are evaluated in; it begins in standing.
    """

    def __init__(self, robot: Robot, limbs: Limbs, names: list[str]):
        self.configuration = mink.Configuration(robot.model, q=robot.standing_qpos)
        hips = LimbVector(limbs.points["pelvis"], limbs.points["feet"])
        self.segments, self.height = SegmentTask(limbs, names), PointTask(hips, HEIGHT, axes=[2])
        data = self.configuration.data
        self.standing = float(hips.place(data)[2])
        com = mink.ComTask(np.array([COM, COM, 0.0]))
        com.set_target_from_configuration(self.configuration)
        posture = mink.PostureTask(robot.model, _posture_costs(limbs, robot.model, data))
        posture.set_target_from_configuration(self.configuration)
        self.tasks = [self.segments, self.height, com, posture]

    def aim(self, targets: BodyTargets, frame: int) -> None:
        """Take what is asked in a frame as targets."""
        self.segments.aim(targets.directions, frame)
        self.height.goal[0] = self.standing * float(targets.height[frame])

    def errors(self) -> np.ndarray:
        """(m,) errors W e of all tasks, each times its cost."""
        errors = [task.cost * task.compute_error(self.configuration) for task in self.tasks]
        return np.concatenate(errors)

    def jacobian(self) -> np.ndarray:
        """(m, nv) derivative of `errors` by the displacement of the posture."""
        rows = [task.cost[:, None] * task.compute_jacobian(self.configuration)
                for task in self.tasks]  # fmt: skip
        return np.concatenate(rows)

    def angles(self) -> np.ndarray:
        """(S,) angles [rad] of the segments to their targets: ‖e‖ is a chord."""
        chords = self.segments.compute_error(self.configuration).reshape(-1, 3)
        return 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(chords, axis=1), 0.0, 1.0))


def _posture_costs(limbs: Limbs, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """(nv,) costs of joints out of standing: the trunk's are those between pelvis and chest."""
    pelvis, chest = (limbs.points[role].jacobian(model, data) for role in ("pelvis", "chest"))
    trunk = np.abs(chest - pelvis).max(axis=0) > 1e-9
    trunk[:6] = False
    return np.where(trunk, TRUNK, POSTURE)


def _norms(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1, keepdims=True)


def _differences(limbs: Limbs, names: list[str]) -> tuple[list[Point], np.ndarray]:
    """Points of one body each (K), and the weights (S, K) by which segments are made of them."""
    parts: dict[tuple[int, bytes], Point] = {}
    rows = []
    for name in names:
        row: dict[tuple[int, bytes], float] = {}
        for role, sign in ((LINES[name][0], -1.0), (LINES[name][1], 1.0)):
            point = limbs.points[role]
            for body, place in point.parts:
                key = (body, place.tobytes())
                parts.setdefault(key, Point(((body, place),)))
                row[key] = row.get(key, 0.0) + sign / len(point.parts)
        rows.append(row)
    return list(parts.values()), np.array([[row.get(k, 0.0) for k in parts] for row in rows])
