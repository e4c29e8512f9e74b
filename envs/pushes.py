"""Pushes: a force over time on one body, or a velocity kick, and how they reach the simulator.

A push is the horizontal (or elevated) force F(t) on a point of a body, given by its impulse
J = ∫F dt [N·s]. Directions are degrees counter-clockwise from forward in the heading frame:
0 = forward, 90 = left. `pack` turns pushes into a table of numbers; `apply_pushes` and
`apply_kicks` are compiled and write what the table says for one physics step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .errors import ConfigError
from .jit import compiled
from .pendulum import Profile
from .robot import Robot

TABLE_COLUMNS = 12
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


def pack(pushes: Sequence[Push | Kick], robot: Robot, heading_yaw: float) -> np.ndarray:
    """Table (k, 12) for the compiled kernels, one row per push.

    Columns: body id, start, duration, peak world force x y z [N] (of a kick: world Δv [m/s]),
    point x y z in the body frame [m], profile (0 square, 1 half-sine), kind (0 force, 1 kick),
    spare. `heading_yaw` [rad] is the yaw of the heading frame at the reset.
    """
    table = np.zeros((len(pushes), TABLE_COLUMNS))
    cos, sin = np.cos(heading_yaw), np.sin(heading_yaw)
    to_world = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    for row, push in zip(table, pushes, strict=True):
        row[1] = push.start
        if isinstance(push, Kick):
            row[0] = robot.root_body_id
            row[3:6] = push.delta_v * to_world @ unit_vector(push.direction)
            row[10] = 1.0
        else:
            row[0] = robot.model.body(push.body).id
            row[2] = push.duration
            row[3:6] = push.peak_force * to_world @ unit_vector(push.direction, push.elevation)
            row[6:9] = push.point
            row[9] = float(push.profile == "half-sine")
    return table


@compiled
def apply_pushes(table, t, dt, xfrc_applied, xmat):
    """Add the forces active during the step [t, t + dt) to `xfrc_applied` (nbody, 6).

    The force written is the mean over the step, so Σ F dt = J for any start and duration.
    Rows are [force; torque] in the world frame at the body's centre of mass, with
    torque = (R point) × force; `xmat` (nbody, 9) holds R row by row. Clear `xfrc_applied` before.
    """
    for k in range(table.shape[0]):
        if table[k, 10] != 0.0:
            continue
        start, duration = table[k, 1], table[k, 2]
        begin = max(t, start) - start
        end = min(t + dt, start + duration) - start
        if end <= begin:
            continue
        if table[k, 9] == 0.0:
            share = (end - begin) / dt
        else:
            rate = np.pi / duration
            share = (np.cos(rate * begin) - np.cos(rate * end)) / (rate * dt)
        body = int(table[k, 0])
        fx, fy, fz = share * table[k, 3], share * table[k, 4], share * table[k, 5]
        px, py, pz = table[k, 6], table[k, 7], table[k, 8]
        R = xmat[body]
        rx = R[0] * px + R[1] * py + R[2] * pz
        ry = R[3] * px + R[4] * py + R[5] * pz
        rz = R[6] * px + R[7] * py + R[8] * pz
        wrench = xfrc_applied[body]
        wrench[0] += fx
        wrench[1] += fy
        wrench[2] += fz
        wrench[3] += ry * fz - rz * fy
        wrench[4] += rz * fx - rx * fz
        wrench[5] += rx * fy - ry * fx


@compiled
def apply_kicks(table, t, dt, qvel):
    """Add each kick whose start lies in the step [t, t + dt) to the root's velocity `qvel[:3]`.

    Call once per step; `qvel` (nv,) starts with the root's free joint (world frame). Steps are
    counted from t = 0, so that rounding at a step's end neither loses nor doubles a kick.
    """
    step = np.rint(t / dt)
    for k in range(table.shape[0]):
        if table[k, 10] == 1.0 and np.floor(table[k, 1] / dt + 1e-6) == step:
            qvel[0] += table[k, 3]
            qvel[1] += table[k, 4]
            qvel[2] += table[k, 5]


def push_info(push: Push | Kick, robot: Robot) -> dict[str, Any]:
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
