"""The join that a robot can do: how long it lasts and how it bends are chosen by physics."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from poise.baselines.balance.references.legs import PlantedLegs
from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.robot_clip import RobotClip
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.robots.robot import Robot

from .apart import check_rates, in_one, stretch_at
from .check import FeasibilityLimits
from .curve import Curve, End, JoinPart, WhyNot
from .shape import Shaper
from .trajectory import PlantedRobot

LEAST, MOST, LENGTHS = 0.2, 2.5, 16  # [s] durations that are tried, evenly in their logarithm
TIME_PRICE = 4.0  # λ of K + λ D [m²/s⁴]
LOWER, HIGHER = 0.02, 0.005  # [m] that the CoM may go beyond both clips
STILL = 4  # frames of standing between two joins


class JoinRefused(PoiseError):
    """There is no way between two motions that the robot can do; the text says why."""


@dataclass(frozen=True, eq=False)
class PhysicalJoin:
    """Two motions in one, and how they are joined.

    Attributes:
        clip: A until it is left, the join, and B from where it is entered.
        left, entered: times of A and of B [s].
        start, end: of the join in the clip [s].
        parts: one, or two with standing between them.
    """

    clip: RobotClip
    left: float
    entered: float
    start: float
    end: float
    parts: tuple[JoinPart, ...]

    @property
    def through_standing(self) -> bool:
        """Whether there was no direct way."""
        return len(self.parts) > 1

    @property
    def coefficient(self) -> float:
        """K of all parts [m²/s³]."""
        return sum(part.coefficient for part in self.parts)


def physical_join(
    robot: Robot,
    before: RobotClip,
    after: RobotClip,
    *,
    leave: float | None = None,
    enter: float = 0.0,
    time_price: float = TIME_PRICE,
    through: bool = True,
    limits: FeasibilityLimits | None = None,
) -> PhysicalJoin:
    """A until `leave`, the cheapest way that a robot can do, and B from `enter`.

    CoM, root and the joints that are no legs follow the curve of the fifth order between both
    states, of duration D and with up to three knots moved; the legs follow from soles that stay
    planted. Chosen is the least K + λ D, D from 0.2 to 2.5 s, that keeps `FeasibilityLimits`;
    within 0.1 s of a cut it may be as bad as the clip is there. If none does with the clips'
    accelerations at the cuts, the curve begins and ends without any. A motion is a C² spline
    through its frames, so the join is C² in any case. B goes on from where A's feet stand.

    Args:
        robot: whose motions they are.
        before, after: A and B; B is taken at the rate of A.
        leave: time of A [s], taken at its nearest frame; None for its end.
        enter: time of B [s].
        time_price: λ [m²/s⁴].
        through: go by the standing posture if there is no direct way.
        limits: what the join has to keep.

    Raises:
        ConfigError: a time outside of its clip, a motion of another robot; a cut in a step, or
            where the feet stand otherwise than in standing, see `stretch_at`.
        JoinRefused: no duration is possible, nor the way by standing.
    """
    last = _frame(before, before.duration if leave is None else leave, "leave")
    first = _frame(after, enter, "enter")
    check_rates(before, after)
    steps = before.planted is not None or after.planted is not None
    enter = first * after.dt if steps else enter
    left, run = stretch_at(robot, before, last, "leave")
    entered, onward = stretch_at(robot, after, first, "enter")
    shaper = make_shaper(robot, before.dt, [left, entered], limits, time_price)
    own_frames = before.qpos[run.start : last + 1, 7:]
    a = shaper.end(left, (last - run.start) * before.dt, own_frames)
    b = _entered(shaper, entered, enter - onward.start * before.dt)
    way = way_between(shaper, a, b, through)
    if isinstance(way, str):
        raise JoinRefused(f"no way from {before.about.name!r} at {last * before.dt:.2f} s to "
                          f"{after.about.name!r} at {enter:.2f} s: {way}")  # fmt: skip
    between = pause(shaper, way)
    name = f"{before.about.name}-{after.about.name}"
    if steps:
        kept = _kept(before, slice(0, last + 1)), _kept(after, slice(first, None))
        clip = in_one(shaper.planted, *kept, between, name)
    else:
        clip = assembled(shaper, before, name, [a.frames, *between, b.frames])
    start, length = last * before.dt, (sum(map(len, between)) + 1) * before.dt
    return PhysicalJoin(clip, start, enter, start, start + length, way)


def make_shaper(
    robot: Robot,
    dt: float,
    motions: Sequence[ReferenceMotion],
    limits: FeasibilityLimits | None = None,
    time_price: float = TIME_PRICE,
) -> Shaper:
    """What makes joins between motions at a rate; the CoM stays about as low and high as theirs."""
    planted, legs = PlantedRobot(robot), PlantedLegs(robot)
    still = np.zeros(len(robot.joint_names))
    planted.at(robot.standing_qpos[7:], still, still)
    inertia = np.diag(planted.state.M) / robot.mass
    masses = np.concatenate([np.ones(3), inertia[3:6], inertia[6:][legs.others]])
    limits = limits or FeasibilityLimits()
    return Shaper(planted, legs, limits, dt, height_span(motions), masses, time_price)


def height_span(motions: Sequence[ReferenceMotion]) -> tuple[float, float]:
    """Lowest and highest CoM that joins between motions may have [m]."""
    heights = [m.sample(t).com_offset[2] for m in motions for t in np.arange(0.0, m.duration, 0.1)]
    return min(heights) - LOWER, max(heights) + HIGHER


def cheapest(shaper: Shaper, a: End, b: End) -> JoinPart | WhyNot:
    """The possible way of least K + λ D; if none is, the duration that lacks least."""
    best, nearest, least = None, WhyNot(""), np.inf
    for bound, count in sorted(_prices(shaper, a, b)):
        if bound >= least:
            break  # bends only add to K
        tried = shaper.attempt(a, b, count)
        if isinstance(tried, WhyNot):
            nearest = tried if not nearest.reason or tried.lacking < nearest.lacking else nearest
            continue
        price = tried.coefficient + shaper.time_price * tried.duration
        if price < least:
            best, least = tried, price
    return best or nearest


def pause(shaper: Shaper, parts: Sequence[JoinPart]) -> list[np.ndarray]:
    """Joints of the frames of ways, with standing between each two."""
    standing = np.tile(shaper.planted.robot.standing_qpos[7:], (STILL, 1))
    between = [frames for part in parts for frames in (part.qpos[:, 7:], standing)]
    return between[:-1]


def assembled(
    shaper: Shaper, like: RobotClip, name: str, frames: Sequence[np.ndarray]
) -> RobotClip:
    """A clip of joints (n, nj), one after the other, on the soles as they stand.

    What the check lets a joint be beyond its range between frames, no frame of a clip may be.
    """
    joints = np.clip(np.vstack(frames), *shaper.planted.robot.joint_range.T)
    qpos = np.array([shaper.planted.placed(q) for q in joints])
    return RobotClip(replace(like.about, name=name), like.dt, qpos)


def way_between(shaper: Shaper, a: End, b: End, through: bool) -> tuple[JoinPart, ...] | str:
    """One way, or two by standing if that is allowed; or why there is none."""
    direct = direct_way(shaper, a, b)
    if isinstance(direct, JoinPart):
        return (direct,)
    if not through:
        return direct.reason
    ways = ways_by_standing(shaper, a, b)
    return f"{direct.reason}; {ways}" if isinstance(ways, str) else ways


def direct_way(shaper: Shaper, a: End, b: End) -> JoinPart | WhyNot:
    """The cheapest way from one end to the other, without the clips' accelerations if need be."""
    direct = cheapest(shaper, a, b)
    if isinstance(direct, WhyNot) and not (a.is_calm and b.is_calm):
        # a clip may be about to do what leads to nothing
        calm = cheapest(shaper, a.calm, b.calm)
        direct = calm if isinstance(calm, JoinPart) else direct
    return direct


