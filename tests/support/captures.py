"""Made captures whose contacts are known: ten motions on skeletons of several programs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.motion.clips.bvh import write_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.rotations import from_scipy
from poise.baselines.motion.clips.skeleton import Skeleton
from tests.support.conventions import CONVENTIONS

GRAVITY = 9.81
Course = Callable[[np.ndarray], np.ndarray]  # times (n,) → x, y, yaw (n, 3)


class Capture(NamedTuple):
    """A motion: names and size of the body, rate, length [s], and what its pelvis and feet do.

    A foot stands from t0 to t1 for each of its `stances`, where `path` is in the middle of these,
    a hip's width beside it; `low` is the share of the legs by which hips are low, at each time.
    """

    names: str
    leg: float
    rate: float
    length: float
    path: Course
    stances: tuple[list[tuple[float, float]], list[tuple[float, float]]]
    low: Callable[[np.ndarray], np.ndarray]


def _gait(length: float, period: float, duty: float) -> tuple[list[tuple[float, float]], ...]:
    """Left and right in turn, each on the ground for `duty` of a period."""
    counts = np.arange(-1, int(length / period) + 3)
    return tuple([(k * period, (k + duty) * period) for k in counts + phase] for phase in (0, 0.5))


def _way(vx: float, vy: float = 0.0, turn: float = 0.0) -> Course:
    """Straight, or on a circle, at a speed [m/s] and a rate of turning [rad/s]."""

    def path(t: np.ndarray) -> np.ndarray:
        yaw = turn * t
        if turn == 0.0:
            return np.column_stack([vx * t, vy * t, yaw])
        c, s = np.sin(yaw) / turn, (1.0 - np.cos(yaw)) / turn
        return np.column_stack([vx * c - vy * s, vx * s + vy * c, yaw])

    return path


def _leap(ahead: float, turn: float, start: float, flight: float) -> Course:
    def path(t: np.ndarray) -> np.ndarray:
        u = np.clip((t - start) / flight, 0.0, 1.0)
        return np.column_stack([ahead * u, 0.0 * u, turn * u])

    return path


def _hump(at: float, width: float, size: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda t: 0.04 + size * np.exp(-(((t - at) / width) ** 2))


def _even(low: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda t: np.full(len(t), low)


def _jump(start: float, flight: float, length: float) -> tuple[list[tuple[float, float]], ...]:
    return tuple([(-9.0, start), (start + flight, length + 9.0)] for _ in range(2))


CAPTURES = {
    "walk": Capture("poser", 0.86, 120, 4.0, _way(1.2), _gait(4.0, 1.1, 0.62), _even(0.12)),
    "walk-curve": Capture("lafan1", 0.8, 30, 4.0, _way(0.9, 0.0, 0.6), _gait(4.0, 1.2, 0.62),
                          _even(0.12)),
    "circle": Capture("mixamo", 0.92, 60, 7.0, _way(0.7, 0.0, 0.95), _gait(7.0, 1.2, 0.65),
                      _even(0.1)),
    "turn-in-place": Capture("rigify", 0.72, 24, 4.0, _way(0.0, 0.0, 0.8), _gait(4.0, 1.2, 0.7),
                             _even(0.1)),
    "run": Capture("xsens", 0.88, 240, 2.5, _way(3.0), _gait(2.5, 0.68, 0.36), _even(0.1)),
    "run-curve": Capture("rokoko", 0.83, 100, 2.5, _way(2.4, 0.0, 0.8), _gait(2.5, 0.7, 0.36),
                         _even(0.1)),
    "jump": Capture("max-biped", 0.8, 50, 2.5, _leap(0.0, 0.0, 1.0, 0.45), _jump(1.0, 0.45, 2.5),
                    _hump(0.8, 0.15, 0.2)),
    "jump-turn": Capture("makehuman", 0.85, 60, 2.5, _leap(0.5, 1.6, 1.0, 0.5),
                         _jump(1.0, 0.5, 2.5), _hump(0.8, 0.15, 0.2)),
    "sit": Capture("cmu-acclaim", 0.86, 120, 4.0, _way(0.0), _jump(9.0, 0.1, 9.0),
                   _hump(2.0, 0.7, 0.4)),
    "backwards": Capture("perception-neuron", 0.78, 90, 4.0, _way(-0.6, 0.1), _gait(4.0, 1.2, 0.65),
                         _even(0.1)),
}  # fmt: skip


def make(name: str) -> tuple[Clip, np.ndarray]:
    """The clip of a capture, and (F, 2) the frames in which its feet stand, left and right."""
    capture = CAPTURES[name]
    leg, t = capture.leg, np.arange(round(capture.length * capture.rate)) / capture.rate
    thigh, ankle, foot, hip = 0.52 * leg, 0.09 * leg, 0.17 * leg, 0.11 * leg
    skeleton = _skeleton(capture.names, leg, thigh, ankle, foot, hip)
    base = capture.path(t)
    planted = np.zeros((len(t), 2), dtype=bool)
    places, pitches, yaws = np.empty((len(t), 2, 3)), np.empty((len(t), 2)), np.empty((len(t), 2))
    for i, sign in enumerate((1.0, -1.0)):
        stances = capture.stances[i]
        at = capture.path(np.array(stances).mean(axis=1))
        at[:, :2] += sign * hip * np.column_stack([-np.sin(at[:, 2]), np.cos(at[:, 2])])
        for k, (a, b) in enumerate(stances):
            stands = (t >= a) & (t < b)
            planted[stands, i] = True
            places[stands, i], pitches[stands, i] = _rolling(t[stands], a, b, at[k], ankle, foot)
            yaws[stands, i] = at[k, 2]
            if k + 1 == len(stances):
                continue
            swing, end = (t >= b) & (t < stances[k + 1][0]), stances[k + 1][0]
            first, p0 = _rolling(np.array([b]), a, b, at[k], ankle, foot)
            last, p1 = _rolling(np.array([end]), *stances[k + 1], at[k + 1], ankle, foot)
            u = (t[swing] - b) / (end - b)
            way = (3.0 * u**2 - 2.0 * u**3)[:, None]
            places[swing, i] = first + way * (last - first)
            flies = all(b == other for other, _ in [(capture.stances[1 - i][k][1], 0)])
            rise = 0.5 * GRAVITY * (end - b) ** 2 * u * (1 - u) if flies else 0.4 * u * (1 - u)
            places[swing, i, 2] += rise
            pitches[swing, i] = p0 + way[:, 0] * (p1 - p0)
            yaws[swing, i] = at[k, 2] + way[:, 0] * (at[k + 1, 2] - at[k, 2])
    pelvis = np.column_stack([base[:, :2], ankle + leg * (1.0 - capture.low(t))])
    both = ~planted.any(axis=1)
    pelvis[both, 2] += places[both, :, 2].min(axis=1) - ankle if "jump" in name else 0.0
    pelvis[:, :2] -= 0.5 * np.maximum(capture.low(t) - 0.25, 0)[:, None] * [1.0, 0.0]  # sits back
    local = _angles(skeleton, base[:, 2], pelvis, places, pitches, yaws, thigh, leg - thigh, hip)
    return Clip(name, skeleton, 1.0 / capture.rate, pelvis, local), planted


def _rolling(
    t: np.ndarray, a: float, b: float, at: np.ndarray, ankle: float, foot: float
) -> tuple[np.ndarray, np.ndarray]:
    """Ankles (n, 3) and pitches (n,), toes down, of a foot that lands on its heel and leaves on its
    toe, where these take less than a second."""
    brief = b - a < 2.0
    down = -0.25 * np.clip(1.0 - (t - a) / 0.08, 0.0, 1.0) * brief
    up = 0.7 * np.clip(1.0 - (b - t) / (0.3 * (b - a)), 0.0, 1.0) ** 2 * brief
    ahead = np.array([np.cos(at[2]), np.sin(at[2]), 0.0])
    flat = np.append(at[:2], ankle)
    toe = flat + foot * ahead - [0.0, 0.0, 0.7 * ankle]
    back, high = (foot * np.cos(up) - 0.7 * ankle * np.sin(up), 0.7 * ankle * np.cos(up)
                  + foot * np.sin(up))  # fmt: skip
    return toe - back[:, None] * ahead + high[:, None] * [0.0, 0.0, 1.0], up + down


def _angles(
    skeleton: Skeleton, yaw: np.ndarray, pelvis: np.ndarray, places: np.ndarray,
    pitches: np.ndarray, yaws: np.ndarray, thigh: float, shank: float, hip: float,
) -> np.ndarray:  # fmt: skip
    """Local rotations (F, J, 4): legs that reach, arms that swing a little."""
    count, found = len(yaw), {}
    body = Rotation.from_euler("z", yaw[:, None])
    found[0] = body
    for i, (sign, side) in enumerate(((1.0, "left"), (-1.0, "right"))):
        start = pelvis + body.apply([0.0, sign * hip, 0.0])
        way = places[:, i] - start
        far = np.linalg.norm(way, axis=1)
        reach = np.clip(far, abs(thigh - shank) + 1e-6, thigh + shank - 1e-6)
        bend = np.arccos((thigh**2 + reach**2 - shank**2) / (2.0 * thigh * reach))
        fold = np.arccos((shank**2 + reach**2 - thigh**2) / (2.0 * shank * reach))
        z = -way / far[:, None]
        y = body.apply([0.0, 1.0, 0.0])
        x = np.cross(y, z)
        x /= np.linalg.norm(x, axis=1, keepdims=True)
        frame = Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=2))
        hip_turn = frame * Rotation.from_euler("y", -bend[:, None])
        knee_turn = frame * Rotation.from_euler("y", fold[:, None])
        foot_turn = Rotation.from_euler("ZY", np.column_stack([yaws[:, i], pitches[:, i]]))
        chain = [skeleton.joint(f"{role}_{side}") for role in ("hip", "knee", "ankle")]
        found[chain[0]] = body.inv() * hip_turn
        found[chain[1]] = hip_turn.inv() * knee_turn
        found[chain[2]] = knee_turn.inv() * foot_turn
        swing = 0.3 * np.clip(-body.inv().apply(way)[:, 0], -1.0, 1.0)
        hang = np.full(count, -sign * 1.3)  # from a T pose
        shoulder = Rotation.from_euler("yx", np.column_stack([swing, hang]))
        found[skeleton.joint(f"shoulder_{side}")] = shoulder
    local = np.zeros((count, len(skeleton.names), 4))
    local[..., 0] = 1.0
    for joint, turn in found.items():
        local[:, joint] = from_scipy(turn, (count,))
    return local


def _skeleton(
    names: str, leg: float, thigh: float, ankle: float, foot: float, hip: float
) -> Skeleton:
    convention = CONVENTIONS[names]
    joints = list(convention.middle)
    parents = [-1, 0, 1, 2]
    offsets = [[0, 0, 0], [0, 0, 0.15], [0, 0, 0.45], [0, 0, 0.12]]
    ends = []
    chains = {
        convention.arms: (1, [[0, 0.2, 0.4], [0, 0.28, 0], [0, 0.25, 0]]),
        convention.legs: (0, [[0, hip, 0], [0, 0, -thigh], [0, 0, thigh - leg],
                              [foot, 0, -0.7 * ankle]]),
    }  # fmt: skip
    for chain, (parent, bones) in chains.items():  # depth first, as files have it
        for sign, side in zip((1.0, -1.0), convention.sides, strict=True):
            first = len(joints)
            joints += [name.format(side) for name in chain]
            parents += [parent, *range(first, first + len(chain) - 1)]
            offsets += [[x, sign * y, z] for x, y, z in bones]
            if chain == convention.legs:
                ends.append((len(joints) - 1, [0.4 * foot, 0.0, -0.3 * ankle]))
    return Skeleton(
        tuple(joints), np.array(parents), np.array(offsets, float),
        np.array([joint for joint, _ in ends]), np.array([end for _, end in ends]),
        ("ZYX",) * len(joints),
    )  # fmt: skip


if __name__ == "__main__":  # python -m tests.support.captures FOLDER: the files
    for capture in CAPTURES:
        write_bvh(make(capture)[0], Path(sys.argv[1]) / f"{capture}.bvh")
