"""Steps of a clip on a robot: when each foot lifts off and lands, and where."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from poise.baselines.balance.references.foot_steps import STANDING
from poise.baselines.balance.references.footing import root_turns
from poise.baselines.balance.references.footwork import FootPlan
from poise.baselines.balance.references.legs import foot_signs, nominal_feet
from poise.baselines.balance.references.robot_clip import RATE
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.baselines.motion.clips.rotations import heading_angle
from poise.baselines.motion.clips.skeleton import SIDES
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease
from poise.envs.robots.robot import Robot

BOTH = 0.1  # [s] on both feet between two steps, at least
SWING = 0.4  # [s] of a step whose begin or end the clip does not show
FLIGHT = 0.25  # [s] with both feet off the ground: longer is a jump
LONGEST = 0.45  # [h] of a step
LOWEST, HIGHEST = 0.05, 0.15  # [h] of the way of a foot over the ground at its highest
DIP, MOST_DIP = 0.5, 0.35  # of its height that a foot's toes dip in the air; the turn [rad]
WALKING = 0.98  # [h] height of the CoM between first and last step
BEFORE, AFTER = STANDING, 1.6  # [s] of standing before the first and after the last step, at least
FAR = 0.3  # [m] a clip whose hips move further faces that way
TURN = 45.0  # [°] that a clip may turn


class Pace(NamedTuple):
    """A step: foot (0 left, 1 right), lift-off and touchdown [s], place (2,) [m], yaw [rad], and
    how high the foot gets [m], in the clip's sizes; without a place it steps beside the other."""

    foot: int
    lift: float
    land: float
    place: np.ndarray | None
    yaw: float
    apex: float


def clip_heading(clip: Clip) -> float:
    """Where a clip goes, or else faces [rad]; raises ConfigError if it turns by more than 45°."""
    way = clip.root[-1] - clip.root[0]
    facing = clip.facing()
    turned = np.degrees(np.ptp(np.unwrap(facing)))
    if turned > TURN:
        raise ConfigError(f"turns by {turned:.0f}°: at most {TURN:.0f}° can be performed yet",
                          source=clip.name, field="heading")  # fmt: skip
    if np.linalg.norm(way[:2]) > FAR:
        return float(heading_angle(way))
    return float(np.median(np.unwrap(facing)))


def find_paces(clip: Clip) -> tuple[list[Pace], np.ndarray]:
    """The steps of a clip along x, in order, and (2,) where the foot that lifts off last at first
    stands in its first frame.

    A foot lands when its toe begins to rest, and lifts off when it begins to move, but no sooner
    than 0.1 s after the other one has landed: a robot's soles are flat, a person's toes are not.

    Raises:
        ConfigError: no foot is planted in the first frame, or none is for 0.25 s.
    """
    planted = measure_contacts(clip).planted
    free = np.flatnonzero(~planted.any(axis=1))
    longest = max((len(run) for run in np.split(free, np.flatnonzero(np.diff(free) > 1) + 1)),
                  default=0) * clip.dt  # fmt: skip
    if longest > FLIGHT or not planted[0].any():
        raise ConfigError("both feet are off the ground" + (f" for {longest:.2f} s" if longest else
                          " at its begin"), source=clip.name, field="feet")  # fmt: skip
    places, headings, heights = _feet(clip)
    found: list[Pace] = []
    for foot in range(2):
        edges = np.diff(np.concatenate([[0], planted[:, foot].astype(int), [0]]))
        begins, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
        low = float(heights[planted[:, foot], foot].mean())
        for k, (a, b) in enumerate(zip(begins, ends, strict=True)):
            if a == 0 or (len(planted) - a) * clip.dt < BOTH:  # the clip shows no step's end
                continue
            left = int(ends[k - 1]) if k else max(int(a) - round(SWING / clip.dt), 0)
            apex = float(heights[left : a + 1, foot].max()) - low
            at, yaw = np.median(places[a : b + 1, foot], axis=0), headings[a : b + 1, foot].mean()
            found.append(Pace(foot, left * clip.dt, a * clip.dt, at, float(yaw), apex))
    found.sort(key=lambda pace: pace.land)
    if not found:
        raise ConfigError("its feet move, but take no step", source=clip.name, field="feet")
    stance = 1 - found[0].foot if planted[0, 1 - found[0].foot] else found[0].foot
    first = np.flatnonzero(~planted[:, stance])
    begin = places[: first[0] if len(first) else None, stance]
    return _in_turn(found), np.median(begin, axis=0)


def _in_turn(found: list[Pace]) -> list[Pace]:
    """Steps one after the other, and a last one that puts the foot behind beside the other one."""
    period = float(np.median(np.diff([pace.land for pace in found]))) if len(found) > 2 else 0.6
    last = found[-1]
    end = last.land + max(period, SWING + BOTH)
    paces = [*found, Pace(1 - last.foot, last.land, end, None, 0.0, last.apex)]
    made, before = [], -np.inf
    for pace in paces:
        lift = max(pace.lift, before + BOTH)
        if before == -np.inf:
            lift = min(lift, pace.land - SWING)
        before = max(pace.land, lift + 0.5 * SWING)
        made.append(pace._replace(lift=lift, land=before))
    return made


