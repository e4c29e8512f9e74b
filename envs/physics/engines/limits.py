"""MuJoCo's law of joint limits, for an engine that takes it as implicit damping."""

from dataclasses import dataclass

import mujoco
import numpy as np

from poise.envs.robots.robot import Robot

SMALL = 1e-15  # MuJoCo's mjMINVAL
IMPEDANCE = (1e-4, 0.9999)  # between which MuJoCo keeps d


@dataclass
class LimitForces:
    """Joints beyond their limits, and the forces of the limits,

        f = (a* − a)/R,  sign f ≥ 0,

    with a the joint's acceleration of the step in which it acts. So with v the velocity before, v⁺
    after a step Δt, f = (v + a* Δt − v⁺)/(R Δt): a damper, which drags v⁺ to a reference.
    """

    joints: np.ndarray  #: (k,) indices among the joints but for the free one
    sign: np.ndarray  #: (k,) 1: at the lower limit, -1: at the upper one
    regularisation: np.ndarray  #: (k,) R [rad/s² per N·m]
    reference: np.ndarray  #: (k,) a* [rad/s²]

    def some(self, which: np.ndarray) -> "LimitForces | None":
        """Those that a mask (k,) selects; None: it selects none."""
        if not which.any():
            return None
        return LimitForces(self.joints[which], self.sign[which], self.regularisation[which],
                           self.reference[which])  # fmt: skip


class JointLimits:
    """The limits of a robot's joints: R and a* of `solref_limit` and `solimp_limit`.

    R = (1 − d)/d of the joint's inverse inertia in the model's posture, a* = −B v − K d r at the
    depth r: beyond a limit a joint is a mass on a spring and a damper, which carries loads as if it
    had d/(1 − d) times its inertia.
    """

    def __init__(self, robot: Robot):
        model = robot.model
        own = np.flatnonzero(model.jnt_limited)
        self._joints, self._qpos = own - 1, model.jnt_qposadr[own]
        self._dofs, self._range = model.jnt_dofadr[own], model.jnt_range[own].copy()
        self._margin, self._inverse = model.jnt_margin[own], model.dof_invweight0[self._dofs]
        low, high, self._width, self._middle, self._power = model.jnt_solimp[own].T.copy()
        self._low, self._high = np.clip(low, *IMPEDANCE), np.clip(high, *IMPEDANCE)
        time, ratio = model.jnt_solref[own].T
        if not model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE:
            time = np.where(time > 0.0, np.maximum(time, 2.0 * model.opt.timestep), time)
        given = time <= 0.0  # negative: stiffness and damping
        self._stiffness = np.where(
            given, -time / self._high**2, 1.0 / np.maximum(SMALL, (self._high * time * ratio) ** 2)
        )
        self._damping = np.where(
            given, -ratio / self._high, 2.0 / np.maximum(SMALL, self._high * time)
        )

    def beyond(self, qpos: np.ndarray, qvel: np.ndarray) -> LimitForces | None:
        """The limits that joints are beyond; None: no joint is."""
        q = qpos[self._qpos]
        below, above = q - self._range[:, 0], self._range[:, 1] - q
        depth = np.minimum(below, above) - self._margin
        if not (depth < 0.0).any():
            return None
        k = np.flatnonzero(depth < 0.0)
        sign, depth = np.where(below < above, 1.0, -1.0)[k], depth[k]
        d = self._impedance(k, -depth)
        speed = sign * qvel[self._dofs[k]]
        reference = -self._damping[k] * speed - self._stiffness[k] * d * depth
        regularisation = np.maximum(SMALL, (1.0 - d) / d * self._inverse[k])
        return LimitForces(self._joints[k], sign, regularisation, sign * reference)

    def _impedance(self, k: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """d at a depth: from its low to its high value over the width."""
        low, high, middle, power = self._low[k], self._high[k], self._middle[k], self._power[k]
        x = np.minimum(1.0, depth / np.maximum(SMALL, self._width[k]))
        with np.errstate(divide="ignore", invalid="ignore"):
            first = x**power / middle ** (power - 1.0)
            last = 1.0 - (1.0 - x) ** power / (1.0 - middle) ** (power - 1.0)
        y = np.where(power == 1.0, x, np.where(x <= middle, first, last))
        flat = (low == high) | (self._width[k] <= SMALL)
        d: np.ndarray = np.where(flat, 0.5 * (low + high), low + y * (high - low))
        return d
