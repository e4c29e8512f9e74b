"""The observation of a policy: terms by the names of mjlab, Isaac Lab and legged_gym."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.envs.physics.state import RobotState

from .config import ObservationTerm, PolicyFileConfig


class Seen(NamedTuple):
    """All that terms are made from: n joints of the policy, na actions."""

    state: RobotState
    q: np.ndarray  # (n,) joint positions [rad]
    v: np.ndarray  # (n,) joint velocities [rad/s]
    default: np.ndarray  # (n,) posture that positions are relative to [rad]
    action: np.ndarray  # (na,) of the step before, zero at the start
    command: np.ndarray  # (3,) [m/s, m/s, rad/s]
    phase: float  # of the clock [rad]


def _turned(seen: Seen, vector: np.ndarray) -> np.ndarray:
    """A vector of the world in the root's axes."""
    return seen.state.root_axes.T @ vector


DOWN = np.array([0.0, 0.0, -1.0])

#: term → its numbers
TERMS: dict[str, Callable[[Seen], np.ndarray]] = {
    "base_lin_vel": lambda seen: _turned(seen, seen.state.qvel[:3]),
    "base_ang_vel": lambda seen: seen.state.qvel[3:6],
    "projected_gravity": lambda seen: _turned(seen, DOWN),
    "velocity_commands": lambda seen: seen.command,
    "joint_pos": lambda seen: seen.q,
    "joint_pos_rel": lambda seen: seen.q - seen.default,
    "joint_vel": lambda seen: seen.v,
    "last_action": lambda seen: seen.action,
    "phase": lambda seen: np.array([np.sin(seen.phase), np.cos(seen.phase)]),
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


class Observer:
    """The observation of a policy with `joints` joints and `actions` actions, step by step.

    Raises ConfigError for an unknown term, a scale of another size than its term, and frames of
    terms with different histories.
    """

    def __init__(self, config: PolicyFileConfig, joints: int, actions: int, source: str):
        sizes = {"joint_pos": joints, "joint_pos_rel": joints, "joint_vel": joints,
                 "last_action": actions, "phase": 2}  # fmt: skip
        self._by_frame = config.history == "frame"
        self._terms: list[_Term] = []
        for i, described in enumerate(config.observations):
            name = ALIASES.get(described.term, described.term)
            if name not in TERMS:
                raise ConfigError(f"no such term: {shown(described.term)}", source=source,
                                  field=f"observations[{i}].term",
                                  choices=(*TERMS, *ALIASES))  # fmt: skip
            first = config.observations[0].history
            if self._by_frame and described.history != first:
                raise ConfigError(f"{described.history} steps, where the first term shows {first}",
                                  source=source, field=f"observations[{i}].history")  # fmt: skip
            self._terms.append(_Term(described, name, sizes.get(name, 3), source, i))

    @property
    def size(self) -> int:
        """The size of an observation."""
        return sum(term.size * term.described.history for term in self._terms)

    @property
    def parts(self) -> str:
        """The terms and their sizes, for errors."""
        sizes = ((term, term.described.history) for term in self._terms)
        return ", ".join(
            f"{term.described.term} {term.size}" + (f" × {count}" if count > 1 else "")
            for term, count in sizes
        )

    def forget(self) -> None:
        """Forget the last trial: the next observation fills the history."""
        for term in self._terms:
            term.kept.clear()

    def observe(self, seen: Seen) -> np.ndarray:
        """The observation (size,) float32 of this policy step, which enters the history."""
        for term in self._terms:
            term.look(seen)
        if self._by_frame:
            columns = [np.concatenate(frame) for frame in zip(*self._kept(), strict=True)]
        else:
            columns = [np.concatenate(list(kept)) for kept in self._kept()]
        return np.concatenate(columns).astype(np.float32)

    def _kept(self) -> list[deque[np.ndarray]]:
        return [term.kept for term in self._terms]


class _Term:
    """One term and what it showed in the last steps, oldest first."""

    def __init__(self, described: ObservationTerm, name: str, size: int, source: str, i: int):
        self.described, self.name, self.size = described, name, size
        self.kept: deque[np.ndarray] = deque(maxlen=described.history)
        self.scale = np.asarray(described.scale, dtype=float)
        if self.scale.size not in (1, size):
            raise ConfigError(
                f"has {self.scale.size} numbers, {described.term} has {size}",
                source=source,
                field=f"observations[{i}].scale",
            )

    def look(self, seen: Seen) -> None:
        """Remember what it shows now."""
        value = np.array(TERMS[self.name](seen), dtype=float)
        if self.described.clip is not None:
            value = np.clip(value, *self.described.clip)
        value = value * self.scale
        for _ in range(max(1, self.described.history - len(self.kept))):
            self.kept.append(value)
