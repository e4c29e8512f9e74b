"""Captured and synthesised motion: read, retargeted, joined, made feasible, performed."""

from typing import TYPE_CHECKING

from poise.lazy import lazy

__all__ = [
    "IkGoal",
    "IkOptions",
    "IkResult",
    "InverseKinematics",
    "PosePrior",
    "retarget_clip",
    "solve_ik",
]

if TYPE_CHECKING:
    from poise.baselines.motion.retargeting.inverse_kinematics.goals import (
        IkGoal,
        IkOptions,
        IkResult,
    )
    from poise.baselines.motion.retargeting.inverse_kinematics.prior import PosePrior
    from poise.baselines.motion.retargeting.inverse_kinematics.solve import (
        InverseKinematics,
        solve_ik,
    )
    from poise.baselines.motion.space_time.retarget_clip import retarget_clip
else:
    __getattr__, __dir__ = lazy(__name__, __file__)
