"""BVH files in and out, by the library pybvh; nothing else imports it."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from poise.configs.errors import ConfigError, shown
from poise.configs.extras import how_to_install
from poise.configs.files import write_atomic
from poise.configs.reading import parsing

from .axes import FileAxes, axes_of, named_unit, nearest_axis, unit_from_legs
from .bvh_text import check_bvh
from .clip import Clip
from .rotations import from_scipy, to_scipy
from .skeleton import SIDES, Skeleton, find_roles, leg_length

if TYPE_CHECKING:
    from pybvh import Bvh

Y_UP = axes_of("y", "z")  # what most programs write


class BvhFile(NamedTuple):
    """A clip, and how its file's axes and unit were understood."""

    clip: Clip
    axes: FileAxes


def read_bvh(
    path: str | Path, unit: str = "auto", up: str = "auto", forward: str = "auto"
) -> BvhFile:
    """The clip of a BVH file, its z axis up, x forward in the rest pose, in metres.

    Args:
        path: a file whose name ends in ``.bvh``.
        unit: ``m``, ``cm``, ``mm``, ``dm``, ``inch``, a length in metres, or ``auto``: metre or
            centimetre if legs are then as long as a person's, else what makes them 0.8 m long.
        up: the file's axis that is up, such as ``y``; ``auto``: where the hips are above the feet.
        forward: where the rest pose faces; ``auto``: square to the line of its hips.

    Raises:
        ConfigError: no such file, no BVH file (the text names the line), more than the bounds of
            `check_bvh`, pybvh is missing; with ``auto``, legs that are not known by name.
    """
    path = Path(path)
    if path.suffix != ".bvh":
        raise ConfigError("must be the name of a .bvh file", source=path, choices=("*.bvh",))
    check_bvh(path)
    file = _parsed(path)
    joints = [node for node in file.nodes if not node.is_end_site()]
    index = {id(node): i for i, node in enumerate(joints)}
    ends = [node for node in file.nodes if node.is_end_site()]
    names = tuple(node.name for node in joints)
    parents = np.array([index.get(id(node.parent), -1) for node in joints])
    offsets = np.array([node.offset for node in joints])
    orders = tuple("".join(node.rot_channels) for node in joints)
    turns = _quaternions(file.joint_angles, orders)
    places = np.empty_like(file.root_pos)
    for column, axis in enumerate(file.root.pos_channels):
        places[:, "XYZ".index(axis)] = file.root_pos[:, column]
    end_offsets = np.array([node.offset for node in ends]).reshape(-1, 3)
    raw = Skeleton(names, parents, offsets, np.array([index[id(n.parent)] for n in ends], int),
                   end_offsets, orders)  # fmt: skip
    axes = _axes(raw, places, turns, unit, up, forward, str(path))
    skeleton = Skeleton(names, parents, axes.places(offsets), raw.end_parents,
                        axes.places(end_offsets), orders)  # fmt: skip
    clip = Clip(path.stem, skeleton, float(file.frame_time), axes.places(places),
                axes.turns(turns))  # fmt: skip
    return BvhFile(clip, axes)


def write_bvh(clip: Clip, path: str | Path, axes: FileAxes = Y_UP) -> None:
    """Write a clip, with six decimals, in the axes and the unit of `axes`: y up, z forward, metres.

    Raises:
        ConfigError: the name does not end in ``.bvh``, or pybvh is missing.
        PoiseError: the file cannot be written.
    """
    if Path(path).suffix != ".bvh":
        raise ConfigError("must be the name of a .bvh file", source=path, choices=("*.bvh",))
    from_clip = _library().Bvh(
        nodes=_nodes(clip.skeleton, axes),
        root_pos=axes.file_places(clip.root),
        joint_angles=_angles(axes.file_turns(clip.rotations), clip.skeleton.orders),
        frame_time=clip.dt,
        world_up=_signed(axes.names[0]),
    )
    with tempfile.TemporaryDirectory() as folder:
        part = Path(folder) / "clip.bvh"
        from_clip.write(part)
        write_atomic(path, part.read_bytes())


