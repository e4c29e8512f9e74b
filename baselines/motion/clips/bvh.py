"""BVH files in and out; what is written is written by the library pybvh."""

import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.extras import needing
from poise.configs.files import write_atomic

from .axes import FileAxes, named_axes, named_unit, nearest_axis, unit_from_legs
from .bvh_pose import rigid, rooted_at_hips, unrooted
from .bvh_text import read_bvh_text
from .clip import Clip
from .roles import ROLES, SIDES, find_roles, structural_roles
from .rotations import to_scipy
from .skeleton import Skeleton

ALONE = 4.0  # times the largest move between frames: that of a first frame that is the rest pose
Y_UP = named_axes("y", "z")  # what most programs write
LEGS = tuple(f"{joint}_{side}" for joint in ("hip", "knee", "ankle") for side in SIDES)


class BvhFile(NamedTuple):
    """A clip, and how its file's axes and unit were understood."""

    clip: Clip
    axes: FileAxes


def read_bvh(
    path: str | Path,
    unit: str = "auto",
    up: str = "auto",
    forward: str = "auto",
    joints: Mapping[str, str] | None = None,
) -> BvhFile:
    """The clip of a BVH file, its z axis up, x forward in the rest pose, in metres.

    Joints above the hips, and beside them, are left out; what moves them moves the hips. Positions
    of other joints must be those of rigid bones. A first frame four times as far from the second as
    any two others are from each other is the rest pose, and left out.

    Args:
        path: a file whose name ends in ``.bvh``.
        unit: ``m``, ``cm``, ``mm``, ``dm``, ``inch``, a length in metres, or ``auto``: the one in
            which legs are as long as a person's, else what makes them 0.8 m long.
        up: the file's axis that is up, such as ``y``; ``auto``: where the hips are above the feet.
        forward: where the rest pose faces; ``auto``: square to the line of its hips.
        joints: role, one of `ROLES`, → name of the joint, where neither the names nor the structure
            tell it.

    Raises:
        ConfigError: no such file, no BVH file (the text names the line), more than the bounds of
            `read_bvh_text`, bones that are not rigid; with ``auto``, legs that are not known.
    """
    path, source = Path(path), str(path)
    if path.suffix.lower() != ".bvh":
        raise ConfigError("must be the name of a .bvh file", source=path, choices=("*.bvh",))
    text = read_bvh_text(path)
    whole = unrooted(text)
    known = find_roles(text.names)
    if len(known.keys() & set(LEGS)) < len(LEGS):
        frames = slice(None, None, 10)
        places, turns = whole.skeleton.global_pose(whole.root[frames], whole.turns[frames])
        ends = whole.skeleton.ends(places, turns)
        sure = structural_roles(text.parents, text.offsets, text.end_parents, places, ends)
        known = {**sure, **known} if not known.keys() & set(LEGS) else known
    known |= _named(joints or {}, text.names, source)
    legs = known.keys() >= set(LEGS)  # what hangs on a neck alone is no skeleton
    posed = rigid(rooted_at_hips(whole, known if legs else {}), source)
    raw, places, turns = posed.skeleton, posed.root, posed.turns
    axes = _axes(raw, places, turns, unit, up, forward, source)
    skeleton = replace(raw, offsets=axes.places(raw.offsets),
                       end_offsets=axes.places(raw.end_offsets))  # fmt: skip
    clip = Clip(path.stem, skeleton, text.dt, axes.places(places), axes.turns(turns))
    return BvhFile(_begun(clip), axes)


def _begun(clip: Clip) -> Clip:
    """The clip without a first frame that is no part of it: the rest pose, as CMU's files have."""
    moved = np.linalg.norm(np.diff(clip.places(), axis=0), axis=2).max(axis=1)
    alone = len(clip) > 8 and moved[0] > max(ALONE * moved[1:].max(), 0.1)
    return clip.part(slice(1, None)) if alone else clip


def _named(joints: Mapping[str, str], names: tuple[str, ...], source: str) -> dict[str, int]:
    """Role → joint, as a user names them."""
    for role, name in joints.items():
        if role not in ROLES:
            raise ConfigError(f"no such role: {shown(role)}", source=source, field="joints",
                              choices=ROLES)  # fmt: skip
        if name not in names:
            raise ConfigError(f"no joint is called {shown(name)}", source=source,
                              field=f"joints.{role}", choices=names)  # fmt: skip
    return {role: names.index(name) for role, name in joints.items()}


