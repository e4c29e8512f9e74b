"""Targets of one tick from a reference motion and a residual, compiled."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into, rotated
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .reference_motion import ReferenceMotion
from .splines import evaluate
from .tempo import Pace, Tempo, make_pace, slow_down

"""The order of what may be added to a controller's choices: one table for all that use it.

Offsets of targets come first, see `update_targets`; those of steps follow, see `StepOffsets` in
`stepping/controller.py`. Horizontal ones are along the axes of a heading.
"""

NAMES = (
    "com_x", "com_y",  # of the CoM [m]
    "cop_x", "cop_y",  # of the CoP [m]
    "com_z",  # [m]
    "lean_x", "lean_y",  # rotation of the root [rad]
    "momentum_x", "momentum_y",  # angular momentum that the posture carries [N·m·s]
    "foothold_x", "foothold_y",  # [m]
    "time",  # from lift-off to touchdown [s]
    "trigger",  # how much further the capture point may leave before a step [m]
)  # fmt: skip
COM_X, COM_Y, COP_X, COP_Y, COM_Z, LEAN_X, LEAN_Y, MOMENTUM_X, MOMENTUM_Y = range(9)
FOOTHOLD_X, FOOTHOLD_Y, TIME, TRIGGER = range(9, 13)
TARGETS = NAMES[:FOOTHOLD_X]  # those of a controller with feet fixed
STEPS = NAMES[FOOTHOLD_X:]


@dataclass(frozen=True, eq=False)
class Motion(Block):
    """A reference motion as compiled code reads it."""

    knots: np.ndarray
    coeffs: np.ndarray
    loop: bool
    samples: Annotated[np.ndarray, 3, "nj+6"]  # scratch: position, velocity and acceleration
    pace: Pace


def motion_arrays(
    motion: ReferenceMotion, tempo: Tempo | None = None, height: float = 1.0
) -> Motion:
    """The block of `motion`, with scratch and a memory of its own; `height` is h [m]."""
    return Motion.allocate(
        {"nj": motion.coeffs.shape[2] - 6}, knots=motion.knots, coeffs=motion.coeffs,
        loop=motion.loop, pace=make_pace(tempo or Tempo(), height),
    )  # fmt: skip


@compiled
def update_targets(
    robot: RobotArrays,
    s: StateArrays,
    motion: Motion,
    time: float,
    com_offset: float,
    residual: np.ndarray,
    t: TargetArrays,
):
    """Fill `t` for the motion's `time` [s]: its joints and CoM, moved by the residual.

    Heading frame: the motion's CoM is relative to the mean of the sole points, `com_offset` [m]
    forward of it; p_ref lies under it. `residual` (≥ 9,), in the order of `TARGETS`, adds
    Δc_ref (x, y) and Δp_ref (x, y) [m], the CoM's height [m], a lean of the root, a rotation about
    the axes x and y [rad], and the angular momentum that the posture is to carry about x and y
    [N·m·s].
    The root's reference is R = R_heading exp(φ) R_standing; its rate R_heading φ̇ is exact while φ
    keeps its axis, as it does in every motion that bows or leans.
    """
    nj, samples = t.q_ref.shape[0], motion.samples
    evaluate(motion.knots, motion.coeffs, motion.loop, time, samples[0], samples[1], samples[2])
    slow_down(motion.pace, samples)
    copy_into(samples[0], t.q_ref)
    copy_into(samples[1], t.v_ref)
    copy_into(samples[2], t.a_ref)
    cos, sin = s.heading[0], s.heading[1]
    samples[0, nj + 3] += residual[LEAN_X]
    samples[0, nj + 4] += residual[LEAN_Y]
    root_reference(robot, cos, sin, samples[:, nj + 3 : nj + 6], t)
    middle_x, middle_y = samples[0, nj] + com_offset, samples[0, nj + 1]
    x, y = middle_x + residual[COM_X], middle_y + residual[COM_Y]
    t.com[0] = s.origin[0] + cos * x - sin * y
    t.com[1] = s.origin[1] + sin * x + cos * y
    t.com[2] = s.origin[2] + samples[0, nj + 2] + residual[COM_Z]
    for r in range(2):
        out = t.com_vel if r == 0 else t.com_acc
        x, y = samples[1 + r, nj], samples[1 + r, nj + 1]
        out[0] = cos * x - sin * y
        out[1] = sin * x + cos * y
        out[2] = samples[1 + r, nj + 2]
    t.angular_momentum[0] = cos * residual[MOMENTUM_X] - sin * residual[MOMENTUM_Y]
    t.angular_momentum[1] = sin * residual[MOMENTUM_X] + cos * residual[MOMENTUM_Y]
    x, y = middle_x + residual[COP_X], middle_y + residual[COP_Y]
    t.cop[0] = s.origin[0] + cos * x - sin * y
    t.cop[1] = s.origin[1] + sin * x + cos * y


@compiled
def root_reference(
    robot: RobotArrays, cos: float, sin: float, samples: np.ndarray, t: TargetArrays
) -> None:
    """Root axes, and angular velocity and acceleration in body axes, from φ, φ̇, φ̈."""
    phi = samples[0]
    angle = np.sqrt(phi[0] ** 2 + phi[1] ** 2 + phi[2] ** 2)
    x, y, z = 0.0, 0.0, 0.0
    if angle > 1e-12:
        x, y, z = phi[0] / angle, phi[1] / angle, phi[2] / angle
    c, s = np.cos(angle), np.sin(angle)
    for a in range(3):  # each standing axis, then the heading's yaw
        w0, w1, w2 = rotated(x, y, z, c, s, robot.root_standing[:, a])
        t.root_axes[0, a] = cos * w0 - sin * w1
        t.root_axes[1, a] = sin * w0 + cos * w1
        t.root_axes[2, a] = w2
    for r in range(2):
        rate = samples[1 + r]
        out = t.root_vel if r == 0 else t.root_acc
        w0, w1, w2 = cos * rate[0] - sin * rate[1], sin * rate[0] + cos * rate[1], rate[2]
        for a in range(3):
            out[a] = t.root_axes[0, a] * w0 + t.root_axes[1, a] * w1 + t.root_axes[2, a] * w2
