"""The ghost of a motion: where the robot is if it follows its reference exactly."""

from typing import Any, NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import RobotClip
from poise.baselines.extras import load_extra
from poise.envs.balance.base import BalanceEnv
from poise.envs.robots.robot import Robot


class Poses(NamedTuple):
    """Where the bodies of a robot are, world axes: (nbody, 3) [m]; (nbody, 4), w first."""

    positions: np.ndarray
    quaternions: np.ndarray


class Ghost:
    """The bodies of a reference motion, whose soles are where the robot stood at its reset.

    The soles of a motion with steps go on from there as the motion has them.
    """

    def __init__(self, motion: ReferenceMotion, env: BalanceEnv):
        what = f"the motion {motion.name!r}"
        self._bodies = load_extra("motions", "bodies", what)(motion, env.robot)
        self._stance = load_extra("motions", "sole_places", what).of(env.simulation.state)
        self._footing = motion.footing
        self._bodies.at(0.0, self._stance)
        self._frame = self._bodies.origin.copy(), self._bodies.turn.copy()

    def __call__(self, time: float) -> Poses:
        """Where it is at a time [s] of the motion."""
        return Poses(*self._bodies.poses(time, self._soles(time)))

    def posture(self, time: float) -> np.ndarray:
        """Return (nq,) its posture at a time [s] of the motion."""
        self._bodies.at(time, self._soles(time))
        return self._bodies.posture

    def _soles(self, time: float) -> Any:
        """Where its soles are."""
        if self._footing is None:
            return self._stance
        (origin, turn), sample = self._frame, self._footing.sample(time)
        points = origin + sample.places[:, 0] @ turn.T
        turns = Rotation.from_rotvec(sample.turns[:, 0]).as_matrix()
        axes = turn @ turns  # of standing they are the world's
        return self._stance._replace(points=points, axes=axes)


class GhostBodies:
    """The bodies of postures that can only be seen, from where the robot stood at its reset."""

    def __init__(self, clip: RobotClip, robot: Robot):
        self._clip, self._robot, self._data = clip, robot, mujoco.MjData(robot.model)

    def __call__(self, time: float) -> Poses:
        """Return their poses at a time [s]; the motion repeats after the last frame."""
        self._data.qpos[:] = self._clip.qpos[round(time / self._clip.dt) % len(self._clip.qpos)]
        mujoco.mj_kinematics(self._robot.model, self._data)
        return Poses(self._data.xpos.copy(), self._data.xquat.copy())


def ghost_of(env: BalanceEnv) -> Ghost | None:
    """Return the ghost of the motion in an environment that has just been reset.

    None where there is no motion, or it only stands.
    """
    motion = getattr(env, "motion", None)
    if not isinstance(motion, ReferenceMotion) or not motion.moves:
        return None
    return Ghost(motion, env)
