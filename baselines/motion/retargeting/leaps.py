"""Jumps with both feet on a robot: when it leaves the ground, for how long, and where it lands."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BPoly
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.footing import stances_of, unwound
from poise.baselines.balance.references.footwork import FootPlan
from poise.baselines.balance.references.legs import nominal_feet
from poise.baselines.balance.references.robot_clip import RATE
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import grounded, measure_contacts
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease
from poise.envs.robots.robot import Robot

from .paces import FLIGHT, calm_joints, hump
from .tracks import Tracks

FINE = 4  # frames of a jump's motion for each of others: pushing off is quick
TOGETHER = 0.15  # [s] between two feet that leave the ground, or land, in one jump
NO_FLIGHT = 0.9  # [s] without a foot on the ground: longer than a jump
#: seconds of flight, and shares of the clip's way and turn, that are tried
FLIGHTS = (0.34, 0.32, 0.28, 0.25, 0.22, 0.2, 0.15, 0.1)
WAYS = (1.0, 0.85, 0.7, 0.5, 0.3, 0.15, 0.0)
STANDS = 0.5  # [s] on the ground between two jumps, at least
PUSH = 0.3  # [s] of pushing off, and of landing, at most
OFF_AT, DEEPEST = 0.965, 0.84  # [h] of the CoM at lift-off; deeper, flat feet bend ankles too far
DEPTH = 0.38  # of v · push by which it goes down first
SWIFTEST = 3.5  # [g] of soles in flight, sideways: faster, legs and their motors fall behind
LEAN = 0.3  # [rad] of the trunk, ahead, while it jumps: hips are behind and ankles bend less
HEADING = 2  # of the entries of `_spots`
CLEAR = 0.012  # [h] that soles rise more than the CoM does
BEFORE, AFTER = 1.0, 1.2  # [s] of standing before the first and after the last push, at least


class Leap(NamedTuple):
    """When both feet are off the ground [s]."""

    lift: float
    land: float


def find_leaps(clip: Clip) -> list[Leap]:
    """The jumps with both feet of a clip, in order; none for one that walks or stands.

    Raises ConfigError for one that runs: one foot swings before the flight.
    """
    planted = grounded(measure_contacts(clip).planted, clip.dt)
    found = []
    for a, last in stances_of(np.asarray(~planted.any(axis=1))):
        b = last + 1
        if (b - a) * clip.dt <= FLIGHT:
            continue
        if (b - a) * clip.dt > NO_FLIGHT:
            raise ConfigError(f"for {(b - a) * clip.dt:.2f} s at {a * clip.dt:.2f} s no foot of it "
                              "is found on the ground, longer than any jump", source=clip.name,
                              field="contacts")  # fmt: skip
        around = round(TOGETHER / clip.dt)
        before, after = planted[max(a - around, 0) : a], planted[b : b + around]
        if a == 0 or b == len(planted):
            raise ConfigError("begins or ends in flight", source=clip.name,
                              field="contacts")  # fmt: skip
        if not (before.any(axis=0).all() and after.any(axis=0).all()):
            raise ConfigError(
                f"runs: it is off the ground for {(b - a) * clip.dt:.2f} s at {a * clip.dt:.2f} s "
                "from one foot, and jumps are performed with both", source=clip.name,
                field="contacts",
            )  # fmt: skip
        found.append(Leap(a * clip.dt, b * clip.dt))
    return found


def tempo_of(leaps: list[Leap], flight: float) -> float:
    """How fast jumps of `flight` [s] can be that leave 0.44 s on the ground between two; 1 at
    most."""
    middles = [0.5 * (leap.lift + leap.land) for leap in leaps]
    return min([1.0, *(np.diff(middles) / (flight + STANDS)).tolist()])


def plan_leaps(
    leaps: list[Leap], tracks: Tracks, qpos: np.ndarray, robot: Robot, lead: int, flight: float,
    way: float,
) -> tuple[FootPlan, int]:  # fmt: skip
    """The plan of a clip's jumps for a robot, and how many frames it has before the clip.

    The CoM goes down, and up until it leaves the ground at g·`flight`/2, for all flights are as
    long. Soles rise with it, and land at `way` of the clip's.

    Args:
        leaps: of the clip.
        tracks: where it leads the soles.
        qpos: (F, nq) in its frames, at `RATE`.
        robot: with two feet.
        lead: frames at `RATE` from standing into the clip, and back.
        flight: its duration [s].
        way: share of the clip's ways and turns.

    Raises ConfigError where soles would have to move faster than legs can.
    """
    dt, h, g = RATE / FINE, robot.height_com, robot.units.gravity
    lead = max(lead, round((BEFORE + PUSH - leaps[0].lift) / RATE))
    last = max(len(qpos) - 1, round((leaps[-1].land + AFTER) / RATE) - lead)
    qpos = np.pad(qpos, ((0, last + 1 - len(qpos)), (0, 0)), mode="edge")
    frames = FINE * (2 * lead + last) + 1
    middles = [0.5 * (leap.lift + leap.land) + lead * RATE for leap in leaps]
    takes = [round((middle - 0.5 * flight) / dt) for middle in middles]
    count = round(flight / dt)
    height = _heights(np.array(takes) * dt, count * dt, frames, dt, h, g)
    nominal = _spots(nominal_feet(robot), np.zeros(2))
    spots, facing = np.repeat(nominal[None], frames, axis=0), np.zeros(frames)
    lifts, planted = np.zeros(frames), np.ones((frames, 2), dtype=bool)
    stances = [0.0, *(leap.land for leap in leaps)]
    ends = [*(leap.lift for leap in leaps), tracks.pelvis.shape[0] * RATE]
    rests = [_spots(*_stance(tracks, a, b)) for a, b in zip(stances, ends, strict=True)]
    rests = [spot - np.pad(rests[0][:2], (0, len(spot) - 2)) for spot in rests]
    u = np.linspace(0.0, 1.0, count + 1)
    for a, spot in zip(takes, rests[1:], strict=True):
        b = a + count
        goal = nominal + way * (spot - nominal)
        spots[a : b + 1] += ease(u)[:, None] * (goal - spots[a])
        spots[b:], planted[a + 1 : b] = goal, False
        soles, _ = _soles(spots[a : b + 1])
        swift = np.linalg.norm(np.diff(soles, 2, axis=0), axis=2).max() / dt**2 / g
        if swift > SWIFTEST:
            far = np.linalg.norm(soles[-1] - soles[0], axis=1).max()
            raise ConfigError(f"a leap of {far:.2f} m in {flight:.2f} s asks {swift:.1f} g of the "
                              f"feet, and legs do {SWIFTEST:g} g", field="feet")  # fmt: skip
        lifts[a : b + 1] = (float(height[a : b + 1].max()) - (OFF_AT - CLEAR) * h) * hump(u)
        early, late = max(a - round(0.5 * PUSH / dt), 0), min(b + round(0.5 * PUSH / dt), frames)
        turn = np.linspace(0.0, 1.0, late - early)
        facing[early:late] += ease(turn) * (goal[HEADING] - facing[early])
        facing[late:] = goal[HEADING]
    flat, yaws = _soles(spots)
    places = np.concatenate([flat, np.repeat(lifts[:, None, None], 2, axis=1)], axis=2)
    coarse = calm_joints(robot, qpos, lead, lead, 2 * lead + len(qpos))
    times, at = np.arange(len(coarse)) * RATE, np.arange(frames) * dt
    joints = np.stack([np.interp(at, times, column) for column in coarse.T], axis=1)
    level = Rotation.from_euler("z", yaws.reshape(-1, 1)).as_rotvec().reshape(frames, 2, 3)
    lean = LEAN * _lean(np.array(takes) * dt, count * dt, frames, dt)
    root = unwound(Rotation.from_euler("ZY", np.column_stack([facing, lean])).as_rotvec())
    return FootPlan(dt, joints, root, height, places, level, planted), FINE * lead


def _stance(tracks: Tracks, begin: float, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Soles (2, 3) [m] and headings (2,) [rad] of a time on the ground."""
    own = slice(round(begin / RATE), max(round(end / RATE), round(begin / RATE) + 1))
    return np.median(tracks.soles[own], axis=0), np.median(tracks.yaws[own], axis=0)


