"""Pushes: a force over time on one body, or a velocity kick.

A push is the horizontal (or elevated) force F(t) on a point of a body, given by its impulse
J = ∫F dt [N·s]. Directions are degrees counter-clockwise from forward in the heading frame:
0 = forward, 90 = left. `table.py` has what compiled code reads of them.
"""

from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.pendulum import Profile
from poise.envs.robots.robot import Robot

LARGEST_FORCE = 1e12  # [N] beyond which numbers overflow


def unit_vector(direction: float, elevation: float = 0.0) -> np.ndarray:
    """Unit vector (3,) in the heading frame, from two angles in degrees."""
    azimuth, rise = np.radians(direction), np.radians(elevation)
    return np.array([np.cos(rise) * np.cos(azimuth), np.cos(rise) * np.sin(azimuth), np.sin(rise)])


@dataclass(frozen=True)
class Push:
    """A force on one body during [start, start + duration].

    square:    F(t) = J/T
    half-sine: F(t) = F_peak sin(π (t − start)/T), F_peak = π J/(2T)
    """

    body: str
    start: float = field(metadata={"min": 0.0})  # [s] after the reset
    duration: float = field(metadata={"above": 0.0})  # T [s]
    impulse: float = field(metadata={"min": 0.0})  # J = ∫F dt [N·s]
    direction: float = field(metadata={"min": -360.0, "max": 360.0})  # [deg], heading frame
    elevation: float = field(default=0.0, metadata={"min": -90.0, "max": 90.0})  # [deg], up
    # offset from the body's centre of mass, in the body frame [m]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    profile: Profile = "square"

    def __post_init__(self):
        if self.duration > 0.0 and self.peak_force > LARGEST_FORCE:
            raise ConfigError(f"its force must be at most {LARGEST_FORCE:g} N", field="impulse")

    @property
    def peak_force(self) -> float:
        """Largest force of the push [N]."""
        mean = self.impulse / self.duration
        return mean if self.profile == "square" else 0.5 * np.pi * mean

    def force(self, t: float | np.ndarray) -> np.ndarray:
        """Force at times t after the reset, shape t.shape + (3,), heading frame [N]."""
        phase = (np.asarray(t, dtype=float) - self.start) / self.duration
        shape = np.ones_like(phase) if self.profile == "square" else np.sin(np.pi * phase)
        magnitude = self.peak_force * np.where((phase >= 0.0) & (phase < 1.0), shape, 0.0)
        return magnitude[..., None] * unit_vector(self.direction, self.elevation)


@dataclass(frozen=True)
class Kick:
    """An instantaneous change of the root's linear velocity, joint velocities unchanged.

    The whole robot gains delta_v, so J/m = delta_v until the ground answers.
    """

    start: float = field(metadata={"min": 0.0})  # [s] after the reset
    delta_v: float = field(metadata={"min": 0.0})  # [m/s]
    direction: float = field(metadata={"min": -360.0, "max": 360.0})  # [deg], heading frame


class PushInfo(TypedDict):
    """A push or a kick, as `info` has it; see `push_info`."""

    start: float
    force: float
    duration: float
    body: str
    direction: float
    impulse: float
    specific_impulse: float


def push_info(push: Push | Kick, robot: Robot) -> PushInfo:
    """start, duration [s], (peak) force [N], body, direction [deg], J [N·s] and J/m [N·s/kg].

    A kick has no force and no duration; its J is the momentum that it gives the whole robot.
    """
    if isinstance(push, Kick):
        force, duration, impulse = 0.0, 0.0, push.delta_v * robot.mass
        body = robot.model.body(robot.root_body_id).name
    else:
        force, duration, impulse = push.peak_force, push.duration, push.impulse
        body = push.body
    return {
        "start": push.start,
        "force": force,
        "duration": duration,
        "body": body,
        "direction": push.direction,
        "impulse": impulse,
        "specific_impulse": impulse / robot.mass,
    }
