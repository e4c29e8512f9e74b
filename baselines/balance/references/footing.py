"""Where CoM, root and soles are in a motion whose feet leave the ground, and which are planted."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.interpolate import PPoly
from scipy.spatial.transform import Rotation

from poise.configs.errors import ConfigError
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.runs import runs_of
from poise.envs.compiled.maths.vectors import copy_into, rotation_vector
from poise.envs.robots.robot import Robot
from poise.envs.robots.soles import sole_pose

from .splines import evaluate, piecewise, rest_spline

COLUMNS = 20  # of `Footing.coeffs`, see `name_columns`
CREEP = 0.01  # [m] by which a planted sole may be elsewhere than in the middle of its stance
FLAT = 0.05  # [rad] by which it may be turned from there
LIGHT = 0.7  # [m g] of the force on the ground: where it is less, the ZMP says nothing
FREELY = 0.2  # of g: largest deviation of the CoM's acceleration from free fall in flight
BRIEF = 3  # least frames of a swing, and of a contact


class FootingSample(NamedTuple):
    """A motion at one time, in its own frame: z up from the ground, x ahead where it begins.

    Rows of the arrays are position, velocity and acceleration [m, rad, s].
    """

    com: np.ndarray  # (3, 3)
    root: np.ndarray  # (3, 3) rotation vector φ: R = exp(φ) R_standing
    places: np.ndarray  # (2, 3, 3) of the soles' points
    turns: np.ndarray  # (2, 3, 3) rotation vectors of the soles from where they are in standing
    planted: np.ndarray  # (2,) bool


@dataclass(frozen=True, eq=False)
class Footing(Copyable):
    """The contacts of a motion: C² curves of CoM, root and soles, and the planted soles.

    A planted sole rests. From lift-off to touchdown it follows a spline that begins and ends at
    rest.

    Attributes:
        knots: (k+1,) [s]; coeffs: (k, 4, 20), see `splines.piecewise` and `name_columns`. δ is how
            far c − c̈/ω² is from the ZMP: L̇, turned by a right angle, over m (g + c̈_z) [m].
        switches: (n,) rising times [s] at which the planted soles change.
        planted: (n+1, 2) int: 1 where a sole is, before the first of these times, between them,
            and after the last.
    """

    knots: np.ndarray
    coeffs: np.ndarray
    switches: np.ndarray
    planted: np.ndarray

    def sample(self, t: float) -> FootingSample:
        """The motion at time t [s]."""
        rows, (com, root), offset = np.zeros((3, COLUMNS)), np.zeros((2, 3, 3)), np.zeros((3, 2))
        places, turns = np.zeros((2, 2, 3, 3))
        evaluate(self.knots, self.coeffs, False, t, rows[0], rows[1], rows[2])
        name_columns(rows, com, root, places, turns, offset)
        planted = self.planted[np.searchsorted(self.switches, t, side="right")] > 0
        return FootingSample(com, root, places, turns, planted)

    def at_speed(self, factor: float) -> Footing:
        """The contacts of the motion `factor` > 0 times as fast; δ is its square times as large."""
        coeffs = self.coeffs * float(factor) ** np.arange(self.coeffs.shape[1])[:, None]
        coeffs[:, :, -2:] *= factor**2
        return Footing(self.knots / factor, coeffs, self.switches / factor, self.planted)


@compiled
def name_columns(
    rows: np.ndarray,
    com: np.ndarray,
    root: np.ndarray,
    places: np.ndarray,
    turns: np.ndarray,
    momentum_offset: np.ndarray,
):
    """Copy rows (3, 20) of position, velocity and acceleration into arrays by what they are of:
    c (3, 3), φ (3, 3), place and turn of either sole (2, 3, 3) each, then δ (3, 2)."""
    for r in range(3):
        row = rows[r]
        copy_into(row[0:3], com[r])
        copy_into(row[3:6], root[r])
        for foot in range(2):
            sole = row[6 + 6 * foot : 12 + 6 * foot]
            copy_into(sole[0:3], places[foot, r])
            copy_into(sole[3:6], turns[foot, r])
        copy_into(row[18:20], momentum_offset[r])


def check_planted(planted: np.ndarray, source: str) -> None:
    """Raise ConfigError unless `planted` (F, 2) says of every frame which soles are planted.

    Both are at the begin and at the end, none is for less than 3 frames, and one does not land as
    the other one lifts off.
    """
    if not (planted[0].all() and planted[-1].all()):
        raise ConfigError("both soles must be planted at the begin and at the end",
                          source=source, field="contacts")  # fmt: skip
    alone = planted.sum(axis=1) == 1
    hops = alone[1:] & alone[:-1] & np.any(planted[1:] != planted[:-1], axis=1)
    if hops.any():
        raise ConfigError(
            f"in frame {int(np.argmax(hops)) + 1} one sole lands as the other one lifts off: both "
            f"must be planted for {BRIEF} frames between", source=source, field="contacts",
        )  # fmt: skip
    for foot in range(2):
        changes = np.flatnonzero(np.diff(planted[:, foot].astype(int))) + 1
        if any(b - a < BRIEF for a, b in pairwise([0, *changes, len(planted)])):
            raise ConfigError(f"a contact or swing lasts less than {BRIEF} frames",
                              source=source, field="contacts")  # fmt: skip


def sole_poses(robot: Robot, qpos: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """CoM (F, 3), places (F, 2, 3) of the soles' points [m], and their turns (F, 2, 3) [rad].

    Heights are over the ground on which the robot stands.
    """
    data, frames = mujoco.MjData(robot.model), len(qpos)
    com, places, turns = np.empty((frames, 3)), np.empty((frames, 2, 3)), np.empty((frames, 2, 3))

    def put(q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        data.qpos[:] = q
        mujoco.mj_kinematics(robot.model, data)
        mujoco.mj_comPos(robot.model, data)
        return [sole_pose(data, sole) for sole in robot.soles]

    standing = put(robot.standing_qpos)
    ground = np.mean([point for point, _ in standing], axis=0) * [0.0, 0.0, 1.0]
    for k, q in enumerate(qpos):
        for i, (point, axes) in enumerate(put(q)):
            places[k, i] = point - ground
            turns[k, i] = rotation_vector(axes @ standing[i][1].T)
        com[k] = data.subtree_com[robot.root_body_id] - ground
    for i in range(len(robot.soles)):
        turns[:, i] = unwound(turns[:, i])
    return com, places, turns


def make_footing(
    robot: Robot, qpos: np.ndarray, dt: float, planted: np.ndarray, source: str
) -> Footing:
    """The footing of postures `qpos` (F, nq) with `planted` (F, 2) soles, `dt` [s] apart.

    Raises:
        ConfigError: see `check_planted`; a planted sole that moves by 1 cm or turns by 3°, or is
            not flat on the ground; a CoM that does not fall freely where no sole is planted.
    """
    check_planted(planted, source)
    times = np.arange(len(qpos)) * dt
    com, places, turns = sole_poses(robot, qpos)
    root = root_turns(robot, qpos)
    curves = [rest_spline(times, com), rest_spline(times, root)]
    _check_falls(robot, times, com[:, 2], planted, source)
    for foot in range(2):
        down = planted[:, foot]
        _check_rest(times, places[:, foot], turns[:, foot], down, source)
        curves += [_stepped(times, values[:, foot], down) for values in (places, turns)]
    curves.append(rest_spline(times, momentum_offset(robot, qpos, dt)))
    knots, coeffs = piecewise(curves)
    changes = np.flatnonzero(np.any(np.diff(planted.astype(int), axis=0), axis=1)) + 1
    # a sole lifts off at its last planted frame, and is down at its first one
    falls = np.array([bool((planted[k - 1] & ~planted[k]).any()) for k in changes])
    moments = times[np.where(falls, changes - 1, changes)]
    rows = np.concatenate([planted[:1], planted[changes]]).astype(np.int64)
    return Footing(knots, coeffs, moments, rows)


def momentum_offset(robot: Robot, qpos: np.ndarray, dt: float) -> np.ndarray:
    """(F, 2) by how much c − (h/(g + c̈_z)) c̈ is further than the ZMP, for L̇ of the body [m]."""
    times = np.arange(len(qpos)) * dt
    com, spin = np.empty((len(qpos), 3)), np.empty((len(qpos), 3))
    data, model, velocity = mujoco.MjData(robot.model), robot.model, np.empty(robot.model.nv)
    for k in range(len(qpos)):
        a, b = max(k - 1, 0), min(k + 1, len(qpos) - 1)
        mujoco.mj_differentiatePos(model, velocity, (b - a) * dt, qpos[a], qpos[b])
        data.qpos[:], data.qvel[:] = qpos[k], velocity
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        com[k] = data.subtree_com[robot.root_body_id]
        spin[k] = data.subtree_angmom[robot.root_body_id]
    lift = rest_spline(times, com[:, 2:])(times, 2)[:, 0] + robot.units.gravity
    moment = rest_spline(times, spin)(times, 1) / robot.mass
    borne = lift > LIGHT * robot.units.gravity  # else no ZMP
    lift = np.where(borne, lift, np.inf)
    return np.asarray(np.column_stack([moment[:, 1], -moment[:, 0]]) / lift[:, None])


def root_turns(robot: Robot, qpos: np.ndarray) -> np.ndarray:
    """(F, 3) rotation vectors of the root from where it is in standing, without jumps [rad]."""
    both = Rotation.from_quat(np.roll(qpos[:, 3:7], -1, axis=1))
    standing = Rotation.from_quat(np.roll(robot.standing_qpos[3:7], -1))
    return unwound((both * standing.inv()).as_rotvec())


def unwound(turns: np.ndarray) -> np.ndarray:
    """Rotation vectors (F, 3) of the same rotations without jumps, so longer than π for more than
    half a turn [rad]."""
    out = turns.copy()
    for k in range(1, len(out)):
        angle = float(np.linalg.norm(out[k]))
        if angle > 1.0:
            axis = out[k] / angle
            out[k] += 2.0 * np.pi * np.round((out[k - 1] - out[k]) @ axis / (2.0 * np.pi)) * axis
    return out


def stances_of(down: np.ndarray) -> list[tuple[int, int]]:
    """First and last frame of every time that a sole is planted."""
    return [(first, after - 1) for first, after in runs_of(down).tolist()]


def _check_falls(
    robot: Robot, times: np.ndarray, height: np.ndarray, planted: np.ndarray, source: str
) -> None:
    """Raise ConfigError unless the CoM falls freely while no sole is planted."""
    flies = np.asarray(~planted.any(axis=1))
    inside = np.flatnonzero(flies[:-2] & flies[1:-1] & flies[2:]) + 1
    bends = (height[inside + 1] - 2.0 * height[inside] + height[inside - 1]) / times[1] ** 2
    wrong = inside[np.abs(bends + robot.units.gravity) > FREELY * robot.units.gravity]
    if len(wrong) or (flies.any() and not len(inside)):
        time = times[wrong[0] if len(wrong) else int(np.argmax(flies))]
        raise ConfigError(f"no sole is planted at {time:.2f} s, but the centre of mass does not "
                          "fall freely", source=source, field="contacts")  # fmt: skip


def _check_rest(
    times: np.ndarray, places: np.ndarray, turns: np.ndarray, down: np.ndarray, source: str
) -> None:
    for first, last in stances_of(down):
        own = slice(first, last + 1)
        away = np.linalg.norm(places[own] - np.median(places[own], axis=0), axis=1)
        away = np.maximum(away, np.abs(places[own, 2]))
        tilt = np.linalg.norm(turns[own] * [1.0, 1.0, 0.0], axis=1)
        for values, most, what in ((away, CREEP, "moves"), (tilt, FLAT, "is not flat")):
            if values.max() > most:
                raise ConfigError(
                    f"a planted sole {what} at {times[first + int(np.argmax(values))]:.2f} s",
                    source=source, field="contacts",
                )  # fmt: skip


def _stepped(times: np.ndarray, values: np.ndarray, down: np.ndarray) -> PPoly:
    """A curve (F, m) that rests at its mean while the sole is planted, and is C² between."""
    stances = stances_of(down)
    rests = [values[a : b + 1].mean(axis=0) for a, b in stances]
    breaks: list[float] = [float(times[0])]
    parts: list[np.ndarray] = []
    for k, (a, b) in enumerate(stances):
        if b > a:
            constant = np.zeros((4, 1, values.shape[1]))
            constant[3, 0] = rests[k]
            breaks, parts = [*breaks, times[b]], [*parts, constant]
        if k + 1 < len(stances):
            end = stances[k + 1][0]
            through = values[b : end + 1].copy()
            through[0], through[-1] = rests[k], rests[k + 1]
            knots, coeffs = piecewise([rest_spline(times[b : end + 1], through)])
            breaks = [*breaks, *knots[1:]]
            parts.append(coeffs[:, ::-1].transpose(1, 0, 2))
    return PPoly(np.concatenate(parts, axis=1), np.array(breaks))
