"""A skeleton: a tree of joints with constant offsets, and its forward kinematics."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from poise.configs.errors import ConfigError

from .roles import ROLES, SIDES, find_roles, sided
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

    def way_up(self, joint: int) -> list[int]:
        """A joint, its parent, and so on to the root."""
        way = [joint]
        while (joint := int(self.parents[joint])) >= 0:
            way.append(joint)
        return way

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
