"""A motion whose feet leave the ground, with a centre of mass that the soles on it can bear."""

from typing import NamedTuple

import numpy as np
import scipy  # loads its parts when they are first asked for
from scipy.linalg import solve_banded
from scipy.spatial.transform import Rotation

from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease
from poise.envs.physics.legs import standing_data
from poise.envs.robots.robot import Robot

from .footing import LIGHT, momentum_offset, stances_of
from .legs import PlantedLegs, bearing_polygon, nominal_feet
from .postures import most_beyond
from .splines import rest_spline

SHIFT = 0.8  # [s] that the ZMP takes from one foot to the other at most
# how often the CoM is moved for what the limbs do to the ZMP; and of these how often the
# root rolls where a leg's joint is at its limit
ROUNDS, ROLLING = 6, 4
MARGIN = 0.02  # [rad] that joints of legs keep from their limits
LEAD = 0.5  # [s] in which the CoM is blended to rest at both ends
FLOATS = 0.02  # [m g] of the force on the ground, at least: in flight the CoM goes straight
SOFT = 0.1  # [s] over which turns of the root are smoothed
ROLLED, MOST_ROLL = 0.4, 0.1  # least rate of a joint that the root's roll helps; the roll [rad]
AWAY, AWAY_BOTH = 0.04, 0.1  # [m] that the ZMP may be from where it is planned; and on both soles,
# which bear it anywhere between them
UNREACHED = 2e-3  # [m, rad] that a sole or the CoM may be off
#: steps in which the CoM is lowered where legs do not reach [m], and the time to either side over
#: which that grows [s]
SINK, SINKING = 0.005, 0.25


class NotReached(ConfigError):
    """A plan that lacks a little, or much: `by` [m, rad]."""

    def __init__(self, message: str, by: float, source: str):
        super().__init__(message, source=source, field="feet")
        self.by = by


class FootPlan(NamedTuple):
    """What a motion asks of a robot in F frames, but for its legs and where its CoM goes.

    Attributes:
        dt: time between frames [s].
        joints: (F, nj) of which those of the legs are a first guess [rad].
        root: (F, 3) rotation vector φ of the root from standing [rad].
        height: (F,) of the CoM over the ground [m].
        places: (F, 2, 3) of the soles' points, over the ground [m]; turns: (F, 2, 3) of the soles
            from where they are in standing [rad].
        planted: (F, 2) bool.
    """

    dt: float
    joints: np.ndarray
    root: np.ndarray
    height: np.ndarray
    places: np.ndarray
    turns: np.ndarray
    planted: np.ndarray


