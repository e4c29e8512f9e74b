"""Inverse kinematics on reachable targets: `python -m tests.performance.inverse_kinematics`.

For every chain of the default humanoid, targets are where random postures within the limits have
its end; solvers begin standing. Printed: what share of them a method reaches (residual ≤ 0.1 mm)
from one start and with four restarts, the largest residual then, joints beyond their limits, and
the processor's time for a target. With --prior: the same for a prior over the packaged clips, see
`prior_table`.
"""

from __future__ import annotations

import argparse
import sys
import time
from typing import NamedTuple

import numpy as np

from poise.baselines.motion import IkGoal, IkOptions, IkResult, InverseKinematics, PosePrior
from poise.baselines.motion.retargeting.inverse_kinematics.solve import METHODS
from poise.baselines.motion.retargeting.limbs import find_limbs
from poise.envs import Robot, load_robot

RESTARTS = 4
CHAINS = {  # name → base, role of the end, whether its orientation is asked for
    "arm": ("torso", "hand_right", False),
    "trunk and arm": ("pelvis", "hand_right", False),
    "leg": ("pelvis", "ankle_left", False),
    "leg, pose": ("pelvis", "ankle_left", True),
    "foot to hand": ("left_foot", "hand_right", False),
}
OTHER = "left_lower_arm"  # moves along: the prior has a say in it
IN_PLACE = tuple(
    f"humanoid_{name}" for name in ("stand", "squat", "reach_down", "reach_up", "punch", "wave")
)


class Row(NamedTuple):
    """What one method does with the targets of one chain."""

    first: float  # share that is reached from standing
    restarted: float  # with restarts
    residual: float  # largest with restarts [m]
    beyond: int  # results with a joint beyond a limit
    milliseconds: float  # of the processor, a target from one start
    steps: float


def targets(
    solver: InverseKinematics, point: np.ndarray, pose: bool, count: int, seed: int = 0
) -> list[IkGoal]:
    """Where random postures have the end, the base where it stands."""
    chain, rng, found = solver.chain, np.random.default_rng(seed), []
    for _ in range(count):
        chain.place(chain.whole(rng.uniform(*chain.free), solver.robot.standing_qpos))
        body = chain.ends[0]
        axes = chain.data.xmat[body].reshape(3, 3)
        turn = chain.data.xquat[body].copy() if pose else None
        found.append(IkGoal(solver.names[0], chain.data.xpos[body] + axes @ point, turn, point))
    return found


def measure(robot: Robot, chain: str, method: str, count: int) -> Row:
    """A method on the targets of a chain."""
    base, role, pose = CHAINS[chain]
    body, point = find_limbs(robot).points[role].parts[0]
    solver = InverseKinematics(robot, [robot.model.body(body).name], base=base, method=method)
    goals = targets(solver, point, pose, count)
    begin = time.thread_time()
    first = [solver.solve([goal]) for goal in goals]
    spent = time.thread_time() - begin
    missed = [goal for goal, result in zip(goals, first, strict=True) if not result.reached]
    again = [solver.solve([goal], restarts=RESTARTS) for goal in missed]
    last = [result for result in first if result.reached] + again
    return Row(
        float(np.mean([result.reached for result in first])),
        float(np.mean([result.reached for result in last])),
        max(result.residual for result in last),
        sum(beyond(robot, result) for result in first + again),
        1e3 * spent / count,
        float(np.mean([result.iterations for result in first])),
    )


def beyond(robot: Robot, result: IkResult) -> bool:
    """True if any joint is beyond its limit."""
    low, high = robot.joint_range.T
    return bool(np.any((result.qpos[7:] < low) | (result.qpos[7:] > high)))


def chain_table(count: int) -> None:
    """B1: every method on every chain."""
    robot = load_robot()
    print(f"| chain | method | reached of {count} | with {RESTARTS} restarts | largest residual "
          "| beyond limits | steps | a target |")  # fmt: skip
    print("| --- " * 8 + "|")
    for chain in CHAINS:
        for method in METHODS:
            row = measure(robot, chain, method, count)
            print(f"| {chain} | {method} | {100 * row.first:.1f} % | {100 * row.restarted:.1f} % | "
                  f"{1e3 * row.residual:.2g} mm | {row.beyond} | {row.steps:.0f} | "
                  f"{row.milliseconds:.1f} ms |", flush=True)  # fmt: skip


