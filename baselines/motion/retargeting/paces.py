"""Steps of a clip on a robot: when each foot lifts off and lands, and where."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.foot_steps import STANDING
from poise.baselines.balance.references.footing import root_turns, stances_of
from poise.baselines.balance.references.footwork import FootPlan
from poise.baselines.balance.references.legs import foot_signs, nominal_feet
from poise.baselines.balance.references.robot_clip import RATE
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.contacts import grounded, longest_flight, measure_contacts
from poise.baselines.motion.clips.skeleton import SIDES
from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.easing import ease
from poise.envs.robots.robot import Robot

from .targets import low_pass
from .tracks import Tracks

BOTH = 0.1  # [s] on both feet between two steps, at least
EARLY = 0.2  # [s] by which a sole lifts off before the toes of the clip do, whose heel is up then
SWING = 0.4  # [s] of a step whose begin or end the clip does not show
FLIGHT = 0.07  # [s] with both feet off the ground: longer is a run or a jump
LOWEST, HIGHEST = 0.05, 0.15  # [h] of the way of a foot over the ground at its highest
DIP, MOST_DIP = 0.5, 0.35  # of its height that a foot's toes dip in swing; the turn [rad]
LEANING = 1.0  # [Hz] of the low-pass on what the trunk leans: faster, the ZMP cannot be borne
SWINGING = 1.5  # [Hz] of that on trunk and arms
MARGIN = 0.005  # [rad] that these keep from their limits
BEFORE, AFTER = STANDING, 1.6  # [s] of standing before the first and after the last step, at least
TURN = 300.0  # [°] that a motion may turn: rotation vectors of a whole turn have no axis


class ClipStep(NamedTuple):
    """A step: foot (0 left, 1 right), lift-off and touchdown [s], the end of the stance after it
    [s], and how high the foot gets [m], in the clip's sizes; with no end it steps beside the
    other."""

    foot: int
    lift: float
    land: float
    end: float | None
    apex: float

    def at_speed(self, factor: float) -> ClipStep:
        """The step `factor` > 0 times as fast."""
        end = None if self.end is None else self.end / factor
        return self._replace(lift=self.lift / factor, land=self.land / factor, end=end)


def find_paces(clip: Clip) -> list[ClipStep]:
    """The steps of a clip, in order.

    A foot lands when its heel or toe begins to rest, and lifts off when both have begun to move,
    but no sooner than 0.1 s after the other one has landed: a robot's soles are flat, a person's
    are not.

    Raises:
        ConfigError: no foot is planted in the first frame, or none is for 0.07 s; no step.
    """
    planted = grounded(measure_contacts(clip).planted, clip.dt)
    first, time = longest_flight(planted, clip.dt)
    if time > FLIGHT or not planted[0].any():
        raise ConfigError(
            f"both feet are off the ground for {time:.2f} s at {first * clip.dt:.2f} s: no "
            "controller flies", source=clip.name, field="feet",
        )  # fmt: skip
    turned = np.degrees(np.ptp(np.unwrap(clip.facing())))
    if turned > TURN:
        raise ConfigError(f"turns by {turned:.0f}°: at most {TURN:.0f}° can be performed",
                          source=clip.name, field="heading")  # fmt: skip
    places, found = clip.places(), []
    for foot, side in enumerate(SIDES):
        heights = places[:, clip.skeleton.joint(f"ankle_{side}", clip.name), 2]
        stances = stances_of(planted[:, foot])
        low = float(heights[planted[:, foot]].mean()) if len(stances) else 0.0
        for k, (a, b) in enumerate(stances):
            if a == 0 or (len(planted) - a) * clip.dt < BOTH:  # the clip shows no step's end
                continue
            left = stances[k - 1][1] if k else max(a - round(SWING / clip.dt), 0)
            apex = float(heights[left : a + 1].max()) - low
            found.append(ClipStep(foot, left * clip.dt, a * clip.dt, b * clip.dt, apex))
    found.sort(key=lambda pace: pace.land)
    if not found:
        why = "its feet move, but take no step"
        for foot in np.flatnonzero(~planted[-1]).tolist():
            down = np.flatnonzero(planted[:, foot])
            why = f"its {SIDES[foot]} foot does not land"
            if down.size:
                why = (f"its {SIDES[foot]} foot lifts off at {down[-1] * clip.dt:.2f} s and does "
                       "not land again")  # fmt: skip
        raise ConfigError(why, source=clip.name, field="feet")
    return _in_turn(found)


def _in_turn(found: list[ClipStep]) -> list[ClipStep]:
    """Steps one after the other, and a last one that puts the foot behind beside the other one."""
    period = float(np.median(np.diff([pace.land for pace in found]))) if len(found) > 2 else 0.6
    last = found[-1]
    end = last.land + max(period, SWING + BOTH)
    paces = [*found, ClipStep(1 - last.foot, last.land, end, None, last.apex)]
    made, before = [], -np.inf
    for pace in paces:
        lift = max(pace.lift - EARLY, before + BOTH)
        if before == -np.inf:
            lift = min(lift, pace.land - SWING)
        before = max(pace.land, lift + 0.5 * SWING)
        made.append(pace._replace(lift=lift, land=before))
    return made


def plan_paces(
    paces: list[ClipStep], tracks: Tracks, qpos: np.ndarray, robot: Robot, lead: int, scale: float,
    low: float, swinging: float = SWINGING,
) -> FootPlan:  # fmt: skip
    """The plan of a clip's steps for a robot.

    Args:
        paces: of the clip.
        tracks: where it leads the soles; of its rests in the stances only.
        qpos: (F, nq) in its frames: trunk, arms and the root's turn, and the legs as a guess.
        robot: with two feet.
        lead: frames from standing into the clip, and back.
        scale: of the robot's legs over the clip's.
        low: height of the CoM from first to last step, over that of standing.
        swinging: low-pass on trunk and arms [Hz].
    """
    begin = frames_before(paces, lead)
    frames = max(begin + len(qpos) + lead, begin + round((paces[-1].land + AFTER) / RATE))
    times = [tuple(begin + round(t / RATE) for t in (p.lift, p.land)) for p in paces]
    left, h = int(np.argmax(foot_signs(robot))), robot.height_com
    nominal = nominal_feet(robot) * [1.0, 1.0, 0.0]
    goals = _goals(paces, tracks, nominal, left)
    places = np.repeat(nominal[None], frames, axis=0)
    yaws, tips = np.zeros((frames, 2)), np.zeros((frames, 2))
    planted = np.ones((frames, 2), dtype=bool)
    for pace, (a, b), (place, yaw) in zip(paces, times, goals, strict=True):
        foot = left if pace.foot == 0 else 1 - left
        apex = float(np.clip(scale * pace.apex, LOWEST * h, HIGHEST * h))
        u = np.linspace(0.0, 1.0, b - a + 1)[:, None]
        way, up = ease(u), hump(u[:, 0])
        places[a : b + 1, foot] += way * (place - places[a, foot])
        places[a : b + 1, foot, 2] += apex * up
        tip = min(DIP * apex / (0.5 * float(np.ptp(robot.soles[foot].polygon[:, 0]))), MOST_DIP)
        tips[a : b + 1, foot] = tip * up
        yaws[a : b + 1, foot] += way[:, 0] * (yaw - yaws[a, foot])
        places[b:, foot], yaws[b:, foot] = place, yaw
        planted[a + 1 : b, foot] = False
    turns = Rotation.from_euler("ZY", np.stack([yaws, tips], axis=2).reshape(-1, 2)).as_rotvec()
    lean = root_turns(robot, qpos)
    lean[:, :2] = low_pass(lean[:, :2], LEANING)
    root = led(lean, np.zeros(3), np.array([0.0, 0.0, yaws[-1].mean()]),
                lead, begin, frames)  # fmt: skip
    joints = calm_joints(robot, qpos, lead, begin, frames, swinging)
    return FootPlan(RATE, joints, root, _heights(frames, times, h, low), places,
                    turns.reshape(frames, 2, 3), planted)  # fmt: skip


def _goals(
    paces: list[ClipStep], tracks: Tracks, nominal: np.ndarray, left: int
) -> list[tuple[np.ndarray, float]]:
    """Where each step lands: the sole's point (3,) on the ground [m], and its heading [rad].

    The foot that stands in the first frame is where it stands as the robot does.
    """
    stands = int(np.argmax([np.flatnonzero(~np.append(each, False))[0]
                            for each in tracks.planted.T]))  # fmt: skip
    origin = tracks.soles[0, stands] - nominal[stands]
    goals: list[tuple[np.ndarray, float]] = []
    latest = {foot: (nominal[foot], 0.0) for foot in range(2)}
    for pace in paces:
        foot = left if pace.foot == 0 else 1 - left
        if pace.end is None:
            place, yaw = latest[1 - foot]
            beside = Rotation.from_rotvec([0.0, 0.0, yaw]).apply(nominal[foot] - nominal[1 - foot])
            goals.append((place + beside, yaw))
            continue
        own = slice(*(min(round(t / RATE), len(tracks.yaws) - 1) for t in (pace.land, pace.end)))
        own = slice(own.start, max(own.stop, own.start + 1))
        place = np.median(tracks.soles[own, foot], axis=0) - origin
        goals.append((place * [1.0, 1.0, 0.0], float(np.median(tracks.yaws[own, foot]))))
        latest[foot] = goals[-1]
    return goals


def led(
    values: np.ndarray, first: np.ndarray, last: np.ndarray, lead: int, begin: int, frames: int
) -> np.ndarray:
    """Return values (F, m) of a clip that begins in a frame, blended from `first` and to `last`
    (m,) in `lead` frames, which are held."""
    way = ease(np.arange(lead)[:, None] / lead)
    into, back = first + way * (values[0] - first), last + way[::-1] * (values[-1] - last)
    before, after = begin - lead, frames - begin - len(values) - lead
    return np.concatenate([np.repeat(first[None], before, axis=0), into, values, back,
                           np.repeat(last[None], after, axis=0)])  # fmt: skip


def calm_joints(
    robot: Robot, qpos: np.ndarray, lead: int, begin: int, frames: int, cutoff: float = SWINGING
) -> np.ndarray:
    """Return joints (F, nj) of a clip's postures, low-pass filtered and within their limits,
    blended from and to standing."""
    standing, (least, most) = robot.standing_qpos[7:], (robot.joint_range + [MARGIN, -MARGIN]).T
    calm = np.clip(low_pass(qpos[:, 7:], cutoff), least, most)
    return led(calm, standing, standing, lead, begin, frames)


def frames_before(paces: list[ClipStep], lead: int) -> int:
    """How many frames of standing a clip has before it, `lead` of them at least."""
    return max(round((BEFORE - paces[0].lift) / RATE), lead)


def hump(u: np.ndarray) -> np.ndarray:
    """From 0 to 1 at u = 0.45 and back, C² and at rest at both ends."""
    up, down = np.clip(u / 0.45, 0.0, 1.0), np.clip((1.0 - u) / 0.55, 0.0, 1.0)
    return ease(np.minimum(up, down))


def _heights(frames: int, times: list[tuple[int, ...]], h: float, low: float) -> np.ndarray:
    """(F,) of the CoM: lower from half a second before the first step until after the last [m]."""
    k = np.arange(frames) * RATE
    down = np.clip((k - times[0][0] * RATE + 0.7) / 0.7, 0.0, 1.0)
    up = np.clip((times[-1][1] * RATE + 0.7 - k) / 0.7, 0.0, 1.0)
    return np.asarray(h * (1.0 - (1.0 - low) * ease(np.minimum(down, up))))
