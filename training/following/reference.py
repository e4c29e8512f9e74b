"""Where the bodies of a robot are while it follows a motion exactly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.motions.postures import LevelKinematics
from poise.baselines.motions.reference_motion import ReferenceMotion
from poise.envs.robots.robot import Robot


class Stance(NamedTuple):
    """Where the soles stood at the start: their middle (3,) [m], their heading (cos, sin)."""

    origin: np.ndarray
    heading: np.ndarray

    def placed(self, places: np.ndarray) -> np.ndarray:
        """Places (n, 3) about soles at the origin that face x, about these."""
        return places @ self.turn.T + self.origin

    @property
    def turn(self) -> np.ndarray:
        """The rotation (3, 3) from facing x to this heading."""
        cos, sin = self.heading
        return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


class ReferenceBodies:
    """Joints and bodies of a motion at a time; the soles stand as at the start, facing x.

    Attributes:
        bodies: (n,) bodies that are compared: the robot's own, which move.
    """

    def __init__(self, motion: ReferenceMotion, robot: Robot):
        self.motion, self.robot = motion, robot
        self._kinematics = LevelKinematics(robot)
        model = robot.model
        moving = model.body_weldid == np.arange(model.nbody)
        moving[0] = False
        self.bodies = np.flatnonzero(moving)

    def at(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Joints (nj,) [rad] and places of the bodies (n, 3) [m] at a time [s]."""
        sample, data = self.motion.sample(time), self._kinematics.data
        posture = self._kinematics.posture(sample.q_ref)
        to_heading = posture.root_axes @ data.xmat[self.robot.root_body_id].reshape(3, 3).T
        com = data.subtree_com[self.robot.root_body_id]
        places = (data.xpos[self.bodies] - com) @ to_heading.T + posture.com
        return sample.q_ref, places

    def poses(self, time: float, stance: Stance) -> tuple[np.ndarray, np.ndarray]:
        """Where all bodies are at a time [s], about soles that stand as in `stance`.

        Returns:
            positions (nbody, 3) [m] and quaternions (nbody, 4), w first, world axes.
        """
        sample, data = self.motion.sample(time), self._kinematics.data
        posture = self._kinematics.posture(sample.q_ref)
        to_heading = posture.root_axes @ data.xmat[self.robot.root_body_id].reshape(3, 3).T
        com = data.subtree_com[self.robot.root_body_id]
        places = (data.xpos - com) @ to_heading.T + posture.com
        turned = Rotation.from_matrix(stance.turn @ to_heading @ data.xmat.reshape(-1, 3, 3))
        return stance.placed(places), np.roll(turned.as_quat(), 1, axis=1)
