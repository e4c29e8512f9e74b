"""A skeleton: a tree of joints with constant offsets, its forward kinematics, and link groups:
joints of any skeleton chosen by a rule, as a view of a data base is."""

from __future__ import annotations

from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cached_property

import numpy as np

from poise.configs.errors import ConfigError, shown

from .roles import ROLES, SIDES, find_roles, sided, way_up
from .rotations import multiply, rotate


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints in an order in which parents come first; the first is the root.

    In the rest pose every rotation is the identity; z is up and the skeleton faces x.

    Attributes:
        names: of the joints, all different.
        parents: (J,) index of the parent; −1 of the root.
        offsets: (J, 3) place in the parent's axes [m]; that of the root counts nothing.
        end_parents: (E,) joints on which an end site hangs.
        end_offsets: (E, 3) place of the end sites in the axes of these joints [m].
        orders: of the three rotations that a file gives for each joint, such as ``ZYX``.
        known: role → joint where this is known otherwise than by the names.
    """

    names: tuple[str, ...]
    parents: np.ndarray
    offsets: np.ndarray
    end_parents: np.ndarray
    end_offsets: np.ndarray
    orders: tuple[str, ...]
    known: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for array in (self.parents, self.offsets, self.end_parents, self.end_offsets):
            array.setflags(write=False)

    def global_pose(
        self, root: np.ndarray, local: np.ndarray, shifts: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Places (F, J, 3) [m] and orientations (F, J, 4) of the joints in the world.

        Q_i = Q_p q_i and p_i = p_p + Q_p l_i, with p the parent, from the root's places `root`
        (F, 3) and the rotations `local` (F, J, 4) relative to the parents. l are the offsets, or
        where joints move on their parents `shifts` (F, J, 3).
        """
        offsets = self.offsets if shifts is None else shifts
        places, turns = np.empty((*local.shape[:2], 3)), np.empty(local.shape)
        places[:, 0], turns[:, 0] = root, local[:, 0]
        for i, parent in enumerate(self.parents[1:], start=1):
            turns[:, i] = multiply(turns[:, parent], local[:, i])
            places[:, i] = places[:, parent] + rotate(turns[:, parent], offsets[..., i, :])
        return places, turns

    def ends(self, places: np.ndarray, turns: np.ndarray) -> np.ndarray:
        """Places (F, E, 3) [m] of the end sites, from those of `global_pose`."""
        joints = self.end_parents
        return places[:, joints] + rotate(turns[:, joints], self.end_offsets)

    @cached_property
    def rest(self) -> np.ndarray:
        """(J, 3) places of the joints in the rest pose, the root at the origin [m]."""
        identity = np.zeros((1, len(self.names), 4))
        identity[..., 0] = 1.0
        return self.global_pose(np.zeros((1, 3)), identity)[0][0]

    @cached_property
    def roles(self) -> dict[str, int]:
        """Role, such as ``knee_left``, → joint, as far as it is known or the names tell it."""
        return {**find_roles(self.names), **self.known}

    def same_as(self, other: Skeleton) -> bool:
        """True for the same names, parents and offsets, to a micrometre."""
        return (
            self.names == other.names
            and np.array_equal(self.parents, other.parents)
            and np.allclose(self.offsets[1:], other.offsets[1:], rtol=0.0, atol=1e-6)
        )

    def joint(self, role: str, source: str | None = None) -> int:
        """The joint of a role; raises ConfigError if no joint has a name that says it."""
        if role not in self.roles:
            raise ConfigError(
                f"no joint is called as a {role} is", source=source, field="joints",
                choices=self.names,
            )  # fmt: skip
        return self.roles[role]

    @cached_property
    def partners(self) -> np.ndarray:
        """(J,) the joint of the same name on the other side; the joint itself in the middle."""
        bases = sided(self.names)
        places = {base: i for i, base in enumerate(bases)}
        other = {"left": "right", "right": "left", "": ""}
        found = [places.get((base, other[side]), i) for i, (base, side) in enumerate(bases)]
        for role in [role for role in self.known if role.endswith("_left")]:
            pair = [self.known.get(f"{role.removesuffix('_left')}_{side}", -1) for side in SIDES]
            if min(pair) >= 0:
                found[pair[0]], found[pair[1]] = pair[1], pair[0]
        return np.array(found)

    @cached_property
    def leg_length(self) -> float:
        """Length of the way from ankle to hip along the joints between, mean of both legs [m]."""
        total = 0.0
        for side in SIDES:
            if f"ankle_{side}" not in self.roles or f"hip_{side}" not in self.roles:
                raise ConfigError("no legs are found by name: a hip, knee and ankle on each side",
                                  field="joints", choices=ROLES)  # fmt: skip
            joint = self.roles[f"ankle_{side}"]
            while joint not in (self.roles[f"hip_{side}"], -1):
                total += float(np.linalg.norm(self.offsets[joint]))
                joint = int(self.parents[joint])
        return total / len(SIDES)


@dataclass(frozen=True)
class LinkGroup:
    """A rule that selects joints: all that one of its parts selects, less what `exclude` matches.

    A joint is named by its name or by its role, such as ``shoulder_left``. Patterns have the
    shell's wildcards and look at names in small letters.

    Attributes:
        include: patterns of names.
        exclude: patterns of names that are left out.
        below: this joint and all that hang on it, each.
        between: two joints; those on the way from one to the other, both included.
    """

    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    below: tuple[str, ...] = ()
    between: tuple[str, str] | None = None

    def joints(self, skeleton: Skeleton) -> np.ndarray:
        """The sorted indices of the joints that the rule selects in this skeleton.

        Raises:
            ConfigError: a joint or role that the skeleton lacks, or a rule that selects nothing.
        """
        names = [name.lower() for name in skeleton.names]
        chosen = {i for i, name in enumerate(names) if _matches(name, self.include)}
        for name in self.below:
            top = _named(skeleton, name)
            chosen |= {i for i in range(len(names)) if top in way_up(skeleton.parents, i)}
        if self.between is not None:
            chosen |= _way(skeleton, *(_named(skeleton, name) for name in self.between))
        chosen = {i for i in chosen if not _matches(names[i], self.exclude)}
        if not chosen:
            raise ConfigError("selects no joint", field="group", choices=skeleton.names)
        return np.array(sorted(chosen))


#: groups by name, for any skeleton whose joints have roles
GROUPS = {
    "left_arm": LinkGroup(below=("shoulder_left",)),
    "right_arm": LinkGroup(below=("shoulder_right",)),
    "arms": LinkGroup(below=("shoulder_left", "shoulder_right")),
    "left_leg": LinkGroup(below=("hip_left",)),
    "right_leg": LinkGroup(below=("hip_right",)),
    "legs": LinkGroup(below=("hip_left", "hip_right")),
    "head": LinkGroup(below=("head",)),
}


def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern.lower()) for pattern in patterns)


def _named(skeleton: Skeleton, name: str) -> int:
    if name in skeleton.names:
        return skeleton.names.index(name)
    if name in skeleton.roles:
        return skeleton.roles[name]
    choices = (*skeleton.names, *(role for role in ROLES if role in skeleton.roles))
    raise ConfigError(f"no joint is called {shown(name)}", field="group", choices=choices)


def _way(skeleton: Skeleton, a: int, b: int) -> set[int]:
    up_a, up_b = way_up(skeleton.parents, a), way_up(skeleton.parents, b)
    meeting = next(joint for joint in up_a if joint in up_b)
    return {*up_a[: up_a.index(meeting) + 1], *up_b[: up_b.index(meeting)]}