def _lean(takes: np.ndarray, flight: float, frames: int, dt: float) -> np.ndarray:
    """(F,) from 0 to 1 before the first crouch, and back after the last one."""
    t = np.arange(frames) * dt
    into = np.clip((t - takes[0] + PUSH + 0.6) / 0.6, 0.0, 1.0)
    back = np.clip((takes[-1] + flight + PUSH + 0.8 - t) / 0.8, 0.0, 1.0)
    return np.asarray(ease(np.minimum(into, back)))


def _spots(soles: np.ndarray, yaws: np.ndarray) -> np.ndarray:
    """(9,) of soles (2, ≥ 2) and their headings (2,): middle, heading, places and headings from
    there. Shares of these, unlike shares of places, do not bring feet together that turn."""
    middle, heading = soles[:, :2].mean(axis=0), yaws.mean()
    cos, sin = np.cos(heading), np.sin(heading)
    own = (soles[:, :2] - middle) @ np.array([[cos, -sin], [sin, cos]])
    return np.concatenate([middle, [heading], own.ravel(), yaws - heading])


def _soles(spots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Soles (n, 2, 2) and headings (n, 2) of `_spots` (n, 9)."""
    heading, own = spots[:, HEADING], spots[:, HEADING + 1 : -2].reshape(-1, 2, 2)
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    x, y = own[..., 0], own[..., 1]
    turned = np.stack([cos * x - sin * y, sin * x + cos * y], axis=2)
    return spots[:, None, :HEADING] + turned, heading[:, None] + spots[:, -2:]


def _heights(
    takes: np.ndarray, flight: float, frames: int, dt: float, h: float, g: float
) -> np.ndarray:
    """(F,) of the CoM [m]: C², with no force on the ground at lift-off and touchdown."""
    speed, off = 0.5 * g * flight, OFF_AT * h
    gaps = np.diff(takes) - flight
    push = np.minimum(PUSH, 0.5 * np.concatenate([[np.inf], gaps, [np.inf]]))
    low = np.maximum(off - DEPTH * speed * push, DEEPEST * h)
    knots = [(0.0, h, 0.0, 0.0), (takes[0] - push[0] - 0.6, h, 0.0, 0.0)]
    for k, take in enumerate(takes):
        knots += [(take - push[k], low[k], 0.0, 0.0), (take, off, speed, -g),
                  (take + flight, off, -speed, -g),
                  (take + flight + push[k + 1], low[k + 1], 0.0, 0.0)]  # fmt: skip
    knots += [(knots[-1][0] + 0.8, h, 0.0, 0.0), (frames * dt + 1.0, h, 0.0, 0.0)]
    table = np.array(knots)
    table = table[np.append(np.diff(table[:, 0]) > 1e-6, True)]
    return np.asarray(BPoly.from_derivatives(table[:, 0], table[:, 1:])(np.arange(frames) * dt))
