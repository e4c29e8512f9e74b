"""What a pendulum does not know of the body, fed back to the choices of a step.

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
from dataclasses import dataclass, field, fields

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import apart
from poise.envs.physics.arrays import robot_arrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

AHEAD, OUTWARD, TIME, HEIGHT = range(4)


@dataclass(frozen=True)
class SignalGains:
    """Gains of one choice, each for a signal without unit.

    Attributes:
        constant: for 1.
        again: for 1 in all steps but the first.
        phase: for the share of the swing that is over.
        capture_ahead, capture_outward: for ξ from the stance sole, in h.
        lean_ahead, lean_outward: for the horizontal part of the root's axis that stands at rest.
        spin_ahead, spin_outward: for ω L/(m g h), L the angular momentum that turns the body there.
    """

    constant: float = 0.0
    again: float = 0.0
    phase: float = 0.0
    capture_ahead: float = 0.0
    capture_outward: float = 0.0
    lean_ahead: float = 0.0
    lean_outward: float = 0.0
    spin_ahead: float = 0.0
    spin_outward: float = 0.0


SIGNALS = tuple(signal.name for signal in fields(SignalGains))


@dataclass(frozen=True)
class StepFeedback:
    """The rows of K: foothold ahead and outward [h], time from lift-off to touchdown [1/ω], height
    of the CoM in a swing [h].
    """

    ahead: SignalGains = field(default_factory=SignalGains)
    outward: SignalGains = field(default_factory=SignalGains)
    time: SignalGains = field(default_factory=SignalGains)
    height: SignalGains = field(default_factory=SignalGains)

    def matrix(self) -> np.ndarray:
        """K (4, 9)."""
        rows = (self.ahead, self.outward, self.time, self.height)
        return np.array([[getattr(row, name) for name in SIGNALS] for row in rows])


@dataclass(frozen=True)
class FallFeedback(StepFeedback):
    """What is added to K in the first step of a fall, `angle` [°] from the heading to either side.

    Gains of `again`, which is 0 there, do nothing.
    """

    angle: float = field(kw_only=True, metadata={"min": 0.0, "max": 180.0})


@dataclass(frozen=True, eq=False)
class FeedbackArrays(Block):
    """K for one robot, and what it gives now."""

    always: np.ndarray  # (4, 9) K in m and s
    angles: np.ndarray  # (n,) [rad] rising
    added_at: np.ndarray  # (n, 4, 9) what is added to K there
    gains: np.ndarray  # (4, 9) K of the running step
    upright: np.ndarray  # (3,) the vertical at rest, in the root's axes
    height: float  # h [m]
    spin: float  # [1/(N·m·s)] of an angular momentum: ω/(m g h)
    stage: np.ndarray  # (2,) signals `again` and `phase`
    signals: np.ndarray  # (9,) s
    added: np.ndarray  # (4,) Δ [m, m, s, m]


def feedback_arrays(
    robot: Robot, always: StepFeedback, falls: Mapping[str, FallFeedback]
) -> FeedbackArrays:
    """Both scaled by the robot's mass and height."""
    h, rate = robot.height_com, robot.omega
    units = np.array([h, h, 1.0 / rate, h])
    rising, size = sorted(falls.values(), key=lambda fall: fall.angle), (4, len(SIGNALS))
    law, gains, angles = apart(size), apart(size), apart(len(rising))
    added_at = apart((len(rising), *size))
    law[:] = gains[:] = units[:, None] * always.matrix()
    for k, fall in enumerate(rising):
        angles[k], added_at[k] = np.radians(fall.angle), units[:, None] * fall.matrix()
    upright, spin = robot_arrays(robot).root_standing[2].copy(), rate / robot.units.moment
    return FeedbackArrays(
        law, angles, added_at, gains, upright, float(h), float(spin),
        apart(2), apart(len(SIGNALS)), apart(4),
    )  # fmt: skip


@compiled
def take_gains(f: FeedbackArrays, ahead: float, left: float):
    """K of a step in a fall along this direction."""
    n, low, share = f.angles.shape[0], 0, 0.0
    first = n > 0 and f.stage[0] == 0.0
    if n > 1 and first:
        angle = np.arctan2(abs(left), ahead)
        while low < n - 2 and angle > f.angles[low + 1]:
            low += 1
        share = (angle - f.angles[low]) / (f.angles[low + 1] - f.angles[low])
        share = min(max(share, 0.0), 1.0)
    for i in range(f.gains.shape[0]):
        for k in range(f.gains.shape[1]):
            f.gains[i, k] = f.always[i, k]
            if first:
                f.gains[i, k] += (1.0 - share) * f.added_at[low, i, k]
            if share > 0.0:
                f.gains[i, k] += share * f.added_at[low + 1, i, k]


@compiled
def feed_back(
    f: FeedbackArrays, s: StateArrays, stance: np.ndarray, cos: float, sin: float, side: float
):
    """Signals of a step beside the sole at `stance` (3,), along a heading; and what they add."""
    told, up_x, up_y = f.signals, 0.0, 0.0
    for a in range(3):
        up_x += s.root_axes[0, a] * f.upright[a]
        up_y += s.root_axes[1, a] * f.upright[a]
    x, y = s.capture_point[0] - stance[0], s.capture_point[1] - stance[1]
    turn_x, turn_y = s.momentum[4], -s.momentum[3]  # where it turns the body to
    told[0], told[1], told[2] = 1.0, f.stage[0], f.stage[1]
    told[3], told[4] = (cos * x + sin * y) / f.height, side * (cos * y - sin * x) / f.height
    told[5], told[6] = cos * up_x + sin * up_y, side * (cos * up_y - sin * up_x)
    told[7] = f.spin * (cos * turn_x + sin * turn_y)
    told[8] = f.spin * side * (cos * turn_y - sin * turn_x)
    for i in range(f.gains.shape[0]):
        total = 0.0
        for k in range(told.shape[0]):
            total += f.gains[i, k] * told[k]
        f.added[i] = total
