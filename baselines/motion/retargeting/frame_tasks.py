"""What is asked of the posture of one frame, for solvers of one frame and of whole clips."""

from __future__ import annotations

import mink
import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

from .limbs import Limbs
from .targets import BodyTargets
from .tasks import HeightTask, SegmentTask

COM, HEIGHT = 10.0, 5.0  # costs beside those of the segments [1/m]
POSTURE, TRUNK = 0.1, 1.0  # the same of joints out of standing [1/rad]: a deep squat is to be
# shallower rather than made by the waist alone, once the hips are at their limit


class FrameTasks:
    """Segments, height of the hips, horizontal place of the CoM, and the standing posture.

    `configuration` is the posture that they are evaluated in; it begins in standing.
    """

    def __init__(self, robot: Robot, limbs: Limbs, names: list[str]):
        self.configuration = mink.Configuration(robot.model, q=robot.standing_qpos)
        self.segments, self.height = SegmentTask(limbs, names), HeightTask(limbs, HEIGHT)
        data = self.configuration.data
        self.standing = float((self.height.pelvis.place(data) - self.height.feet.place(data))[2])
        com = mink.ComTask(np.array([COM, COM, 0.0]))
        com.set_target_from_configuration(self.configuration)
        posture = mink.PostureTask(robot.model, _posture_costs(limbs, robot.model, data))
        posture.set_target_from_configuration(self.configuration)
        self.tasks = [self.segments, self.height, com, posture]

    def aim(self, targets: BodyTargets, frame: int) -> None:
        """Take what is asked in a frame as targets."""
        self.segments.aim(targets.directions, frame)
        self.height.height = self.standing * float(targets.height[frame])

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
