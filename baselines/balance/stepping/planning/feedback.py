"""Feedback of the trunk's rotation, which a pendulum omits, to the choices of a step.

A pendulum's capture point says where the fall can be stopped as if the trunk stood still. How it
leans and turns moves the foothold, the time and the height of the CoM by a linear law

    Δ = K s,   Δ = (ahead, outward, time, height)

with the signals s of `SIGNALS`. Outward is to the swinging foot's own side, so that left and right
are alike. A step to the side is not one ahead that has been turned: hips spread less than they
swing, and the other leg is in the way. So K of the first step of a fall may depend on where to,

    K = K_always + Σ w_i(θ) K_i

with θ from the heading to the CoM's velocity at lift-off and w linear between the angles of the
`FallFeedback`s: gains are scheduled.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block, named_entries
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along, turned
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

from .config import FallFeedback, PivotConfig, StepFeedback


@dataclass(eq=False)
class Signals(Block):
    """The signals s in the order of `SIGNALS`: `values`, and each by its name."""

    values: np.ndarray  # (9,)
    constant: Mutable[float]
    later_step: Mutable[float]  # kernels that plan set this one and `phase`
    phase: Mutable[float]
    capture_ahead: Mutable[float]
    capture_outward: Mutable[float]
    lean_ahead: Mutable[float]
    lean_outward: Mutable[float]
    momentum_ahead: Mutable[float]
    momentum_outward: Mutable[float]


@dataclass(eq=False)
class Changes(Block):
    """Δ = K s in the order of the rows of K: `values`, and each by its name."""

    values: np.ndarray  # (4,)
    ahead: Mutable[float]  # [m]
    outward: Mutable[float]  # [m]
    time: Mutable[float]  # [s]
    height: Mutable[float]  # [m]


@dataclass(frozen=True, eq=False)
class Pivot(Block):
    """Gains of the point about which the trunk turns, see `PivotConfig`."""

    momentum: float  # [m/(N·m·s)]
    lean: float  # [m]


@dataclass(frozen=True, eq=False)
class FeedbackArrays(Block):
    """K of a `StepFeedback` for one robot, the signals s, and Δ = K s."""

    always: Annotated[np.ndarray, 4, 9]  # K in m and s
    angles: Annotated[np.ndarray, "n"]  # directions of falls, rising [rad]
    added_at: Annotated[np.ndarray, "n", 4, 9]  # what is added to K there
    gains: Annotated[np.ndarray, 4, 9]  # K of the running step
    upright: np.ndarray  # (3,) the vertical at rest, in the root's axes
    height: float  # h [m]
    momentum_unit: float  # ω/(m g h) [1/(N·m·s)]
    plan: Pivot  # of a plan
    swing: Pivot
    stance: Pivot  # on both feet
    lateral_fraction: float  # of these across the heading
    signals: Signals  # s
    added: Changes  # Δ


def feedback_arrays(
    robot: Robot, always: StepFeedback, falls: Mapping[str, FallFeedback], pivot: PivotConfig
) -> FeedbackArrays:
    """K for one robot: gains that hold always, and those that `falls` add in a first step."""
    h, omega = robot.height_com, robot.omega
    units = np.array([h, h, 1.0 / omega, h])
    rising = sorted(falls.values(), key=lambda fall: fall.angle)
    unit = h * omega / robot.units.moment
    pivots = {
        name: Pivot(float(row.momentum * unit), float(row.lean * h))
        for name, row in (("plan", pivot.plan), ("swing", pivot.swing), ("stance", pivot.stance))
    }
    made = FeedbackArrays.allocate(
        {"n": len(rising)}, **pivots, signals=Signals(*named_entries(Signals)),
        added=Changes(*named_entries(Changes)), height=float(h),
        upright=robot_arrays(robot).root_standing[2].copy(),
        momentum_unit=float(omega / robot.units.moment), lateral_fraction=pivot.lateral_fraction,
    )  # fmt: skip
    made.always[:] = made.gains[:] = units[:, None] * always.matrix()
    for k, fall in enumerate(rising):
        made.angles[k], made.added_at[k] = np.radians(fall.angle), units[:, None] * fall.matrix()
    return made


@compiled
def schedule_gains(f: FeedbackArrays, ahead: float, left: float) -> None:
    """Set K to that of a step in a fall along (ahead, left)."""
    n, low, blend = f.angles.shape[0], 0, 0.0
    first = n > 0 and f.signals.later_step == 0.0
    if n > 1 and first:
        angle = np.arctan2(abs(left), ahead)
        while low < n - 2 and angle > f.angles[low + 1]:
            low += 1
        blend = (angle - f.angles[low]) / (f.angles[low + 1] - f.angles[low])
        blend = min(max(blend, 0.0), 1.0)
    for i in range(f.gains.shape[0]):
        for k in range(f.gains.shape[1]):
            f.gains[i, k] = f.always[i, k]
            if first:
                f.gains[i, k] += (1.0 - blend) * f.added_at[low, i, k]
            if blend > 0.0:
                f.gains[i, k] += blend * f.added_at[low + 1, i, k]


@compiled
def lean(f: FeedbackArrays, s: StateArrays) -> tuple[float, float]:
    """e, the horizontal part of the root's axis that stands at rest."""
    x, y = 0.0, 0.0
    for a in range(3):
        x += s.root_axes[0, a] * f.upright[a]
        y += s.root_axes[1, a] * f.upright[a]
    return x, y


@compiled
def pivot_offset(
    f: FeedbackArrays, s: StateArrays, pivot: Pivot, cos: float, sin: float
) -> tuple[float, float]:
    """r of one of the pivots of `f` [m], see `PivotConfig`; of a step along a heading."""
    turn, tilt = pivot.momentum, pivot.lean
    if turn == 0.0 and tilt == 0.0:
        return 0.0, 0.0
    x, y = lean(f, s)
    x, y = tilt * x + turn * s.momentum[4], tilt * y - turn * s.momentum[3]
    ahead, left = along(cos, sin, x, y)
    return turned(cos, sin, ahead, f.lateral_fraction * left)


@compiled
def evaluate_feedback(
    f: FeedbackArrays, s: StateArrays, stance: np.ndarray, cos: float, sin: float, side: float
) -> None:
    """Δ = K s of a step beside the sole at `stance` (3,) along a heading; `side` is 1 for the left
    foot. The signals `later_step` and `phase` are those of the last plan."""
    signals = f.signals
    up_x, up_y = lean(f, s)
    x, y = along(cos, sin, s.capture_point[0] - stance[0], s.capture_point[1] - stance[1])
    lean_x, lean_y = along(cos, sin, up_x, up_y)
    turn_x, turn_y = along(cos, sin, s.momentum[4], -s.momentum[3])  # where it turns the body to
    signals.constant = 1.0
    signals.capture_ahead, signals.capture_outward = x / f.height, side * y / f.height
    signals.lean_ahead, signals.lean_outward = lean_x, side * lean_y
    signals.momentum_ahead = f.momentum_unit * turn_x
    signals.momentum_outward = f.momentum_unit * side * turn_y
    for i in range(f.gains.shape[0]):
        total = 0.0
        for k in range(signals.values.shape[0]):
            total += f.gains[i, k] * signals.values[k]
        f.added.values[i] = total
