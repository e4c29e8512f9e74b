"""Retargeting of clips whose feet stay, by each solver: what is missed, and how long it takes.

    python -m tests.performance.retargeting                    # 6 clips, 4 robots, 2 solvers
    python -m tests.performance.retargeting --robots humanoid --clips humanoid_punch
    python -m tests.performance.retargeting --clips humanoid_punch --robots humanoid \
        --solvers frame spacetime grid --constraints low_punch

Bars: planted soles ≤ 1 mm off, skating ≤ 0.5 cm/s mean and 1 cm/s largest, no joint over its limit,
penetration ≤ 1 mm, hands ≤ 3 cm in the mean over the frames in which they can be where they are to
be; a frame takes ≤ 20 ms by `frame`; `spacetime` has a third derivative at least 30 % lower, at
most 1.1 times the task error, and takes 30 s of the processor at most for 10 s of a clip.
"""

from __future__ import annotations

import argparse

import mujoco
import numpy as np
from scipy.optimize import least_squares

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.retargeting.limbs import Limbs, find_limbs
from poise.baselines.motion.retargeting.retarget import LEAD, SMOOTH, targets_on
from poise.baselines.motion.retargeting.targets import BodyTargets
from poise.baselines.motion.space_time.retarget_clip import RetargetedClip, Solver, retarget_clip
from poise.envs.robots.robot import Robot, load_robot

ROBOTS = ("humanoid", "compact", "tall", "toddler")
CLIPS = tuple(
    f"humanoid_{name}" for name in ("stand", "squat", "reach_down", "reach_up", "punch", "wave")
)
SOLVERS = ("frame", "spacetime")
REACHED = 0.01  # [m] a hand can be where it is to be if the arm alone brings it so near
EVERY = 5  # frames between those in which that is looked at


class Hand:
    """A hand relative to its shoulder, and how near to its place its arm alone brings it."""

    def __init__(self, robot: Robot, limbs: Limbs, side: str):
        self.robot, self.points = robot, limbs.points
        self.side, self.data = side, mujoco.MjData(robot.model)
        self.joints = np.flatnonzero(self._moves())

    def _moves(self) -> np.ndarray:
        self.see(self.robot.standing_qpos)
        ends = [self.points[f"{role}_{self.side}"].jacobian(self.robot.model, self.data)
                for role in ("shoulder", "hand")]  # fmt: skip
        return np.abs((ends[1] - ends[0])[:, 6:]).max(axis=0) * (
            np.abs(ends[0][:, 6:]).max(axis=0) < 1e-9
        )

    def see(self, qpos: np.ndarray) -> None:
        self.data.qpos[:] = qpos
        mujoco.mj_kinematics(self.robot.model, self.data)
        mujoco.mj_comPos(self.robot.model, self.data)

    def error(self, qpos: np.ndarray, targets: BodyTargets, frame: int) -> np.ndarray:
        """(3,) from where the clip's directions have the hand [m]."""
        self.see(qpos)
        shoulder, elbow, hand = (
            self.points[f"{role}_{self.side}"].place(self.data)
            for role in ("shoulder", "elbow", "hand")
        )
        arm, forearm = (targets.directions[f"{part}_{self.side}"][frame]
                        for part in ("upper_arm", "forearm"))  # fmt: skip
        upper, lower = np.linalg.norm(elbow - shoulder), np.linalg.norm(hand - elbow)
        return hand - shoulder - upper * arm - lower * forearm

    def least(self, qpos: np.ndarray, targets: BodyTargets, frame: int) -> float:
        """The least error over the arm's joints, from here and from standing [m]."""
        where, (low, high) = 7 + self.joints, self.robot.joint_range[self.joints].T

        def errors(angles: np.ndarray) -> np.ndarray:
            moved = qpos.copy()
            moved[where] = angles
            return self.error(moved, targets, frame)

        starts = (qpos[where], self.robot.standing_qpos[where])
        found = [least_squares(errors, np.clip(x, low + 1e-6, high - 1e-6), bounds=(low, high))
                 for x in starts]  # fmt: skip
        return float(min(np.linalg.norm(each.fun) for each in found))


