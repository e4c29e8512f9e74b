"""From the channels of a BVH file to a rigid skeleton that hangs on its hips, and how it moves."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from poise.configs.errors import ConfigError, shown

from .bvh_text import BvhText
from .rotations import IDENTITY, angle_between, from_scipy, inverse, multiply, rotate
from .skeleton import Skeleton

RIGID = 0.02  # of the skeleton's size: by which a joint may move on its parent
STILL = np.radians(1.0)  # by which a joint that stands still may turn


@dataclass(frozen=True, eq=False)
class Posed:
    """A skeleton, in the file's axes and unit, and its motion.

    Attributes:
        skeleton: its `offsets` are the means over the frames.
        root: (F, 3) places of the root.
        turns: (F, J, 4) rotations relative to the parents.
        shifts: (F, J, 3) places relative to the parents.
    """

    skeleton: Skeleton
    root: np.ndarray
    turns: np.ndarray
    shifts: np.ndarray


def unrooted(text: BvhText) -> Posed:
    """The motion of all joints, as the file has them."""
    count, joints = len(text.values), len(text.names)
    turns, shifts = np.zeros((count, joints, 4)), np.tile(text.offsets, (count, 1, 1))
    turns[..., 0] = 1.0
    orders, at, moving = [], 0, []
    for joint, channels in enumerate(text.channels):
        values = dict(zip(channels, text.values[:, at : at + len(channels)].T, strict=True))
        at += len(channels)
        order = "".join(name[0] for name in channels if name.endswith("rotation"))
        order += "".join(axis for axis in "ZXY" if axis not in order)
        orders.append(order)
        if any(name.endswith("rotation") for name in channels):
            none = np.zeros(count)
            angles = np.stack([values.get(f"{axis}rotation", none) for axis in order], axis=1)
            turns[:, joint] = from_scipy(Rotation.from_euler(order, angles, degrees=True), (count,))
        placed = [axis for axis in "XYZ" if f"{axis}position" in values]
        for axis in placed:
            shifts[:, joint, "XYZ".index(axis)] = values[f"{axis}position"]
        moving += [joint] if placed else []
    moving = [joint for joint in moving if joint]
    _add_offsets(text, shifts, moving)
    offsets = text.offsets.copy()
    offsets[moving] = shifts[:, moving].mean(axis=0)
    skeleton = Skeleton(text.names, text.parents, offsets, text.end_parents, text.end_offsets,
                        tuple(orders))  # fmt: skip
    return Posed(skeleton, shifts[:, 0].copy(), turns, shifts)


def _add_offsets(text: BvhText, shifts: np.ndarray, moving: list[int]) -> None:
    """Add the offsets where the positions are counted from them, as a few programs do.

    In most files a position stands in the offset's place, so that bones at rest have it equal.
    """
    offsets, means = text.offsets[moving], shifts[:, moving].mean(axis=0)
    if np.linalg.norm(means) < np.linalg.norm(means - offsets):
        shifts[:, moving] += offsets


def rooted_at_hips(posed: Posed, roles: dict[str, int]) -> Posed:
    """The part of the skeleton that has all `roles`, on the joint that they have in common.

    Without roles, the root and joints below it that have one child are left out. What moves those
    above moves the new root. Where they only turn the skeleton, its rest pose is turned, too.
    """
    old = posed.skeleton
    ways = [old.way_up(joint) for joint in roles.values()]
    shared = [joint for joint in ways[0] if all(joint in way for way in ways)] if ways else []
    # the joint on which all that have roles hang
    top = shared[0] if shared else _first_branch(old.parents)
    if top == 0:
        return _kept(posed, np.arange(len(old.names)), roles)
    places, turns = old.global_pose(posed.root, posed.turns, posed.shifts)
    above = turns[:, int(old.parents[top])]
    still = float(angle_between(above, above[:1]).max()) < STILL
    rest = above[0] if still else IDENTITY
    local = multiply(multiply(rest, posed.turns), inverse(rest))
    local[:, top] = multiply(turns[:, top], inverse(rest))
    kept = [joint for joint in range(len(old.parents)) if top in old.way_up(joint)]
    turned = replace(old, offsets=rotate(rest, old.offsets),
                     end_offsets=rotate(rest, old.end_offsets))  # fmt: skip
    moved = Posed(turned, places[:, top], local, rotate(rest, posed.shifts))
    return _kept(moved, np.array(kept), roles)


def _kept(posed: Posed, kept: np.ndarray, roles: dict[str, int]) -> Posed:
    """The part of a skeleton whose joints are `kept`, the first of them its root."""
    old, index = posed.skeleton, {int(joint): i for i, joint in enumerate(kept)}
    ends = [i for i, joint in enumerate(old.end_parents) if int(joint) in index]
    own = old.offsets[kept]
    own[0] *= kept[0] == 0  # that of a root that hung on another counts nothing
    skeleton = Skeleton(
        tuple(old.names[joint] for joint in kept),
        np.array([index.get(int(old.parents[joint]), -1) for joint in kept]),
        own,
        np.array([index[int(old.end_parents[end])] for end in ends], int),
        old.end_offsets[ends],
        tuple(old.orders[joint] for joint in kept),
        {role: index[joint] for role, joint in roles.items() if joint in index},
    )
    return Posed(skeleton, posed.root, posed.turns[:, kept], posed.shifts[:, kept])


def rigid(posed: Posed, source: str) -> Posed:
    """The same; raises ConfigError where a joint moves on its parent."""
    size = np.linalg.norm(np.ptp(posed.skeleton.rest, axis=0))
    ways = np.abs(posed.shifts - posed.skeleton.offsets).max(axis=(0, 2))
    ways[0] = 0.0  # the root does
    worst = int(np.argmax(ways))
    if ways[worst] > RIGID * size:
        raise ConfigError(
            f"the joint {shown(posed.skeleton.names[worst])} moves by {ways[worst]:.3g} units on "
            "its parent, as no bone does: export rotations alone, and positions of the root",
            source=source,
            field="joints",
        )
    return posed


def _first_branch(parents: np.ndarray) -> int:
    """The first joint, from the root on, that has other than one child."""
    joint = 0
    while len(children := np.flatnonzero(parents == joint)) == 1:
        joint = int(children[0])
    return joint if len(children) else 0