def com_over(zmp: np.ndarray, share: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """(n, m) c of c − s Δ²c = p: a pendulum over its ZMP p (n, m), at `begin` and `end` (m,).

    `share` (n,) is s = h/((g + c̈_z) Δt²); a tridiagonal system, which has no unstable direction
    since both ends are given.
    """
    bands = np.zeros((3, len(share)))
    bands[1] = 1.0 + 2.0 * share
    bands[0, 2:], bands[2, :-2] = -share[1:-1], -share[1:-1]
    bands[1, [0, -1]] = 1.0
    right = zmp.copy()
    right[0], right[-1] = begin, end
    return np.asarray(solve_banded((1, 1), bands, right))


def plan_zmp(robot: Robot, plan: FootPlan, rest: np.ndarray) -> np.ndarray:
    """(F, 2) the ZMP: in the middle of what one sole bears, between on both, at `rest` in the end.

    `rest` (2,) is the CoM of standing from the middle of the soles [m]. On both soles it goes from
    one to the next by α(u) = 10u³ − 15u⁴ + 6u⁵, in the last 0.8 s before a foot lifts off and the
    first 0.8 s after it is down.
    """
    middles = [bearing_polygon(robot, i, 1.0, 0.95).mean(axis=0) for i in range(2)]
    frames, out = len(plan.planted), np.empty((len(plan.planted), 2))

    def over(foot: int, k: int) -> np.ndarray:
        turn = Rotation.from_rotvec(plan.turns[k, foot]).as_matrix()[:2, :2]
        return np.asarray(plan.places[k, foot, :2] + turn @ middles[foot])

    both = np.asarray(plan.planted.all(axis=1))
    flies = np.asarray(~plan.planted.any(axis=1))
    out[flies] = plan.places[flies, :, :2].mean(axis=1) + rest
    for k in np.flatnonzero(~both & ~flies):
        out[k] = over(int(np.argmax(plan.planted[k])), int(k))
    for a, last in stances_of(both):
        b = last + 1
        middle = plan.places[a, :, :2].mean(axis=0) + rest
        before = middle if a == 0 else out[a - 1]
        after = middle
        if b < frames:
            after = out[b] if flies[b] else over(int(np.argmax(plan.planted[b])), b)
        length = round(SHIFT / plan.dt)
        if b - a <= 2 * length and a > 0 and b < frames:
            out[a:b] = before + _eased(b - a) * (after - before)
            continue
        out[a:b] = middle
        count = min(length, b - a)
        if a > 0:
            out[a : a + count] = before + _eased(count) * (middle - before)
        if b < frames:
            out[b - count : b] = middle + _eased(count) * (after - middle)
    return out


def _eased(count: int) -> np.ndarray:
    u = (np.arange(count)[:, None] + 1.0) / (count + 1.0)
    return ease(u)


def perform_plan(robot: Robot, plan: FootPlan, source: str, sink: float = 0.0) -> np.ndarray:
    """(F, nq) postures of a plan: the CoM over its ZMP, and legs that reach their soles.

    Where legs do not reach, the CoM is lower than planned, by up to `sink` [m].

    The CoM c solves c − h/(g + c̈_z) c̈ = p. What the limbs' angular momentum moves the ZMP by is
    then taken off p, and the root rolled where a leg's joint is at its limit, a few times.

    Raises:
        NotReached: a place that the legs cannot reach, a joint out of its range, or limbs whose
            angular momentum takes the ZMP 4 cm from where it is planned.
    """
    if len(plan.height) < 2.0 * LEAD / plan.dt + 2.0:
        raise ConfigError(f"lasts {len(plan.height) * plan.dt:.2f} s: too short for the weight to "
                          "shift", source=source, field="feet")  # fmt: skip
    legs, feet = PlantedLegs(robot), nominal_feet(robot)
    ground = float(feet[:, 2].mean())
    times = np.arange(len(plan.height)) * plan.dt
    standing = standing_data(robot).subtree_com[robot.root_body_id]
    zmp = plan_zmp(robot, plan, standing[:2] - feet.mean(axis=0)[:2])
    gravity, top = robot.units.gravity, plan.height
    wanted, whole, qpos = zmp.copy(), np.empty((0, 3)), np.empty((0, robot.model.nq))
    for k in range(ROUNDS):
        while True:
            vertical = rest_spline(times, plan.height[:, None])(times, 2)[:, 0]
            share = plan.height / np.maximum(gravity + vertical, FLOATS * gravity) / plan.dt**2
            com = _led(com_over(wanted, share, zmp[0], zmp[-1]), int(LEAD / plan.dt))
            whole = np.column_stack([com, plan.height + ground])
            left = sink - (top - plan.height)
            qpos, turns, lacks = _reached(robot, legs, plan, whole, ground, source, left)
            if not lacks.any():
                break
            plan = plan._replace(height=plan.height - _sunk(lacks, plan.dt))
        if k + 1 < ROUNDS:
            wanted = zmp + momentum_offset(robot, qpos, plan.dt)
            if k < ROLLING:
                plan = plan._replace(root=plan.root + _smoothed(turns, SOFT / plan.dt))
    away = np.linalg.norm(real_zmp(robot, qpos, whole - [0.0, 0.0, ground], plan.dt) - zmp, axis=1)
    away = np.nan_to_num(away) * np.where(plan.planted.sum(axis=1) == 1, 1.0, AWAY / AWAY_BOTH)
    if away.max() > AWAY:
        raise NotReached(
            f"the limbs swing too fast: the ZMP is {100 * away.max():.1f} cm from where the soles "
            f"bear it at {times[int(np.argmax(away))]:.2f} s", float(away.max()) - AWAY, source,
        )  # fmt: skip
    frame, joint, beyond = most_beyond(robot, qpos[:, 7:])
    if beyond > 0.0:
        raise NotReached(
            f"joint {robot.joint_names[joint]!r} would be {np.degrees(beyond):.2g}° "
            f"beyond its range at {times[frame]:.2f} s", beyond, source,
        )  # fmt: skip
    return qpos


def real_zmp(robot: Robot, qpos: np.ndarray, com: np.ndarray, dt: float) -> np.ndarray:
    """(F, 2) the ZMP of postures with this CoM (F, 3) over the ground, by m c̈ and L̇ [m]; NaN where
    there is next to no force."""
    times = np.arange(len(qpos)) * dt
    force = rest_spline(times, com)(times, 2) + [0.0, 0.0, robot.units.gravity]
    cmp = com[:, :2] - com[:, 2:] * force[:, :2] / force[:, 2:]
    cmp[force[:, 2] < LIGHT * robot.units.gravity] = np.nan
    return np.asarray(cmp - momentum_offset(robot, qpos, dt))


def _reached(
    robot: Robot, legs: PlantedLegs, plan: FootPlan, com: np.ndarray, ground: float, source: str,
    sink: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Postures (F, nq), rolls (F, 3) of the root that bring the legs into their range, and by how
    much lower, up to `sink` (F,), the CoM (F,) must be for legs to reach [m]."""
    qpos, rest = np.empty((len(com), robot.model.nq)), robot.standing_qpos[7:]
    guess = rest
    turned, lacks = np.zeros((len(com), 3)), np.zeros(len(com))
    low, high = (robot.joint_range[legs.legs] + [MARGIN, -MARGIN]).T
    axes = Rotation.from_rotvec(plan.turns.reshape(-1, 3)).as_matrix().reshape(-1, 2, 3, 3)
    for k, place in enumerate(com):
        soles = [(plan.places[k, i] + [0.0, 0.0, ground], axes[k, i] @ legs.standing_soles[i][1])
                 for i in range(2)]  # fmt: skip
        others = plan.joints[k, legs.others]
        qpos[k], miss = legs.reach_soles(place, plan.root[k], others, guess, soles)
        first = miss
        while miss > UNREACHED and lacks[k] + SINK <= sink[k]:
            lacks[k] += SINK
            lower = place - [0.0, 0.0, lacks[k]]
            for begin in (guess, rest):  # a straight leg does not bend from itself
                qpos[k], miss = legs.reach_soles(lower, plan.root[k], others, begin, soles)
                if miss <= UNREACHED:
                    break
        if miss > UNREACHED:
            raise NotReached(f"the legs cannot reach at {k * plan.dt:.2f} s: {100 * first:.1f} cm "
                             "lack", first, source)  # fmt: skip
        guess = qpos[k, 7:]
        q = guess[legs.legs]
        excess = np.maximum(q - high, 0.0) - np.maximum(low - q, 0.0)
        if (excess != 0.0).any():
            half = 0.5 * plan.root[k, 2]  # about the axis ahead, if φ is a turn θ about z, φ turns
            axis = np.array([np.cos(half), np.sin(half), 0.0])  # along R(θ/2) x
            rolls = legs.sensitivity(plan.root[k])[:, 3:] @ axis
            needed = np.where(np.abs(rolls) > ROLLED, -excess / rolls, 0.0)
            roll = np.clip(needed[np.argmax(np.abs(needed))], -MOST_ROLL, MOST_ROLL)
            turned[k] = roll * axis
    return qpos, turned, lacks


def _sunk(lacks: np.ndarray, dt: float) -> np.ndarray:
    """(F,) at least `lacks`, without corners: what is lacking grows and fades in a quarter second
    before and after."""
    width = SINKING / dt
    wide = scipy.ndimage.maximum_filter1d(lacks, 2 * int(width) + 1)
    return np.asarray(scipy.ndimage.gaussian_filter1d(wide, 0.4 * width, truncate=2.5))


def _smoothed(turns: np.ndarray, width: float) -> np.ndarray:
    """Turns (F, 3) as large as they were at their peaks, without their corners."""
    size = 2 * int(width) + 1
    wide = np.where(
        np.abs(low := scipy.ndimage.minimum_filter1d(turns, size, axis=0))
        > np.abs(high := scipy.ndimage.maximum_filter1d(turns, size, axis=0)), low, high,
    )  # fmt: skip
    return np.asarray(scipy.ndimage.gaussian_filter1d(wide, width, axis=0))


def _led(com: np.ndarray, frames: int) -> np.ndarray:
    """The CoM (F, 2) at rest at both ends, to which it is led over so many frames."""
    u = np.linspace(0.0, 1.0, frames + 1)
    fade = ease(u)[:, None]
    out = com.copy()
    out[: frames + 1] = com[0] + fade * (com[: frames + 1] - com[0])
    out[-frames - 1 :] = com[-1] + fade[::-1] * (com[-frames - 1 :] - com[-1])
    return out
