"""The ghost of a motion: where the robot is if it follows its reference exactly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from poise.baselines.motions.reference_motion import ReferenceMotion
from poise.envs.balance.base import BalanceEnv
from poise.training.tracking.reference import ReferenceBodies, Stance


class Poses(NamedTuple):
    """Where the bodies of a robot are, world axes: (nbody, 3) [m]; (nbody, 4), w first."""

    positions: np.ndarray
    quaternions: np.ndarray


class Ghost:
    """The bodies of a reference motion, whose soles are where the robot stood at its reset."""

    def __init__(self, motion: ReferenceMotion, env: BalanceEnv):
        self._bodies = ReferenceBodies(motion, env.robot)
        self._stance = Stance.of(env.simulation.state)

    def __call__(self, time: float) -> Poses:
        """Where it is at a time [s] after the reset."""
        return Poses(*self._bodies.poses(time, self._stance))


def ghost_of(env: BalanceEnv) -> Ghost | None:
    """The ghost of the motion in an environment that has just been reset.

    None where there is no motion, or it only stands.
    """
    motion = getattr(env, "motion", None)
    if not isinstance(motion, ReferenceMotion) or not motion.moves:
        return None
    return Ghost(motion, env)