def write_bvh(clip: Clip, path: str | Path, axes: FileAxes = Y_UP) -> None:
    """Write a clip, with six decimals, in the axes and the unit of `axes`: y up, z forward, metres.

    Raises:
        ConfigError: the name does not end in ``.bvh``, or pybvh is missing.
        PoiseError: the file cannot be written.
    """
    if Path(path).suffix.lower() != ".bvh":
        raise ConfigError("must be the name of a .bvh file", source=path, choices=("*.bvh",))
    clip, up = depth_first(clip), axes.names[0]
    with needing("motion", "motion"):
        from pybvh import Bvh
    from_clip = Bvh(
        nodes=_nodes(clip.skeleton, axes),
        root_pos=axes.file_places(clip.root),
        joint_angles=_angles(axes.file_turns(clip.rotations), clip.skeleton.orders),
        frame_time=clip.dt,
        world_up=up if up.startswith("-") else f"+{up}",
    )
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "clip.bvh"
        from_clip.write(part)
        # the sign of a zero is that of rounding, which differs between processors
        write_atomic(path, part.read_bytes().replace(b"-0.000000", b"0.000000"))


def depth_first(clip: Clip) -> Clip:
    """The clip with its joints in the order of a file: all that hangs on a joint follows it."""
    skeleton, order, left = clip.skeleton, [], [0]
    while left:
        order.append(left.pop())
        left += reversed(np.flatnonzero(skeleton.parents == order[-1]).tolist())
    if order == list(range(len(order))):
        return clip
    places = {old: new for new, old in enumerate(order)}
    moved = replace(
        skeleton,
        names=tuple(skeleton.names[i] for i in order),
        parents=np.array([places.get(int(skeleton.parents[i]), -1) for i in order]),
        offsets=skeleton.offsets[order],
        end_parents=np.array([places[int(i)] for i in skeleton.end_parents]),
        orders=tuple(skeleton.orders[i] for i in order),
        known={role: places[i] for role, i in skeleton.known.items()},
    )
    return replace(clip, skeleton=moved, rotations=clip.rotations[:, order])


def _angles(turns: np.ndarray, orders: tuple[str, ...]) -> np.ndarray:
    """The Euler angles (F, J, 3) [rad] of rotations (F, J, 4)."""
    angles = np.empty((*turns.shape[:2], 3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # gimbal lock: one of many answers is as good as another
        for order in set(orders):
            chosen = [i for i, each in enumerate(orders) if each == order]
            found = to_scipy(turns[:, chosen]).as_euler(order)
            angles[:, chosen] = found.reshape(len(turns), len(chosen), 3)
    return angles


def _axes(
    raw: Skeleton, places: np.ndarray, turns: np.ndarray, unit: str, up: str, forward: str,
    source: str,
) -> FileAxes:  # fmt: skip
    """Return axes and unit as given, or inferred from legs, hips and feet."""
    roles = raw.roles
    if "auto" in (unit, up, forward):
        missing = [role for role in LEGS if role not in roles]
        if missing:
            raise ConfigError(
                f"no joint is called as {shown(missing[0])} is, and the structure does not tell: "
                f"name it, {missing[0]}=JOINT (--joints), or unit, up and forward",
                source=source, field="joints", choices=raw.names,
            )  # fmt: skip
    if unit != "auto":
        length = named_unit(unit, source)
    elif raw.leg_length < 1e-9:
        raise ConfigError("its legs have no length: name the unit", source=source, field="unit")
    else:
        length = unit_from_legs(raw.leg_length)
    pose = raw.global_pose(places[::10], turns[::10])[0].mean(axis=0)
    if up == "auto":
        up = nearest_axis(_middle(pose, roles, "hip") - _middle(pose, roles, "ankle"))
    if forward == "auto":
        across = raw.rest[roles["hip_left"]] - raw.rest[roles["hip_right"]]
        any_forward = "x" if up[-1] != "x" else "y"
        forward = nearest_axis(np.cross(across, named_axes(up, any_forward).matrix[2]))
    return named_axes(up, forward, length, source)


def _middle(pose: np.ndarray, roles: dict[str, int], joint: str) -> np.ndarray:
    return 0.5 * (pose[roles[f"{joint}_left"]] + pose[roles[f"{joint}_right"]])


def _nodes(skeleton: Skeleton, axes: FileAxes) -> list[object]:
    """pybvh's tree of a skeleton whose joints are depth first, as files have them."""
    from pybvh import bvhnode  # it is there: `write_bvh` has used it

    offsets, tips = axes.file_places(skeleton.offsets), axes.file_places(skeleton.end_offsets)
    nodes: list[object] = []
    made: dict[int, object] = {}
    for i, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents, strict=True)):
        order, above = list(skeleton.orders[i]), made.get(int(parent))
        if above is None:
            made[i] = bvhnode.BvhRoot(name, offsets[i], list("XYZ"), order, [], None)
        else:
            made[i] = bvhnode.BvhJoint(name, offsets[i], order, [], above)
            above.children = [*above.children, made[i]]  # type: ignore[attr-defined]
        nodes.append(made[i])
        for k in np.flatnonzero(skeleton.end_parents == i):
            end = bvhnode.BvhEndSite(f"EndSite{name}", tips[k], made[i])
            made[i].children = [*made[i].children, end]  # type: ignore[attr-defined]
            nodes.append(end)
    return nodes