def ways_by_standing(shaper: Shaper, a: End, b: End) -> tuple[JoinPart, ...] | str:
    """Two ways with standing between them; or why there are none."""
    standing, ways = standing_end(shaper), []
    for word, (start, goal) in zip(("to", "from"), pairwise((a, standing, b)), strict=True):
        way = cheapest(shaper, start, goal)
        if isinstance(way, WhyNot):
            return f"{word} standing: {way.reason}"
        ways.append(way)
    return tuple(ways)


def standing_end(shaper: Shaper) -> End:
    """The standing posture as one side of a join."""
    robot = shaper.planted.robot
    frames = np.tile(robot.standing_qpos[7:], (STILL, 1))
    return shaper.end(load_motion("standing", robot), 0.0, frames)


def _prices(shaper: Shaper, a: End, b: End) -> list[tuple[float, int]]:
    """K + λ D without bends, and the frames of D, for every duration that is tried."""
    lengths = np.geomspace(LEAST, MOST, LENGTHS) / shaper.dt
    prices = []
    for count in np.unique(np.maximum(2, np.round(lengths).astype(int))):
        curve = Curve.between(a.boundary, b.boundary, count * shaper.dt)
        price = curve.energy(shaper.masses) + shaper.time_price * curve.duration
        prices.append((price, int(count)))
    return prices


def _entered(shaper: Shaper, motion: ReferenceMotion, time: float) -> End:
    """A motion from a time on [s]."""
    times = np.arange(time, motion.duration + 1e-9, shaper.dt)
    return shaper.end(motion, time, np.array([motion.sample(t).q_ref for t in times]))


def _kept(clip: RobotClip, frames: slice) -> RobotClip:
    planted = None if clip.planted is None else clip.planted[frames]
    return replace(clip, qpos=clip.qpos[frames], planted=planted)


def _frame(clip: RobotClip, time: float, field: str) -> int:
    """The frame nearest to a time; raises ConfigError for one outside of the clip."""
    if not 0.0 <= time <= clip.duration + 1e-9:
        raise ConfigError(f"must be from 0 to {clip.duration:.2f} s, not {time:g}", field=field,
                          source=clip.about.name)  # fmt: skip
    return round(time / clip.dt)
