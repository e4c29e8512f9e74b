"""Random transitions between packaged clips, made by physics and by a fixed rule, and performed.

    python -m tests.performance.joins --count 200 --out joins.jsonl
    python -m tests.performance.joins --count 200 --refusals     # only whether these are wrong

Each leaves one clip and enters another at random times. `physical` gives a join or refuses. What it
gives is performed by momentum-qp, and so is the seed's rule for the same pair: a cubic of the
joints over 0.3 s. A refusal is wrong if one of 20 durations of the curve without knots can be
performed. Performed means no fall within 3 s after the join, and bodies within 20 mm (mean
distance) of the motion from its begin to half a second after its end.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from poise.baselines.balance.references.robot_clip import RobotClip, reference_from
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.feasibility.curve import Curve
from poise.baselines.motion.feasibility.physical import (
    JoinRefused,
    assembled,
    make_shaper,
    physical_join,
)
from poise.baselines.motion.retargeting.retarget import retarget
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot, load_robot
from poise.training.benchmarking.statistics.rates import wilson_interval
from poise.training.benchmarking.trials.jobs import ANYWHERE
from poise.training.motion.following.follow import performer
from poise.training.motion.tracking.record import FeetRecord, lies
from poise.training.motion.tracking.reference import ReferenceBodies

CLIPS = tuple(
    f"humanoid_{name}" for name in ("stand", "squat", "reach_down", "reach_up", "punch", "wave")
)
CONTROLLER = "momentum-qp"
FIXED = 0.3  # [s]
GRID = np.geomspace(0.2, 2.5, 20)  # [s]
NEAR, WATCHED, AFTER = 0.02, 0.5, 3.0  # [m], [s], [s]


class Pair(NamedTuple):
    """Where clip `before` is left and clip `after` entered [s]."""

    before: str
    after: str
    leave: float
    enter: float


class Performed(NamedTuple):
    """What became of one performance: whether it fell, and the mean distance of bodies [m]."""

    fallen: bool
    error: float

    @property
    def good(self) -> bool:
        """No fall, and near enough."""
        return not self.fallen and self.error <= NEAR


def draw(clips: dict[str, RobotClip], count: int, seed: int) -> Iterator[Pair]:
    """Random pairs, each left and entered between a tenth and nine tenths of its clip."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        before, after = rng.choice(list(clips), 2)
        shares = rng.uniform(0.1, 0.9, 2)
        times = [clips[n].dt * round(s * clips[n].duration / clips[n].dt)
                 for n, s in zip((before, after), shares, strict=True)]  # fmt: skip
        yield Pair(str(before), str(after), *times)


def perform(robot: Robot, clip: RobotClip, start: float, end: float, seed: int) -> Performed:
    """A motion from a disturbed start, with its error about the join from `start` to `end` [s]."""
    motion = reference_from(clip, robot, clip.about.name)
    duration = 0.02 * round((end + AFTER) / 0.02)
    agent = performer(CONTROLLER, robot, motion, duration, ANYWHERE)
    env, bodies = agent.env, ReferenceBodies(motion, robot)
    observation, _ = env.reset(seed=seed, options={"push": []})
    footing, errors, done = FeetRecord(env.simulation.state), [], False
    while not done:
        _, terminated, truncated = env.step_without_info(agent.act(observation))
        footing.update(env.simulation.state)
        now = env.simulation.time
        if env.fallen or terminated or lies(env):
            return Performed(True, np.nan)
        done = truncated
        if start <= now <= end + WATCHED:
            _, places = bodies.at(now, footing.stance)
            gap = env.simulation.data.xpos[bodies.bodies] - places
            errors.append(np.linalg.norm(gap, axis=1).mean())
    return Performed(False, float(np.mean(errors)))


def by_rule(robot: Robot, clips: dict[str, RobotClip], pair: Pair) -> RobotClip:
    """The seed's join: a cubic of the joints that keeps their rates, cut at their ranges."""
    a, b = (reference_from(clips[name], robot, name) for name in pair[:2])
    begin, goal = a.sample(pair.leave), b.sample(pair.enter)
    dt = clips[pair.before].dt
    count = round(FIXED / dt)
    cubic = CubicHermiteSpline([0.0, count * dt], [begin.q_ref, goal.q_ref],
                               [begin.v_ref, goal.v_ref])  # fmt: skip
    joints = np.clip(cubic(np.arange(1, count) * dt), *robot.joint_range.T)
    return _with(robot, clips, pair, joints)


def by_length(
    robot: Robot, clips: dict[str, RobotClip], pair: Pair, duration: float
) -> RobotClip | None:
    """The curve of the fifth order over a duration, cut at the joints' ranges; None: no legs."""
    motions = [reference_from(clips[name], robot, name) for name in pair[:2]]
    shaper = make_shaper(robot, clips[pair.before].dt, motions)
    empty = np.zeros((0, len(robot.joint_names)))
    a, b = (shaper.end(m, t, empty) for m, t in zip(motions, pair[2:], strict=True))
    count = max(2, round(duration / shaper.dt))
    curve = Curve.between(a.boundary, b.boundary, count * shaper.dt)
    qpos, _ = shaper.frames(curve, a, count)
    if qpos is None:
        return None
    return _with(robot, clips, pair, np.clip(qpos[:, 7:], *robot.joint_range.T))


def _with(robot: Robot, clips: dict[str, RobotClip], pair: Pair, joints: np.ndarray) -> RobotClip:
    first, second = clips[pair.before], clips[pair.after]
    left, entered = (round(t / first.dt) for t in pair[2:])
    frames = [first.qpos[: left + 1, 7:], joints, second.qpos[entered:, 7:]]
    return assembled(make_shaper(robot, first.dt, [reference_from(first, robot, "")]),
                     first, f"{pair.before}-{pair.after}", frames)  # fmt: skip


