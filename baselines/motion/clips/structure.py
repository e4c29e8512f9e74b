"""Roles of joints by the shape of a skeleton alone, where its names say nothing."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .names import SIDES

ALIKE = 0.03  # of a length: between bones that mirror each other
LEG, ARM = ("hip", "knee", "ankle", "toe"), ("shoulder", "elbow", "wrist")
CERTAIN = 0.8  # of the frames in which the feet must point to the same side


def structural_roles(
    parents: np.ndarray,
    offsets: np.ndarray,
    end_parents: np.ndarray,
    places: np.ndarray,
    ends: np.ndarray,
) -> dict[str, int]:
    """Role → joint, of what is sure; else none.

    Limbs are pairs of chains of equal bones on one joint. The legs are the pair nearest to the
    root, the arms the next one; thigh and shank, upper arm and forearm are a chain's two longest
    neighbours. The feet point forward, which tells left from right.

    Args:
        parents: (J,) of the joints.
        offsets: (J, 3) from the parents.
        end_parents: (E,) joints of the end sites.
        places: (F, J, 3) of the joints in some frames.
        ends: (F, E, 3) of the end sites.
    """
    limbs = sorted(_limbs(parents, offsets), key=lambda pair: _depth(parents, pair[0][0]))
    legs = next(iter(limbs), None)
    if legs is None:
        return {}
    found = [_bones(chain, offsets, len(LEG)) for chain in legs]
    ahead = [_ahead(bones, places, end_parents, ends) for bones in found]
    hips, ankles = places[:, [b[0] for b in found]], places[:, [b[2] for b in found]]
    up = (hips - ankles).mean(axis=1)
    left = np.cross(up, ahead[0] + ahead[1])
    signs = np.einsum("fi,fi->f", left, hips[:, 0] - hips[:, 1])
    share = float(np.mean(signs > 0.0))
    if max(share, 1.0 - share) < CERTAIN or np.abs(signs).max() < 1e-12:
        return {}
    sides = SIDES if share > 0.5 else SIDES[::-1]
    roles = {f"{role}_{side}": joint for side, bones in zip(sides, found, strict=True)
             for role, joint in zip(LEG, bones, strict=False)}  # fmt: skip
    return {**roles, **_arms(limbs[1:], offsets, places, hips, sides)}


def _arms(
    limbs: list[tuple[list[int], list[int]]], offsets: np.ndarray, places: np.ndarray,
    hips: np.ndarray, sides: tuple[str, ...],
) -> dict[str, int]:  # fmt: skip
    """The arms are on the sides on which the hips are."""
    if not limbs:
        return {}
    found = [_bones(chain, offsets, len(ARM)) for chain in limbs[0]]
    across = places[:, found[0][0]] - places[:, found[1][0]]
    same = np.einsum("fi,fi->f", across, hips[:, 0] - hips[:, 1]).sum() > 0.0
    return {f"{role}_{side}": joint
            for side, bones in zip(sides if same else sides[::-1], found, strict=True)
            for role, joint in zip(ARM, bones, strict=False)}  # fmt: skip


def _limbs(parents: np.ndarray, offsets: np.ndarray) -> Iterator[tuple[list[int], list[int]]]:
    """Pairs of chains of three or more joints, on one joint, whose bones are as long."""
    chains: dict[int, list[list[int]]] = {}
    for joint, parent in enumerate(parents):
        if parent >= 0:
            chains.setdefault(int(parent), []).append(_chain(joint, parents, offsets))
    for on_one in chains.values():
        long = [chain for chain in on_one if len(chain) >= len(ARM)]
        for i, first in enumerate(long):
            for second in long[i + 1 :]:
                if _mirrored(first, second, offsets):
                    yield first, second


def _chain(joint: int, parents: np.ndarray, offsets: np.ndarray) -> list[int]:
    """A joint and its way to the joint that is furthest from it along the bones."""
    children = [int(child) for child in np.flatnonzero(parents == joint)]
    ways = [_chain(child, parents, offsets) for child in children]
    lengths = [np.linalg.norm(offsets[way], axis=1).sum() for way in ways]
    return [joint, *(ways[int(np.argmax(lengths))] if ways else [])]


def _mirrored(first: list[int], second: list[int], offsets: np.ndarray) -> bool:
    if len(first) != len(second):
        return False
    one, other = (np.linalg.norm(offsets[chain], axis=1) for chain in (first, second))
    return bool(np.abs(one - other).max() <= ALIKE * one.max())


def _bones(chain: list[int], offsets: np.ndarray, count: int) -> list[int]:
    """Up to `count` joints, the first of which has the longest two bones of the chain after it."""
    lengths = np.linalg.norm(offsets[chain[1:]], axis=1)
    first = int(np.argmax(lengths[:-1] + lengths[1:]))
    return chain[first : first + count]


def _ahead(
    bones: list[int], places: np.ndarray, end_parents: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """(F, 3) from an ankle to its toe, or to the end of its foot."""
    if len(bones) > 3:
        return places[:, bones[3]] - places[:, bones[2]]
    tips = np.flatnonzero(end_parents == bones[2])
    if len(tips) == 0:
        return np.zeros_like(places[:, 0])
    return ends[:, tips].mean(axis=1) - places[:, bones[2]]


def _depth(parents: np.ndarray, joint: int) -> int:
    depth = 0
    while (joint := int(parents[joint])) >= 0:
        depth += 1
    return depth
