"""Observation terms of policies, by the names of mjlab, Isaac Lab and legged_gym."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.envs.physics.state import RobotState
from poise.envs.robots.description import match_names

from .config import ObservationTerm
from .motion.track import MOTION_ALIASES, MOTION_TERMS, MotionTrack, frames_ahead


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
    motion: MotionTrack | None = None  # that is followed


def _turned(seen: Seen, vector: np.ndarray) -> np.ndarray:
    """A vector of the world in the root's axes."""
    return seen.state.root_axes.T @ vector


def roll_pitch(state: RobotState) -> np.ndarray:
    """Rotations about the axes ahead and to the left, as R = R_z(yaw) R_y(pitch) R_x(roll)."""
    x, y, z = state.root_axes[2]
    return np.array([np.arctan2(y, z), np.arcsin(np.clip(-x, -1.0, 1.0))])


def without_heading(axes: np.ndarray) -> np.ndarray:
    """R_z(yaw)ᵀ R of axes (3, 3) as columns: roll and pitch alone, whichever way they face."""
    yaw = np.arctan2(axes[1, 0], axes[0, 0])
    turned: np.ndarray = z_rotation(yaw).T @ axes
    return turned


def z_rotation(yaw: float) -> np.ndarray:
    """(3, 3) R_z."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def two_columns(axes: np.ndarray) -> np.ndarray:
    """(6,) the first two columns of a rotation, row by row, as Isaac Lab and mjlab show them."""
    return axes[:, :2].ravel()


DOWN = np.array([0.0, 0.0, -1.0])
CONSTANT, COMMAND = "constant", "velocity_commands"
#: the numbers of a command, by the names of Poise and of others
COMMAND_NAMES = {"ahead": 0, "left": 1, "turn": 2, "lin_vel_x": 0, "lin_vel_y": 1, "ang_vel_z": 2,
                 "ang_vel_yaw": 2}  # fmt: skip

#: term → its numbers; constants are terms as well
TERMS: dict[str, Callable[[Seen], np.ndarray]] = {
    "base_lin_vel": lambda seen: _turned(seen, seen.state.qvel[:3]),
    "base_ang_vel": lambda seen: seen.state.qvel[3:6],
    "projected_gravity": lambda seen: _turned(seen, DOWN),
    "roll_pitch": lambda seen: roll_pitch(seen.state),
    "root_quat": lambda seen: seen.state.qpos[3:7],
    "root_rot_6d": lambda seen: two_columns(seen.state.root_axes),
    "root_local_rot_6d": lambda seen: two_columns(without_heading(seen.state.root_axes)),
    "root_local_rot_tan_norm": lambda seen: without_heading(seen.state.root_axes)[
        :, [0, 2]
    ].T.ravel(),
    COMMAND: lambda seen: seen.command,
    "command_lin_vel": lambda seen: seen.command[:2],
    "command_ang_vel": lambda seen: seen.command[2:],
    "joint_pos": lambda seen: seen.q,
    "joint_pos_rel": lambda seen: seen.q - seen.default,
    "joint_vel": lambda seen: seen.v,
    "last_action": lambda seen: seen.action,
    "phase": lambda seen: np.array([np.sin(seen.phase), np.cos(seen.phase)]),
    "phase_sin": lambda seen: np.sin(seen.legs),
    "phase_cos": lambda seen: np.cos(seen.legs),
}
#: numbers of a term, where they are not three, nor one for each joint or leg
SIZES = {"phase": 2, "roll_pitch": 2, "root_quat": 4, "root_rot_6d": 6, "root_local_rot_6d": 6,
         "root_local_rot_tan_norm": 6, "command_lin_vel": 2, "command_ang_vel": 1}  # fmt: skip
COMMANDS = (COMMAND, "command_lin_vel", "command_ang_vel")
CLOCKS = ("phase", "phase_sin", "phase_cos")
#: other names of the same
ALIASES = {
    "gravity_orientation": "projected_gravity",
    "base_quat": "root_quat",
    "root_quat_w": "root_quat",
    "command": "velocity_commands",
    "commands": "velocity_commands",
    "generated_commands": "velocity_commands",
    "dof_pos": "joint_pos_rel",
    "dof_vel": "joint_vel",
    "joint_vel_rel": "joint_vel",
    "action": "last_action",
    "actions": "last_action",
    "gait_phase": "phase",
    **MOTION_ALIASES,
}


def meaning(term: ObservationTerm) -> str:
    """The name of a term in `TERMS`."""
    return ALIASES.get(term.term, term.term)


class TermPlace(NamedTuple):
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


class PolicyTerm:
    """One term in one step."""

    def __init__(self, described: ObservationTerm, field: str, known: KnownTerms):
        self.described, self.name = described, meaning(described)
        moved = self.name in MOTION_TERMS
        if self.name not in TERMS and self.name != CONSTANT and not moved:
            raise ConfigError(f"no such term: {shown(described.term)}", source=known.source,
                              field=f"{field}.term",
                              choices=(*TERMS, *MOTION_TERMS, CONSTANT, *ALIASES))  # fmt: skip
        self._source, self._field = known.source, field
        self.values = np.array(described.values, dtype=float)
        names = known.joints.get(self.name, [])
        whole = len(self.values) if self.name == CONSTANT else known.sizes.get(self.name, 3)
        self.picked = self._picked(whole, names)
        if described.ahead and not moved:
            raise self._wrong("ahead", f"{described.term} is no term of a motion")
        self._ahead = frames_ahead(described.ahead)
        self.size = len(self.picked) * len(self._ahead)
        self.scale = self._scale([names[i] for i in self.picked] if names else [])
        self.offset = np.asarray(described.offset, dtype=float)
        if self.offset.size not in (1, self.size):
            raise self._wrong("offset", f"has {self.offset.size} numbers, {described.term} has "
                              f"{self.size}")  # fmt: skip
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
        if isinstance(given, dict) and self.name == COMMAND:
            given = self._scale_of_command(given)
        if isinstance(given, dict):
            found = match_names(given, names, self._source, f"{self._field}.scale")
            lost = [name for name in names if name not in found]
            if lost:
                raise self._wrong("scale", f"has nothing for {', '.join(lost)}")
            given = tuple(found[name] for name in names)
        scale = np.asarray(given, dtype=float)
        if scale.size == len(self.picked) > 1:  # alike for all frames
            scale = np.tile(scale, len(self._ahead))
        if scale.size not in (1, self.size):
            raise self._wrong("scale", f"has {scale.size} numbers, {self.described.term} has "
                              f"{self.size}")  # fmt: skip
        return scale

    def _scale_of_command(self, given: dict[str, float]) -> tuple[float, ...]:
        """Factors of the numbers picked of a command, by their names; 1 where nothing is said."""
        if unknown := [name for name in given if name not in COMMAND_NAMES]:
            raise ConfigError(f"a command has no {shown(unknown[0])}", source=self._source,
                              field=f"{self._field}.scale", choices=COMMAND_NAMES)  # fmt: skip
        factors = [1.0, 1.0, 1.0]
        for name, factor in given.items():
            factors[COMMAND_NAMES[name]] = factor
        return tuple(factors[i] for i in self.picked)

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

    def places(self, start: int, age: int) -> Iterator[TermPlace]:
        """Where it lies."""
        yield TermPlace(self.described, start, self.size, age)

    def now(self, seen: Seen) -> np.ndarray:
        """(size,) its numbers."""
        if self.at_rest is not None and not np.any(seen.command):
            value = self.at_rest
        elif self.name == CONSTANT:
            value = self.values[self.picked]
        elif self.name in MOTION_TERMS:
            assert seen.motion is not None
            value = np.concatenate([MOTION_TERMS[self.name](seen.motion.frame(ahead))[self.picked]
                                    for ahead in self._ahead])  # fmt: skip
        else:
            value = np.asarray(TERMS[self.name](seen), dtype=float)[self.picked]
        value = value + self.offset
        if self.described.clip is not None:
            value = np.clip(value, *self.described.clip)
        return value * self.scale

    def forget(self) -> None:
        """It remembers nothing."""