def judge_refusal(
    robot: Robot, clips: dict[str, RobotClip], pair: Pair, seed: int
) -> dict[str, Any]:
    """The record of one pair of which nothing is performed unless it is refused."""
    record: dict[str, Any] = pair._asdict() | {"seed": seed, "given": True}
    try:
        physical_join(robot, clips[pair.before], clips[pair.after],
                      leave=pair.leave, enter=pair.enter)  # fmt: skip
    except JoinRefused as refusal:
        record |= {"given": False, "reason": str(refusal).split(": ", 1)[1],
                   "works": _works(robot, clips, pair, seed)}  # fmt: skip
    return record


def judge_pair(
    robot: Robot, clips: dict[str, RobotClip], pair: Pair, seed: int, grid: bool
) -> dict[str, Any]:
    """The record of one pair."""
    record: dict[str, Any] = pair._asdict() | {"seed": seed}
    begun = time.thread_time()
    try:
        join = physical_join(robot, clips[pair.before], clips[pair.after],
                             leave=pair.leave, enter=pair.enter)  # fmt: skip
    except JoinRefused as refusal:
        record |= {"given": False, "reason": str(refusal).split(": ", 1)[1],
                   "made_in": time.thread_time() - begun}  # fmt: skip
    else:
        record["made_in"] = time.thread_time() - begun
        done = perform(robot, join.clip, join.start, join.end, seed)
        record |= {"given": True, "through": join.through_standing, **done._asdict(),
                   "durations": [part.duration for part in join.parts],
                   "bent": any(part.bent for part in join.parts)}  # fmt: skip
    try:
        rule = perform(robot, by_rule(robot, clips, pair), pair.leave, pair.leave + FIXED, seed)
    except ConfigError as error:  # soles that leave the ground are no motion
        record |= {"rule_refused": str(error)}
    else:
        record |= {"rule_fallen": rule.fallen, "rule_error": rule.error}
    if grid and not record["given"]:
        record["works"] = _works(robot, clips, pair, seed)
    return record


def _works(robot: Robot, clips: dict[str, RobotClip], pair: Pair, seed: int) -> float | None:
    """The first duration on the grid with which a refused pair can be performed [s], or None."""
    for duration in GRID:
        clip = by_length(robot, clips, pair, float(duration))
        if clip is None:
            continue
        try:
            made = perform(robot, clip, pair.leave, pair.leave + duration, seed)
        except ConfigError:
            continue
        if made.good:
            return float(duration)
    return None


def print_summary(records: list[dict[str, Any]]) -> None:
    """Falls, errors and refusals, with intervals."""
    given = [r for r in records if r["given"]]
    refused = [r for r in records if not r["given"]]
    print(f"{len(records)} pairs, {len(given)} given, {len(refused)} refused")
    if all("fallen" in r for r in given):
        _print_performed(given, records)
    tried = [r for r in refused if "works" in r]
    if tried:
        wrong = sum(r["works"] is not None for r in tried)
        low, high = wilson_interval(wrong, len(tried))
        print(f"wrong refusals: {wrong} of {len(tried)} ({low:.1%} to {high:.1%}), "
              f"{wrong / len(records):.1%} of all pairs")  # fmt: skip


def _print_performed(given: list[dict[str, Any]], records: list[dict[str, Any]]) -> None:
    through, bent = (sum(r[name] for r in given) for name in ("through", "bent"))
    print(f"of those given {through} through standing, {bent} bent")
    _print_falls("physical", [r["fallen"] for r in given], [r["error"] for r in given])
    for name, part in (("the rule, the same pairs", given), ("the rule, all", records)):
        played = [r for r in part if "rule_fallen" in r]
        _print_falls(name, [r["rule_fallen"] for r in played], [r["rule_error"] for r in played])
        print(f"  no motion at all: {len(part) - len(played)}")


def _print_falls(name: str, fallen: list[bool], errors: list[float]) -> None:
    if not fallen:
        return
    low, high = wilson_interval(sum(fallen), len(fallen))
    stood = np.array([1000 * e for e, f in zip(errors, fallen, strict=True) if not f])
    print(f"{name}: {sum(fallen)} of {len(fallen)} fall ({low:.1%} to {high:.1%}), "
          f"bodies {stood.mean():.1f} mm, median {np.median(stood):.1f}, largest "
          f"{stood.max():.1f}, over 20 mm {int(np.sum(stood > 20.0))}")  # fmt: skip


def main() -> None:
    """Draw, judge, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--no-grid", action="store_true", help="leave refusals unexamined")
    parser.add_argument("--refusals", action="store_true", help="examine refusals alone")
    parser.add_argument("--out", type=Path, help="file of one JSON line a pair")
    given = parser.parse_args()
    robot = load_robot()
    clips = {name: retarget(read_bvh(find_bvh(name)).clip, robot).clip for name in CLIPS}
    records = []
    for i, pair in enumerate(draw(clips, given.count, given.seed)):
        seed = given.seed + i
        records.append(judge_refusal(robot, clips, pair, seed) if given.refusals else
                       judge_pair(robot, clips, pair, seed, not given.no_grid))  # fmt: skip
        if not records[-1]["given"]:
            print(f"pair {i}: {records[-1]['reason']}; works: {records[-1].get('works')}",
                  flush=True)  # fmt: skip
        if given.out is not None:
            with given.out.open("a") as file:
                file.write(json.dumps(records[-1]) + "\n")
    print_summary(records)


if __name__ == "__main__":
    main()