def clip_postures(robot: Robot) -> dict[str, np.ndarray]:
    """Name → (F, nj) joints of the packaged clips that stand in place, on this robot."""
    from poise.baselines.motion.clips.bvh import read_bvh
    from poise.baselines.motion.clips.library import find_bvh
    from poise.baselines.motion.retargeting.retarget import retarget

    return {name: retarget(read_bvh(find_bvh(name)).clip, robot).clip.qpos[:, 7:]
            for name in IN_PLACE}  # fmt: skip


class PriorRow(NamedTuple):
    """Postures reached with and without the prior."""

    plain_error: float  # mean distance of the hand [m]
    usual_error: float
    plain_cost: float  # mean of Σ_k ((u_k·(x − x̄))/σ_k)²
    usual_cost: float
    plain_gap: float  # root mean square of the joints from the clip's [rad]
    usual_gap: float


def reach_with_prior(
    robot: Robot, prior: PosePrior, goals: list[list[IkGoal]], shown: np.ndarray
) -> PriorRow:
    """Goals of a hand and of a foot, which stays, met from standing by all joints."""
    ends, errors, costs, gaps = [goal.body for goal in goals[0]], [], [], []
    for used in (None, prior):
        solver = InverseKinematics(robot, ends, base=robot.soles[0].body, along=[OTHER],
                                   prior=used, options=IkOptions(iterations=100))  # fmt: skip
        results = [solver.solve(pair) for pair in goals]
        errors.append(np.mean([hand_error(robot, result, pair[0])
                               for result, pair in zip(results, goals, strict=True)]))  # fmt: skip
        costs.append(np.mean([prior.cost(result.qpos[7:]) for result in results]))
        joints = np.array([result.qpos[7:] for result in results])
        gaps.append(np.sqrt(((joints - shown) ** 2).mean()))
    return PriorRow(*map(float, (*errors, *costs, *gaps)))


def hand_error(robot: Robot, result: IkResult, goal: IkGoal) -> float:
    """Distance of the goal's point from where it is to be [m]."""
    import mujoco

    data = mujoco.MjData(robot.model)
    data.qpos[:] = result.qpos
    mujoco.mj_kinematics(robot.model, data)
    place = data.body(goal.body).xpos + data.body(goal.body).xmat.reshape(3, 3) @ goal.point
    return float(np.linalg.norm(place - goal.position))


def frames_as_goals(robot: Robot, postures: np.ndarray) -> list[list[IkGoal]]:
    """For every posture: the hand where it has it, and the second foot where it stands."""
    hand, point = find_limbs(robot).points["hand_right"].parts[0]
    ends = [robot.model.body(hand).name, robot.soles[1].body]
    chain = InverseKinematics(robot, ends, base=robot.soles[0].body).chain
    foot = IkGoal(ends[1], chain.data.body(ends[1]).xpos, chain.data.body(ends[1]).xquat)
    goals = []
    for posture in postures:
        chain.place(chain.whole(posture[chain.qpos - 7], robot.standing_qpos))
        place = chain.data.xpos[hand] + chain.data.xmat[hand].reshape(3, 3) @ point
        goals.append([IkGoal(ends[0], place, point=point), foot])
    return goals


def prior_table(count: int) -> None:
    """B2: a prior over five clips, goals of the hand from the sixth, which it has not seen.

    The feet stay where they are. With ρ = ∞, as in the notes, and with that of the postures.
    """
    robot = load_robot()
    postures = clip_postures(robot)
    print("| hand as in | ρ | components | of variance | hand, without | with the prior "
          "| cost, without | with | joints from the clip's, without | with |")  # fmt: skip
    print("| --- " * 10 + "|")
    for held in IN_PLACE:
        others = np.concatenate([p for name, p in postures.items() if name != held])
        frames = np.linspace(0, len(postures[held]) - 1, count).astype(int)
        shown = postures[held][frames]
        for rest in (False, True):
            prior = PosePrior.fit(others, rest=rest)
            row = reach_with_prior(robot, prior, frames_as_goals(robot, shown), shown)
            print(f"| {held} | {np.degrees(prior.rest):.1f}° | {len(prior.deviations)} | "
                  f"{100 * prior.explained:.1f} % | {1e3 * row.plain_error:.2f} mm | "
                  f"{1e3 * row.usual_error:.2f} mm | {row.plain_cost:.1f} | {row.usual_cost:.2f} | "
                  f"{np.degrees(row.plain_gap):.1f}° | {np.degrees(row.usual_gap):.1f}° |",
                  flush=True)  # fmt: skip


def main(args: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--targets", type=int, default=1000)
    parser.add_argument("--prior", action="store_true")
    options = parser.parse_args(sys.argv[1:] if args is None else args)
    (prior_table if options.prior else chain_table)(options.targets)


if __name__ == "__main__":
    main()
