"""The postures of a whole clip, for constraints to be evaluated in."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np

from poise.baselines.motion.retargeting.limbs import (
    Limbs,
    LimbVector,
    Placed,
    Point,
    sole_corners,
)
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot

SIDES = ("left", "right")
COM = "com"


class CentreOfMass(NamedTuple):
    """The CoM of the whole robot."""

    root: int

    def place(self, data: mujoco.MjData) -> np.ndarray:
        """(3,) in the world [m]."""
        return data.subtree_com[self.root].copy()

    def jacobian(self, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
        """(3, nv)."""
        jacobian = np.empty((3, model.nv))
        mujoco.mj_jacSubtreeCom(model, data, jacobian, self.root)
        return jacobian


class ConstraintRows(NamedTuple):
    """k rows low ≤ f ≤ high, with the derivative of f by the postures of some frames.

    Attributes:
        parts: frame → (k, nv) ∂f/∂δ, δ the displacement of that frame's posture.
        value: (k,) f now.
        low, high: (k,) bounds, infinite where there is none.
        shared: f is relative to k unknowns more, which all rows of the constraint share.
    """

    parts: dict[int, np.ndarray]
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    shared: bool = False

    @property
    def excess(self) -> np.ndarray:
        """(k,) by how much f is beyond its bounds; 0 within them."""
        return np.maximum(np.maximum(self.low - self.value, self.value - self.high), 0.0)


class Scene:
    """Postures at equal times, and which soles are planted then.

    Time is the clip's: 0 in its first frame. What leads from and to standing is before and after.

    Attributes:
        qpos: (F, nq); a solver moves them.
        dt: time between frames [s].
        times: (F,) [s].
        duration: of the clip [s].
        planted: (F, 2) by the order of the robot's soles.
        planted_corners: (F, 2, k, 3) where their corners are to be while planted [m]: where the
            robot stands, unless others are set. A sole of fewer corners has its last one again.
        standing_feet: (2, 3) places [m] and (2, 4) orientations, wxyz, of the feet's bodies as the
            robot stands.
        sides: the index of the left and the right sole.
    """

    def __init__(
        self, robot: Robot, limbs: Limbs, qpos: np.ndarray, dt: float, lead: float,
        planted: np.ndarray,
    ):  # fmt: skip
        self.robot, self.model, self.limbs = robot, robot.model, limbs
        self.data = mujoco.MjData(robot.model)
        self.qpos, self.dt, self.planted = qpos.copy(), dt, planted
        before = max(round(lead / dt), 1)
        self.times = (np.arange(len(qpos)) - before) * dt
        self.duration = float(self.times[-1 - before])
        self._at = -1
        self.see(robot.standing_qpos)
        feet = [sole.body_id for sole in robot.soles]
        self.standing_feet = self.data.xpos[feet], self.data.xquat[feet]
        order = np.argsort([-self.data.xpos[sole.body_id][1] for sole in robot.soles])
        self.sides = dict(zip(SIDES, order.tolist(), strict=True))
        padded = np.array([self.padded_corners(i) for i in range(len(robot.soles))])
        self.planted_corners = np.tile(padded, (len(qpos), 1, 1, 1))

    def see(self, qpos: np.ndarray) -> mujoco.MjData:
        """Kinematics of a posture (nq,)."""
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        self._at = -1
        return self.data

    def at(self, frame: int) -> mujoco.MjData:
        """Kinematics of a frame."""
        if self._at != frame:
            self.see(self.qpos[frame])
            self._at = frame
        return self.data

    def move(self, qpos: np.ndarray) -> None:
        """Take other postures (F, nq)."""
        self.qpos, self._at = qpos, -1

    def displace(self, frame: int, delta: np.ndarray) -> None:
        """Move the posture of one frame by δ (nv,), the root's turn in its own axes."""
        mujoco.mj_integratePos(self.model, self.qpos[frame], np.ascontiguousarray(delta), 1.0)
        self._at = -1

    def point(self, name: str, field: str) -> Placed:
        """What has this name: a limb's role, ``com``, or a body; ConfigError names the choices."""
        if name == COM:
            return CentreOfMass(self.robot.root_body_id)
        if name in self.limbs.points:
            return self.limbs.points[name]
        return Point(((self.body(name, field, (COM, *self.limbs.points)), np.zeros(3)),))

    def between(self, name: str, to: str | None) -> Placed:
        """The point of a name, from another one if that is named; their fields: point and to."""
        point = self.point(name, "point")
        return point if to is None else LimbVector(point, self.point(to, "to"))

    def body(self, name: str, field: str, others: Iterable[str] = ()) -> int:
        """The body of this name; ConfigError names the choices."""
        names = [self.model.body(i).name for i in range(1, self.model.nbody)]
        if name not in names:
            raise ConfigError(f"the robot {self.robot.name!r} has no {name!r}", field=field,
                              choices=(*others, *names))  # fmt: skip
        return names.index(name) + 1

    def corners(self, foot: int) -> np.ndarray:
        """(k, 3) corners of a sole in the posture that was seen last [m]."""
        return sole_corners(self.robot, self.data, foot)

    def padded_corners(self, foot: int) -> np.ndarray:
        """(k, 3) the same, the last one again up to the number of corners of the other sole."""
        most = max(len(sole.polygon) for sole in self.robot.soles)
        corners = self.corners(foot)
        return corners[np.minimum(np.arange(most), len(corners) - 1)]

    def part(self, frames: np.ndarray) -> Scene:
        """A scene of some of the frames (k,), whose `dt` is their mean distance."""
        part = copy.copy(self)
        part.data = mujoco.MjData(self.model)
        part.qpos, part.times = self.qpos[frames].copy(), self.times[frames]
        part.planted, part._at = self.planted[frames], -1
        part.planted_corners = self.planted_corners[frames]
        part.dt = float(part.times[-1] - part.times[0]) / (len(frames) - 1)
        return part

    def __len__(self) -> int:
        return len(self.qpos)
