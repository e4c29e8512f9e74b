"""The end of an episode: by a fall, or once the robot is quiet again."""

from dataclasses import dataclass, field

import mujoco
import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.kinematics import StateArrays


@dataclass(frozen=True)
class FallLimits:
    """The limits beyond which a robot has fallen, and within which it is quiet again.

    Attributes:
        height: Height of the CoM below which the robot has fallen, over that of standing.
        tilt: Tilt of the root beyond which it has fallen [deg]; a deep bow, the hip strategy at its
            end, is not yet a fall.
        ground_contact: Whether anything but the feet on the ground is a fall.
        terminates: Whether a fall ends the episode; False: the robot may get up again.
        quiet_speed: Speed of the CoM below which the robot is quiet [m/s].
        quiet_tilt: Tilt of the root below which it is quiet [deg].
        quiet_time: Time for which it must be quiet at the end to have recovered [s].
        quiet_slide: Most that a sole moves in that time [m]: recoveries of the default humanoid
            stay below 1 mm.
    """

    height: float = field(default=0.6, metadata={"above": 0.0, "max": 1.0})
    tilt: float = field(default=90.0, metadata={"above": 0.0, "max": 180.0})
    ground_contact: bool = True
    terminates: bool = field(default=True, metadata={"omit": "default"})
    quiet_speed: float = field(default=0.1, metadata={"above": 0.0})
    quiet_tilt: float = field(default=30.0, metadata={"above": 0.0, "max": 90.0})
    quiet_time: float = field(default=1.0, metadata={"above": 0.0})
    quiet_slide: float = field(default=0.01, metadata={"min": 0.0, "omit": "default"})


@dataclass(frozen=True, eq=False)
class Limits(Block):
    """The limits of an episode as compiled code reads them."""

    height: float  # [m]
    cos_tilt: float
    ground_contact: bool
    terminates: bool
    quiet_speed: float  # [m/s]
    quiet_cos_tilt: float
    quiet_slide: float  # [m]
    quiet_steps: int  # policy steps in a row that must be quiet
    max_steps: int  # of an episode


def episode_limits(
    limits: FallLimits, height_com: float, max_steps: int, quiet_steps: int
) -> Limits:
    """Numbers for compiled code; `height_com` [m] is that of the standing robot."""
    return Limits(
        height=limits.height * height_com,
        cos_tilt=float(np.cos(np.radians(limits.tilt))),
        ground_contact=limits.ground_contact,
        terminates=limits.terminates,
        quiet_speed=limits.quiet_speed,
        quiet_cos_tilt=float(np.cos(np.radians(limits.quiet_tilt))),
        quiet_slide=limits.quiet_slide,
        quiet_steps=quiet_steps,
        max_steps=max_steps,
    )


@compiled
def uprightness(robot: RobotArrays, s: StateArrays) -> float:
    """Cosine of the root's tilt from standing: between its vertical axes, whatever the yaw."""
    upright = 0.0
    for a in range(3):
        upright += s.root_axes[2, a] * robot.root_standing[2, a]
    return upright


@compiled
def has_fallen(robot: RobotArrays, s: StateArrays, limits: Limits) -> bool:
    """CoM too low, root tilted too far, or more than the feet on the ground."""
    low = s.com[2] - s.origin[2] < limits.height
    touching = limits.ground_contact and s.other_contacts > 0.5
    # not np.isfinite(x + y): x + y − (x + y), reordered, is 0 for NaN too
    finite = abs(s.com[2]) < np.inf and abs(s.com_vel[2]) < np.inf
    return low or uprightness(robot, s) < limits.cos_tilt or touching or not finite


BAD_STATE = tuple(
    2 * int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{name}")) for name in ("QPOS", "QVEL", "QACC")
)


@compiled
def has_diverged(views: SimViews) -> bool:
    """Return whether the state diverged since the reset; MuJoCo then resets by itself."""
    for i in BAD_STATE:
        if views.warnings[i] > 0:
            return True
    return False
