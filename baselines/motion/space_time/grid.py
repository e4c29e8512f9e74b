"""Constraints by trial in steps, as Semakin has them: keyframe by keyframe."""

from collections.abc import Sequence
from itertools import product

import mujoco
import numpy as np
from scipy.interpolate import PchipInterpolator

from poise.baselines.motion.space_time.constraints.constraint import Constraint
from poise.baselines.motion.space_time.constraints.scene import ConstraintRows, Scene
from poise.configs.errors import ConfigError

from .asked import Asked
from .problem import MARGIN
from .stance import motions, move_soles

EVERY = 0.1  # [s] between keyframes
STEPS = 5  # values of each parameter; fewer where that makes too many trials
MOST = 700  # trials of a keyframe
NEWTON, DAMPING = 4, 1e-3  # steps of an operation, and what damps them
ROUNDS = 3  # of joint limits and planted soles, by turns
FAR = 0.05  # [m, rad] an excess whose coefficient is one half
SOLE, NEAR = 1e-3, 1e-3  # [m] soles off their places, links too near: still satisfied


def by_trial(scene: Scene, asked: Asked, constraints: Sequence[Constraint]) -> None:
    """Move the postures of a scene so that as many constraints hold as trials in steps find.

    Every keyframe by itself: each constraint that holds then has an operation with a parameter s,
    which moves the posture by a share s of what is missing, on planted soles. Its values
    0, ¼, … 1 are tried in all combinations, from the most preferred on, which is 0: the motion
    as it is. A state is corrected to the joint limits. Kept is what satisfies most of the
    constraints, soles and clearance; of these, what has the least Σ e, e = x/(x + 5 cm) for an
    excess x; of these, what is most preferred. Between keyframes displacements are monotone cubics.

    Raises ConfigError for more constraints at one time than 2ᵏ trials allow.
    """
    count = max(round((len(scene) - 1) * scene.dt / EVERY), 2) + 1
    keys = np.unique(np.round(np.linspace(0, len(scene) - 1, count)).astype(int))
    part = scene.part(keys)
    active = [set(each.frames(part).tolist()) for each in constraints]
    deltas = np.zeros((len(keys), scene.model.nv))
    for key in range(1, len(keys) - 1):
        here = [each for each, frames in zip(constraints, active, strict=True) if key in frames]
        if not here:
            continue
        before = part.qpos[key].copy()
        found = _best(part, asked, here, key)
        part.qpos[key] = found
        part.move(part.qpos)
        mujoco.mj_differentiatePos(scene.model, deltas[key], 1.0, before, found)
    between = PchipInterpolator(keys, deltas)(np.arange(len(scene)))
    low, high = scene.robot.joint_range[:, 0] + MARGIN, scene.robot.joint_range[:, 1] - MARGIN
    moved = np.flatnonzero(np.abs(between).max(axis=1) > 0.0)
    for frame in moved.tolist():
        scene.displace(frame, between[frame])
    for _ in range(ROUNDS):  # planting moves joints, too
        scene.qpos[moved, 7:] = np.clip(scene.qpos[moved, 7:], low, high)
        scene.move(scene.qpos)
        move_soles(scene, moved)


def _best(part: Scene, asked: Asked, constraints: Sequence[Constraint], key: int) -> np.ndarray:
    """The posture (nq,) of a keyframe that satisfies most."""
    steps = min(STEPS, int(MOST ** (1.0 / len(constraints)) + 1e-9))
    if steps < 2:
        raise ConfigError(f"by trial at most {int(np.log2(MOST))} constraints can hold at one "
                          f"time, not {len(constraints)}", field="solver",
                          choices=("spacetime",))  # fmt: skip
    values = product(np.linspace(0.0, 1.0, steps), repeat=len(constraints))
    begin, best, score = part.qpos[key].copy(), part.qpos[key].copy(), (-1, 0.0)
    for shares in sorted(values, key=sum):
        part.qpos[key] = begin
        part.move(part.qpos)
        _operate(part, constraints, key, np.array(shares))
        found = _score(part, asked, constraints, key)
        if found > score:
            best, score = part.qpos[key].copy(), found
    return best


def _operate(part: Scene, constraints: Sequence[Constraint], key: int, shares: np.ndarray) -> None:
    """Move a keyframe by shares of what its constraints miss, within the joint limits."""
    if not shares.any():
        return
    rows = [list(each.rows(part, [key])) for each in constraints]
    left = [(1.0 - s) * _size(own) for s, own in zip(shares, rows, strict=True)]
    low, high = part.robot.joint_range[:, 0] + MARGIN, part.robot.joint_range[:, 1] - MARGIN
    for _ in range(NEWTON):
        gaps, jacobians = [], []
        for share, own, aim in zip(shares, rows, left, strict=True):
            size = _size(own)
            if share > 0.0 and size > aim:
                gaps += [(1.0 - aim / size) * _missing(each) for each in own]
                jacobians += [each.parts[key] for each in own]
        if not gaps:
            return
        gap, derivative = np.concatenate(gaps), np.concatenate(jacobians)
        ways = motions(part, key)
        J = derivative[gap != 0.0] @ ways.free
        step = J.T @ np.linalg.solve(J @ J.T + DAMPING * np.eye(len(J)), gap[gap != 0.0])
        part.displace(key, ways.free @ step)
        part.qpos[key, 7:] = np.clip(part.qpos[key, 7:], low, high)
        part.move(part.qpos)
        move_soles(part, np.array([key]))
        rows = [list(each.rows(part, [key])) for each in constraints]


def _size(rows: Sequence[ConstraintRows]) -> float:
    """The norm of what rows miss."""
    return float(np.linalg.norm(np.concatenate([_missing(each) for each in rows] or [np.zeros(1)])))


def _missing(rows: ConstraintRows) -> np.ndarray:
    """(k,) what is to be added to the values so that they are within their bounds."""
    return np.clip(rows.value, rows.low, rows.high) - rows.value


def _score(
    part: Scene, asked: Asked, constraints: Sequence[Constraint], key: int
) -> tuple[int, float]:
    """How many conditions are satisfied, and −Σ e, rounded so that ties are ties."""
    satisfied, coefficients = 0, 0.0
    for each in constraints:
        excess = max((float(r.excess.max()) for r in each.rows(part, [key])), default=0.0)
        satisfied += excess * each.scale(part) <= max(each.tolerance, 1e-2 * FAR)
        coefficients += excess / (excess + FAR)
    data, off = part.at(key), 0.0
    for i in range(len(part.robot.soles)):
        corners = part.corners(i)
        ways = corners - part.planted_corners[key, i, : len(corners)]
        off = max(off, float(np.linalg.norm(ways, axis=1).max()))
    satisfied += off <= SOLE
    satisfied += asked.limit.depth(data) <= NEAR
    joints, (low, high) = part.qpos[key, 7:], part.robot.joint_range.T
    satisfied += bool(np.all(joints >= low) and np.all(joints <= high))
    return satisfied, -round(coefficients, 3)
