"""Link groups: joints of any skeleton chosen by a rule, as a view of a data base is."""

from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from poise.configs.errors import ConfigError, shown

from .roles import ROLES
from .skeleton import Skeleton


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
            chosen |= {i for i in range(len(names)) if top in skeleton.way_up(i)}
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
    up_a, up_b = skeleton.way_up(a), skeleton.way_up(b)
    meeting = next(joint for joint in up_a if joint in up_b)
    return {*up_a[: up_a.index(meeting) + 1], *up_b[: up_b.index(meeting)]}
