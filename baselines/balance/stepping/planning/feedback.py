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

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import along, turned
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

from .config import FallFeedback, PivotConfig, StepFeedback

# rows of K
AHEAD, OUTWARD, TIME, HEIGHT = range(4)
# its columns, in the order of `SIGNALS`
(
    CONSTANT, LATER_STEP, PHASE, CAPTURE_AHEAD, CAPTURE_OUTWARD,
    LEAN_AHEAD, LEAN_OUTWARD, MOMENTUM_AHEAD, MOMENTUM_OUTWARD,
) = range(9)  # fmt: skip
PLAN, SWING, STANCE = range(3)  # rows of the pivot's gains
LX, LY = 3, 4  # of the centroidal momentum [P; L]


@dataclass(frozen=True, eq=False)
class FeedbackArrays(Block):
    """K of a `StepFeedback` for one robot, the signals s, and Δ = K s; rows as in `feedback.py`."""

    always: Annotated[np.ndarray, 4, 9]  # K in m and s
    angles: Annotated[np.ndarray, "n"]  # directions of falls, rising [rad]
    added_at: Annotated[np.ndarray, "n", 4, 9]  # what is added to K there
    gains: Annotated[np.ndarray, 4, 9]  # K of the running step
    upright: np.ndarray  # (3,) the vertical at rest, in the root's axes
    height: float  # h [m]
    momentum_unit: float  # ω/(m g h) [1/(N·m·s)]
    # of a plan, in a swing, on both feet: momentum [m/(N·m·s)], lean [m]
    pivot: Annotated[np.ndarray, 3, 2]
    lateral_fraction: float  # of these across the heading
    signals: Annotated[np.ndarray, 9]  # s; kernels that plan set LATER_STEP and PHASE
    added: Annotated[np.ndarray, 4]  # Δ [m, m, s, m]


def feedback_arrays(
    robot: Robot, always: StepFeedback, falls: Mapping[str, FallFeedback], pivot: PivotConfig
) -> FeedbackArrays:
    """K for one robot: gains that hold always, and those that `falls` add in a first step."""
    h, omega = robot.height_com, robot.omega
    units = np.array([h, h, 1.0 / omega, h])
    rising = sorted(falls.values(), key=lambda fall: fall.angle)
    made = FeedbackArrays.allocate(
        {"n": len(rising)}, upright=robot_arrays(robot).root_standing[2].copy(), height=float(h),
        momentum_unit=float(omega / robot.units.moment), lateral_fraction=pivot.lateral_fraction,
    )  # fmt: skip
    made.always[:] = made.gains[:] = units[:, None] * always.matrix()
    for k, fall in enumerate(rising):
        made.angles[k], made.added_at[k] = np.radians(fall.angle), units[:, None] * fall.matrix()
    unit = h * omega / robot.units.moment
    for k, row in enumerate((pivot.plan, pivot.swing, pivot.stance)):
        made.pivot[k] = row.momentum * unit, row.lean * h
    return made


@compiled
def schedule_gains(f: FeedbackArrays, ahead: float, left: float) -> None:
    """Set K to that of a step in a fall along (ahead, left)."""
    n, low, blend = f.angles.shape[0], 0, 0.0
    first = n > 0 and f.signals[LATER_STEP] == 0.0
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
    f: FeedbackArrays, s: StateArrays, row: int, cos: float, sin: float
) -> tuple[float, float]:
    """r of a row of `pivot` [m], see `PivotConfig`; of a step along a heading."""
    turn, tilt = f.pivot[row, 0], f.pivot[row, 1]
    if turn == 0.0 and tilt == 0.0:
        return 0.0, 0.0
    x, y = lean(f, s)
    x, y = tilt * x + turn * s.momentum[LY], tilt * y - turn * s.momentum[LX]
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
    turn_x, turn_y = along(cos, sin, s.momentum[LY], -s.momentum[LX])  # where it turns the body to
    signals[CONSTANT] = 1.0
    signals[CAPTURE_AHEAD], signals[CAPTURE_OUTWARD] = x / f.height, side * y / f.height
    signals[LEAN_AHEAD], signals[LEAN_OUTWARD] = lean_x, side * lean_y
    signals[MOMENTUM_AHEAD] = f.momentum_unit * turn_x
    signals[MOMENTUM_OUTWARD] = f.momentum_unit * side * turn_y
    for i in range(f.gains.shape[0]):
        total = 0.0
        for k in range(signals.shape[0]):
            total += f.gains[i, k] * signals[k]
        f.added[i] = total
