"""Postures of a robot whose pelvis and soles go along given tracks, frame by frame, by mink."""

import mink
import numpy as np

from poise.baselines.balance.references.legs import foot_signs
from poise.baselines.motion.clips.rotations import about_z, multiply, rotate
from poise.baselines.motion.clips.skeleton import SIDES
from poise.configs.errors import PoiseError
from poise.envs.robots.robot import Robot

from .limbs import Limbs
from .solve import FrameIk, Solved
from .targets import low_pass
from .tasks import PointTask
from .tracks import Tracks

PELVIS = 5.0  # cost of its place [1/m]
SWING, LEVEL = 30.0, 1.0  # costs of a swing foot's sole: position [1/m] and rotation [1/rad]
ROOT, LEAN = 10.0, 3.0  # the same of the root where the filtered postures are made to stand


def solve_tracks(robot: Robot, limbs: Limbs, tracks: Tracks, cutoff: float) -> Solved:
    """Solve one posture after the other, as `solve_frames`: planted soles are constraints, swing
    feet and the pelvis are tasks. All is low-passed at `cutoff` [Hz], and the nearest postures with
    planted soles are what remains. Raises PoiseError if a QP has no solution."""
    return _TrackIk(robot, limbs, tracks).solve_all(tracks.body, cutoff)


class _TrackIk(FrameIk):
    """The tasks of one robot, with soles that are planted here and there."""

    first = 8  # it begins in standing

    def __init__(self, robot: Robot, limbs: Limbs, tracks: Tracks):
        super().__init__(robot, limbs, list(tracks.body.directions))
        self.tracks, data = tracks, self.configuration.data
        segments, _, _, self.posture = self.frame.tasks
        self.segments, self.pelvis = segments, PointTask(limbs.points["pelvis"], PELVIS)
        self.feet = [mink.FrameTask(sole.body, "body", SWING, LEVEL) for sole in robot.soles]
        self.hard = self.soles.feet
        self.root = mink.FrameTask(robot.model.body(robot.root_body_id).name, "body", ROOT, LEAN)
        ankles = [limbs.points[f"ankle_{side}"].place(data) for side in SIDES]
        ankles = ankles if foot_signs(robot)[0] > 0.0 else ankles[::-1]
        self.standing = [
            (data.xquat[sole.body_id].copy(), data.xpos[sole.body_id] - ankle)
            for sole, ankle in zip(robot.soles, ankles, strict=True)
        ]

    def tread(self, frame: int) -> None:
        """Take pelvis and soles of a frame as targets."""
        tracks = self.tracks
        for i, (axes, away) in enumerate(self.standing):
            turn = about_z(float(tracks.yaws[frame, i]))
            place = tracks.ankles[frame, i] + rotate(turn, away)
            pose = mink.SE3(np.concatenate([multiply(turn, axes), place]))
            self.feet[i].set_target(pose)
            self.hard[i].set_target(pose)
        self.pelvis.goal = tracks.pelvis[frame]
        down = tracks.planted[frame]
        self.soles.feet = [foot for foot, on in zip(self.hard, down, strict=True) if on]
        loose = [foot for foot, on in zip(self.feet, down, strict=True) if not on]
        self.frame.tasks = [self.segments, self.pelvis, self.posture, *loose]

    def _step(self, tasks: list[mink.Task], damping: float) -> np.ndarray:
        """(nv,) the displacement of one QP; soles that cannot be held go as near as they can."""
        try:
            return super()._step(tasks, damping)
        except PoiseError:
            held, self.soles.feet = self.soles.feet, []
            try:
                return super()._step([*tasks, *self.feet], damping)
            finally:
                self.soles.feet = held

    def smoothed(self, qpos: np.ndarray, cutoff: float) -> np.ndarray:
        """(F, nq) the postures, low-passed, the root's quaternions as they follow each other."""
        signs = np.sign(np.sum(qpos[1:, 3:7] * qpos[:-1, 3:7], axis=1))
        qpos[1:, 3:7] *= np.cumprod(np.where(signs == 0.0, 1.0, signs))[:, None]
        wanted = low_pass(qpos, cutoff)
        wanted[:, 3:7] /= np.linalg.norm(wanted[:, 3:7], axis=1, keepdims=True)
        return wanted

    def sole_error(self) -> float:
        """Largest coordinate by which a planted foot is off [m, rad]."""
        return float(np.abs(self.soles.whole_error(self.configuration)).max(initial=0.0))

    def near_tasks(self) -> list[mink.Task]:
        """The joints, and the root, as they are in the configuration."""
        self.root.set_target_from_configuration(self.configuration)
        return [*super().near_tasks(), self.root]
