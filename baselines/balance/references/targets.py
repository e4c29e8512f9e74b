"""Targets of one tick from a reference motion and a residual, compiled."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into, rotated
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays

from .reference_motion import ReferenceMotion
from .splines import evaluate
from .tempo import Pace, Tempo, make_pace, slow_down

#: the order of `Offsets.values`: those of targets come first, see `update_targets`, then of steps
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
TARGETS = NAMES[:9]  # those of a controller with feet fixed
STEPS = NAMES[9:]


@dataclass(eq=False)
class Offsets(Block):
    """The offsets that a policy adds to a controller's choices, in axes of the heading.

    Zeros add nothing. `values` is all of them in the order of `NAMES`; the others are its parts.
    """

    values: np.ndarray  # (13,)
    com: np.ndarray  # (2,) of the CoM; in a step, of where the capture point is to rest [m]
    cop: np.ndarray  # (2,) of the CoP [m]
    height: Mutable[float]  # of the CoM [m]
    lean: np.ndarray  # (2,) of the root about x and y [rad]
    momentum: np.ndarray  # (2,) angular, that the posture carries [N·m·s]
    foothold: np.ndarray  # (2,) [m]
    time: Mutable[float]  # from lift-off to touchdown [s]
    trigger: Mutable[float]  # how much further ξ may leave before a step [m]


def no_offsets() -> Offsets:
    """Offsets of zero."""
    v = guarded_zeros(len(NAMES))
    return Offsets.allocate(
        values=v, com=v[0:2], cop=v[2:4], height=v[4:5], lean=v[5:7], momentum=v[7:9],
        foothold=v[9:11], time=v[11:12], trigger=v[12:13],
    )  # fmt: skip


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
    offsets: Offsets,
    t: TargetArrays,
):
    """Fill `t` for the motion's `time` [s]: its joints and CoM, moved by the offsets.

    Heading frame: the motion's CoM is relative to the mean of the sole points, `com_offset` [m]
    forward of it; p_ref lies under it. The lean of `offsets` is a rotation about the axes x and y.
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
    samples[0, nj + 3] += offsets.lean[0]
    samples[0, nj + 4] += offsets.lean[1]
    root_reference(robot, cos, sin, samples[:, nj + 3 : nj + 6], t)
    middle_x, middle_y = samples[0, nj] + com_offset, samples[0, nj + 1]
    x, y = middle_x + offsets.com[0], middle_y + offsets.com[1]
    t.com[0] = s.origin[0] + cos * x - sin * y
    t.com[1] = s.origin[1] + sin * x + cos * y
    t.com[2] = s.origin[2] + samples[0, nj + 2] + offsets.height
    for r in range(2):
        out = t.com_vel if r == 0 else t.com_acc
        x, y = samples[1 + r, nj], samples[1 + r, nj + 1]
        out[0] = cos * x - sin * y
        out[1] = sin * x + cos * y
        out[2] = samples[1 + r, nj + 2]
    t.angular_momentum[0] = cos * offsets.momentum[0] - sin * offsets.momentum[1]
    t.angular_momentum[1] = sin * offsets.momentum[0] + cos * offsets.momentum[1]
    x, y = middle_x + offsets.cop[0], middle_y + offsets.cop[1]
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