def hands(robot: Robot, made: RetargetedClip, targets: BodyTargets) -> dict[str, tuple[float, ...]]:
    """Side → mean error [m] where the hand can be there, share of such frames, mean of the rest."""
    limbs = find_limbs(robot)
    found: dict[str, tuple[float, ...]] = {}
    for side in ("left", "right") if limbs.has_arms else ():
        hand, frames = Hand(robot, limbs, side), range(0, len(targets), EVERY)
        errors = np.array(
            [np.linalg.norm(hand.error(made.clip.qpos[f], targets, f)) for f in frames]
        )
        least = np.array([hand.least(made.clip.qpos[f], targets, f) for f in frames])
        near = least <= REACHED
        means = [float(errors[part].mean()) if part.any() else 0.0 for part in (near, ~near)]
        found[side] = (means[0], float(near.mean()), means[1])
    return found


def judge(robot: Robot, name: str, solvers: list[Solver], constraints: str | None) -> list[str]:
    """Print a row for every solver; return the bars that are missed."""
    clip, missed, frame = read_bvh(find_bvh(name)).clip, [], None
    _, targets, _ = targets_on(clip, robot, smooth=SMOOTH, lead=LEAD, planted=False)
    for solver in solvers:
        made = retarget_clip(clip, robot, solver=solver, constraints=constraints or ())
        q, label = made.quality, f"{name} on {robot.name} by {solver}"
        reach = hands(robot, made, targets)
        arms = ", ".join(
            f"{side} {100 * error:.1f} cm in {share:.0%}"
            + (f" (else {100 * other:.1f})" if share < 1.0 else "")
            for side, (error, share, other) in reach.items()
        )
        seconds = made.time_per_frame * len(made.clip.qpos)
        print(f"{label}: soles {1000 * q.sole_error:.2g} mm, skating {100 * q.skating:.2g} / "
              f"{100 * q.skating_largest:.2g} cm/s, limits {np.degrees(q.limit_excess):.2g}°, "
              f"penetration {1000 * q.penetration:.2g} mm, hands {arms}, "
              f"{1000 * made.time_per_frame:.1f} ms a frame, jerk {q.jerk:.1f} rad/s³, "
              f"task error {q.task_error:.4f}", flush=True)  # fmt: skip
        bars = {
            "soles": q.sole_error <= 1e-3,
            "skating, mean": q.skating <= 5e-3,
            "skating, largest": q.skating_largest <= 1e-2,
            "limits": q.limit_excess <= 0.0,
            "penetration": q.penetration <= 1e-3,
            **{f"hand {s}": e <= 0.03 for s, (e, _, _) in reach.items()},
        }
        if solver == "frame":
            frame = made
            bars["time"] = made.time_per_frame <= 0.02
        elif solver == "spacetime" and frame is not None:
            less, more = 1.0 - q.jerk / frame.quality.jerk, q.task_error / frame.quality.task_error
            ten = 10.0 * seconds / made.clip.duration
            print(f"  jerk {less:.0%} lower, task error {more:.3f} times, {ten:.1f} s for 10 s")
            bars |= {"jerk": less >= 0.3, "task error": more <= 1.1, "time of 10 s": ten <= 30.0}
        for each in q.violations:
            print(f"  {each.about}: missed by {each.largest:.3g} {each.unit} at {each.time:.2f} s"
                  + ("" if each.holds else ", violated"))  # fmt: skip
        missed += [f"{label}: {bar}" for bar, met in bars.items() if not met]
    return missed


def main() -> None:
    """All robots and clips; then what is missed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--robots", nargs="+", default=ROBOTS)
    parser.add_argument("--clips", nargs="+", default=CLIPS)
    parser.add_argument("--solvers", nargs="+", default=SOLVERS)
    parser.add_argument("--constraints", help="a packaged name or a .yaml file")
    given = parser.parse_args()
    missed: list[str] = []
    for robot in map(load_robot, given.robots):
        for name in given.clips:
            missed += judge(robot, name, list(given.solvers), given.constraints)
    print(f"{len(missed)} bars missed" + "".join(f"\n  {each}" for each in missed))


if __name__ == "__main__":
    main()
