"""A motion with steps, or a walk, is tried before it is taken."""

from collections.abc import Callable

import numpy as np

from poise.baselines.balance.references.robot_clip import RobotClip, reference_from
from poise.baselines.motion.retargeting.retarget import Holds, Rehearsed
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

from .follow import follow

STARTS, SEED = 16, 1  # of a trial; figures are of other seeds


def rehearsal(robot: Robot, said: Callable[[str], None] | None = None) -> Holds:
    """Return `holds` of `retarget_clip`, by a few disturbed starts; the first failure ends them.

    `said` is called with a line before every trial.
    """

    def holds(clip: RobotClip, controller: str) -> Rehearsed:
        if said is not None:
            said(f"trying it: {controller}, {STARTS} starts")
        try:
            reference = reference_from(clip, robot, clip.about.name)
        except ConfigError:
            return Rehearsed(0.0)
        trials = follow(reference, controller, robot=robot, starts=STARTS, seed=SEED, patient=False)
        fine = [not (trial.fallen or trial.interruptions > 0) for trial in trials]
        kept = float(np.mean([trial.footsteps_kept for trial in trials]))
        return Rehearsed(
            1.0 if all(fine) else fine.index(False) / STARTS, 1.0 if np.isnan(kept) else kept
        )

    return holds