def _library():  # a module
    try:
        import pybvh
    except ImportError:
        raise ConfigError(f"needs the package pybvh: {how_to_install('motion')}",
                          source="motion") from None  # fmt: skip
    return pybvh


def _parsed(path: Path) -> Bvh:
    library = _library()
    with parsing(path, "is no BVH file"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return library.read_bvh_file(path, world_up="+y")


def _quaternions(angles: np.ndarray, orders: tuple[str, ...]) -> np.ndarray:
    """(F, J, 4) rotations from Euler angles (F, J, 3) [rad] about the moving axes of `orders`."""
    turns = np.empty((*angles.shape[:2], 4))
    for order in set(orders):
        chosen = [i for i, each in enumerate(orders) if each == order]
        rotation = Rotation.from_euler(order, angles[:, chosen].reshape(-1, 3))
        turns[:, chosen] = from_scipy(rotation, (len(angles), len(chosen)))
    return turns


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
    """Axes and unit as they are given, or as legs, hips and feet tell them."""
    roles = find_roles(raw.names)
    if "auto" in (unit, up, forward):
        missing = [f"{joint}_{side}" for joint in ("hip", "knee", "ankle") for side in SIDES]
        missing = [role for role in missing if role not in roles]
        if missing:
            raise ConfigError(
                f"no joint is called as {shown(missing[0])} is: name unit, up and forward",
                source=source, field="joints", choices=raw.names,
            )  # fmt: skip
    length = named_unit(unit, source) if unit != "auto" else _unit(raw, roles, source)
    pose = raw.global_pose(places[::10], turns[::10])[0].mean(axis=0)
    if up == "auto":
        up = nearest_axis(_middle(pose, roles, "hip") - _middle(pose, roles, "ankle"))
    if forward == "auto":
        across = raw.rest[roles["hip_left"]] - raw.rest[roles["hip_right"]]
        forward = nearest_axis(np.cross(across, axes_of(*_any_forward(up)).matrix[2]))
    return axes_of(up, forward, length, source)


def _any_forward(up: str) -> tuple[str, str]:
    return up, "x" if up[-1] != "x" else "y"


def _unit(raw: Skeleton, roles: dict[str, int], source: str) -> float:
    length = leg_length(raw.offsets, raw.parents, roles)
    if length < 1e-9:
        raise ConfigError("its legs have no length: name the unit", source=source, field="unit")
    return unit_from_legs(length)


def _middle(pose: np.ndarray, roles: dict[str, int], joint: str) -> np.ndarray:
    return 0.5 * (pose[roles[f"{joint}_left"]] + pose[roles[f"{joint}_right"]])


def _signed(axis: str) -> str:
    return axis if axis.startswith("-") else f"+{axis}"


def _nodes(skeleton: Skeleton, axes: FileAxes) -> list[object]:
    """pybvh's tree of a skeleton, depth first, as files have it."""
    library = _library()
    offsets, tips = axes.file_places(skeleton.offsets), axes.file_places(skeleton.end_offsets)
    nodes: list[object] = []
    made: dict[int, object] = {}
    for i, (name, parent) in enumerate(zip(skeleton.names, skeleton.parents, strict=True)):
        order, above = list(skeleton.orders[i]), made.get(int(parent))
        if above is None:
            made[i] = library.bvhnode.BvhRoot(name, offsets[i], list("XYZ"), order, [], None)
        else:
            made[i] = library.bvhnode.BvhJoint(name, offsets[i], order, [], above)
            above.children = [*above.children, made[i]]  # type: ignore[attr-defined]
        nodes.append(made[i])
        for k in np.flatnonzero(skeleton.end_parents == i):
            end = library.bvhnode.BvhEndSite(f"EndSite{name}", tips[k], made[i])
            made[i].children = [*made[i].children, end]  # type: ignore[attr-defined]
            nodes.append(end)
    return nodes