def _feet(clip: Clip) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles (F, 2, 2) of the feet [m], headings (F, 2) [rad], heights (F, 2) of ankles [m]."""
    roles, all_places = clip.skeleton.roles, clip.places()
    middles, headings, heights = [], [], []
    for side in SIDES:
        ankle = all_places[:, clip.skeleton.joint(f"ankle_{side}", clip.name)]
        toe = all_places[:, roles[f"toe_{side}"]] if f"toe_{side}" in roles else None
        middles.append(ankle[:, :2] if toe is None else 0.5 * (ankle + toe)[:, :2])
        way = np.tile([1.0, 0.0, 0.0], (len(ankle), 1)) if toe is None else toe - ankle
        headings.append(np.unwrap(np.arctan2(way[:, 1], way[:, 0])))
        heights.append(ankle[:, 2])
    return np.stack(middles, axis=1), np.stack(headings, axis=1), np.stack(heights, axis=1)


def plan_paces(
    clip: Clip, robot: Robot, qpos: np.ndarray, lead: int, scale: float, stride: float
) -> FootPlan:
    """The plan of a clip's steps for a robot.

    Args:
        clip: along x, at `RATE`.
        robot: with two feet.
        qpos: (F, nq) of trunk and arms, from standing to standing; `lead` frames before the clip.
        scale: of the robot's legs over the clip's.
        stride: by which lengths of steps are less than that.
    """
    paces, origin = find_paces(clip)
    before = _longer(paces, lead)
    last = lead + before + round((paces[-1].land + AFTER) / RATE)
    frames = max(before + len(qpos), last)
    whole = np.pad(qpos, ((before, frames - before - len(qpos)), (0, 0)), mode="edge")
    times = [tuple(lead + before + round(t / RATE) for t in (p.lift, p.land)) for p in paces]
    left, h = int(np.argmax(foot_signs(robot))), robot.height_com
    nominal = nominal_feet(robot) * [1.0, 1.0, 0.0]
    middle = np.mean([np.median([p.place[1] for p in paces if p.place is not None and p.foot == f])
                      for f in {p.foot for p in paces if p.place is not None}])  # fmt: skip
    places = np.repeat(nominal[None], frames, axis=0)
    turns, planted = np.zeros((frames, 2, 3)), np.ones((frames, 2), dtype=bool)
    ahead = 0.0
    for pace, (a, b) in zip(paces, times, strict=True):
        foot = left if pace.foot == 0 else 1 - left
        goal, yaw = nominal[foot].copy(), 0.0
        if pace.place is not None:
            ahead = scale * stride * float(pace.place[0] - origin[0])
            side = scale * float(pace.place[1] - middle)
            goal[1] = np.sign(goal[1]) * max(abs(goal[1]), np.sign(goal[1]) * side)
            yaw = float(pace.yaw)
        goal[0] += ahead
        apex = float(np.clip(scale * pace.apex, LOWEST * h, HIGHEST * h))
        u = np.linspace(0.0, 1.0, b - a + 1)[:, None]
        way = ease(u)
        places[a : b + 1, foot] += way * (goal - places[a, foot])
        places[a : b + 1, foot, 2] += apex * _hump(u[:, 0])
        tip = min(DIP * apex / (0.5 * float(np.ptp(robot.soles[foot].polygon[:, 0]))), MOST_DIP)
        turns[a : b + 1, foot, 1] = tip * _hump(u[:, 0])
        turns[a : b + 1, foot, 2] += way[:, 0] * (yaw - turns[a, foot, 2])
        places[b:, foot], turns[b:, foot, 2] = goal, yaw
        planted[a + 1 : b, foot] = False
    return FootPlan(RATE, whole[:, 7:], root_turns(robot, whole), _heights(frames, times, h),
                    places, turns, planted)  # fmt: skip


def frames_before(clip: Clip, lead: int) -> int:
    """How many frames of standing a clip along x has before it, `lead` of them at least."""
    return lead + _longer(find_paces(clip)[0], lead)


def _longer(paces: list[Pace], lead: int) -> int:
    return max(round((BEFORE - paces[0].lift) / RATE) - lead, 0)


def longest_step(clip: Clip, scale: float) -> float:
    """The longest step of a clip along x [m], from one foot to the other, for a robot."""
    paces, origin = find_paces(clip)
    marks = [origin[0], *(pace.place[0] for pace in paces if pace.place is not None)]
    return scale * float(np.abs(np.diff(marks)).max())


def _hump(u: np.ndarray) -> np.ndarray:
    """From 0 to 1 at u = 0.45 and back, C² and at rest at both ends."""
    up, down = np.clip(u / 0.45, 0.0, 1.0), np.clip((1.0 - u) / 0.55, 0.0, 1.0)
    v = np.minimum(up, down)
    return ease(v)


def _heights(frames: int, times: list[tuple[int, ...]], h: float) -> np.ndarray:
    """(F,) of the CoM: lower from half a second before the first step until after the last [m]."""
    k = np.arange(frames) * RATE
    down = np.clip((k - times[0][0] * RATE + 0.7) / 0.7, 0.0, 1.0)
    up = np.clip((times[-1][1] * RATE + 0.7 - k) / 0.7, 0.0, 1.0)
    v = np.minimum(down, up)
    return np.asarray(h * (1.0 - (1.0 - WALKING) * ease(v)))
