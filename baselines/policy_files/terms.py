"""What a policy sees: terms by the names of mjlab, Isaac Lab and legged_gym."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.envs.physics.state import RobotState
from poise.envs.robots.description import match_names

from .config import ObservationTerm


class Seen(NamedTuple):
    """All that terms are made from: n joints of the policy, na actions."""

    state: RobotState
    q: np.ndarray  # (n,) joint positions [rad]
    v: np.ndarray  # (n,) joint velocities [rad/s]
    default: np.ndarray  # (n,) posture that positions are relative to [rad]
    action: np.ndarray  # (na,) of the step before, zero at the start
    command: np.ndarray  # (3,) [m/s, m/s, rad/s]
    phase: float  # of the clock [rad]
    legs: np.ndarray  # (l,) the phase of each leg [rad]


def _turned(seen: Seen, vector: np.ndarray) -> np.ndarray:
    """A vector of the world in the root's axes."""
    return seen.state.root_axes.T @ vector


def roll_pitch(state: RobotState) -> np.ndarray:
    """Rotations about the axes ahead and to the left, as R = R_z(yaw) R_y(pitch) R_x(roll)."""
    x, y, z = state.root_axes[2]
    return np.array([np.arctan2(y, z), np.arcsin(np.clip(-x, -1.0, 1.0))])


DOWN = np.array([0.0, 0.0, -1.0])
CONSTANT, COMMAND = "constant", "velocity_commands"

#: term → its numbers; besides these there are those of a constant
TERMS: dict[str, Callable[[Seen], np.ndarray]] = {
    "base_lin_vel": lambda seen: _turned(seen, seen.state.qvel[:3]),
    "base_ang_vel": lambda seen: seen.state.qvel[3:6],
    "projected_gravity": lambda seen: _turned(seen, DOWN),
    "roll_pitch": lambda seen: roll_pitch(seen.state),
    COMMAND: lambda seen: seen.command,
    "joint_pos": lambda seen: seen.q,
    "joint_pos_rel": lambda seen: seen.q - seen.default,
    "joint_vel": lambda seen: seen.v,
    "last_action": lambda seen: seen.action,
    "phase": lambda seen: np.array([np.sin(seen.phase), np.cos(seen.phase)]),
    "phase_sin": lambda seen: np.sin(seen.legs),
    "phase_cos": lambda seen: np.cos(seen.legs),
}
#: other names of the same
ALIASES = {
    "gravity_orientation": "projected_gravity",
    "command": "velocity_commands",
    "commands": "velocity_commands",
    "generated_commands": "velocity_commands",
    "dof_pos": "joint_pos_rel",
    "dof_vel": "joint_vel",
    "joint_vel_rel": "joint_vel",
    "action": "last_action",
    "actions": "last_action",
    "gait_phase": "phase",
}


def meaning(term: ObservationTerm) -> str:
    """The name of a term in `TERMS`."""
    return ALIASES.get(term.term, term.term)


class Place(NamedTuple):
    """Where a term lies in an observation, and how many policy steps ago it was so."""

    term: ObservationTerm
    start: int
    size: int
    age: int


class KnownTerms(NamedTuple):
    """What is known of terms: the names of the joints that they have numbers of, and sizes."""

    joints: dict[str, list[str]]
    sizes: dict[str, int]  # 3, where it is not here
    source: str


class Term:
    """One term in one step."""

    def __init__(self, described: ObservationTerm, field: str, known: KnownTerms):
        self.described, self.name = described, meaning(described)
        if self.name not in TERMS and self.name != CONSTANT:
            raise ConfigError(f"no such term: {shown(described.term)}", source=known.source,
                              field=f"{field}.term",
                              choices=(*TERMS, CONSTANT, *ALIASES))  # fmt: skip
        self._source, self._field = known.source, field
        self.values = np.array(described.values, dtype=float)
        names = known.joints.get(self.name, [])
        whole = len(self.values) if self.name == CONSTANT else known.sizes.get(self.name, 3)
        self.picked = self._picked(whole, names)
        self.size = len(self.picked)
        self.scale = self._scale([names[i] for i in self.picked] if names else [])
        self.at_rest = self._at_rest()

    def __str__(self) -> str:
        return f"{self.described.term} {self.size}"

    def _picked(self, whole: int, names: list[str]) -> np.ndarray:
        """The places of its numbers that it shows."""
        picked = list(self.described.pick or range(whole))
        if self.described.joints:
            if not names:
                raise self._wrong("joints", f"{self.described.term} has no joints")
            wanted = match_names(dict.fromkeys(self.described.joints, 0), names, self._source,
                                 f"{self._field}.joints")  # fmt: skip
            picked = [i for i in picked if i < whole and names[i] in wanted]
        if not picked or max(picked) >= whole:
            raise self._wrong(
                "pick" if self.described.pick else "values",
                f"{self.described.term} has {whole} numbers",
            )
        return np.array(picked)

    def _scale(self, names: list[str]) -> np.ndarray:
        given = self.described.scale
        if isinstance(given, dict):
            found = match_names(given, names, self._source, f"{self._field}.scale")
            lost = [name for name in names if name not in found]
            if lost:
                raise self._wrong("scale", f"has nothing for {', '.join(lost)}")
            given = tuple(found[name] for name in names)
        scale = np.asarray(given, dtype=float)
        if scale.size not in (1, self.size):
            raise self._wrong("scale", f"has {scale.size} numbers, {self.described.term} has "
                              f"{self.size}")  # fmt: skip
        return scale

    def _at_rest(self) -> np.ndarray | None:
        if self.described.at_rest is None:
            return None
        shown_at_rest = np.array(self.described.at_rest, dtype=float)
        if len(shown_at_rest) != self.size:
            raise self._wrong("at_rest", f"has {len(shown_at_rest)} numbers, "
                              f"{self.described.term} has {self.size}")  # fmt: skip
        return shown_at_rest

    def _wrong(self, field: str, problem: str) -> ConfigError:
        return ConfigError(problem, source=self._source, field=f"{self._field}.{field}")

    def places(self, start: int, age: int) -> Iterator[Place]:
        """Where it lies."""
        yield Place(self.described, start, self.size, age)

    def now(self, seen: Seen) -> np.ndarray:
        """(size,) its numbers."""
        if self.at_rest is not None and not np.any(seen.command):
            value = self.at_rest
        elif self.name == CONSTANT:
            value = self.values[self.picked]
        else:
            value = np.asarray(TERMS[self.name](seen), dtype=float)[self.picked]
        if self.described.clip is not None:
            value = np.clip(value, *self.described.clip)
        return value * self.scale

    def forget(self) -> None:
        """It remembers nothing."""
