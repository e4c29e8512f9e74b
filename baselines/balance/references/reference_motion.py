"""A reference motion in time: joints, centre of mass and root of one robot."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from poise.envs.compiled.copies import Copyable

from .commanded import faster
from .footing import Footing
from .splines import evaluate

STILL = 1e-6  # [rad, m] by which a posture that is held may change


class MotionSample(NamedTuple):
    """A reference motion at one time; nj = nv − 6 joints in dof order.

    The CoM is relative to the mean of the sole points, in the heading frame, so com_offset[2]
    is its height. root is the rotation vector φ from the standing root orientation, in the
    heading frame: R = R_heading exp(φ) R_standing.
    """

    q_ref: np.ndarray  # (nj,) [rad]
    v_ref: np.ndarray
    a_ref: np.ndarray
    com_offset: np.ndarray  # (3,) [m]
    com_vel: np.ndarray
    com_acc: np.ndarray
    root: np.ndarray  # (3,) [rad]
    root_vel: np.ndarray
    root_acc: np.ndarray


@dataclass(frozen=True, eq=False)
class ReferenceMotion(Copyable):
    """A motion of one robot, C² in time, as a table of cubic polynomials.

    Columns of `coeffs` (k, 4, nj+6): joint positions, CoM offset (3), root rotation φ (3); see
    `splines.piecewise` for the layout and `splines.evaluate` for the compiled evaluation. With
    `commands` (n, 5), of the columns START to STEP_TIME, it is what trunk and arms do while the
    robot walks as it is told.
    """

    name: str
    knots: np.ndarray  # (k+1,) [s]
    coeffs: np.ndarray  # (k, 4, nj+6)
    loop: bool
    footing: Footing | None = None  # None: both soles stay planted
    commands: np.ndarray | None = None  # None: it does not walk

    @property
    def duration(self) -> float:
        """Time of the last keyframe [s]."""
        return float(self.knots[-1])

    @property
    def moves(self) -> bool:
        """False for a posture that is held."""
        return bool(np.ptp(self.coeffs[:, 0], axis=0).max() >= STILL)

    def at_speed(self, factor: float) -> "ReferenceMotion":
        """The motion `factor` > 0 times as fast: q(factor t)."""
        powers = float(factor) ** np.arange(self.coeffs.shape[1])
        coeffs = self.coeffs * powers[:, None]
        footing = None if self.footing is None else self.footing.at_speed(factor)
        told = None if self.commands is None else faster(self.commands, factor)
        return ReferenceMotion(self.name, self.knots / factor, coeffs, self.loop, footing, told)

    def sample(self, t: float) -> MotionSample:
        """The reference at time t [s]."""
        out = np.zeros((3, self.coeffs.shape[2]))
        evaluate(self.knots, self.coeffs, self.loop, t, out[0], out[1], out[2])
        joints, com, root = out[:, :-6], out[:, -6:-3], out[:, -3:]
        return MotionSample(*joints, *com, *root)
