"""The observations of a policy: terms side by side, of one step or of several."""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from poise.configs.errors import ConfigError

from .config import ObservationTerm, PolicyFileConfig
from .motion.track import MOTION_SIZES, MOTION_TERMS, PER_JOINT
from .terms import COMMANDS, SIZES, KnownTerms, PolicyTerm, Seen, TermPlace, meaning


def follows_commands(config: PolicyFileConfig) -> bool:
    """Return whether a policy observes the commanded velocity."""
    parts = [part for parts in config.inputs.values() for part in parts]
    return any(meaning(term) in COMMANDS for part in parts for term in part.terms)


def tracks_motion(config: PolicyFileConfig) -> bool:
    """Return whether a policy observes a motion to follow."""
    parts = [part for parts in config.inputs.values() for part in parts]
    return any(meaning(term) in MOTION_TERMS for part in parts for term in part.terms)


class Observer:
    """The observations of a policy, step by step: one for each of its network's inputs.

    Args:
        config: what the inputs show.
        joints: names of the policy's joints.
        moved: those of them that its action moves.
        source: the file that describes it, for errors.

    Raises ConfigError for an unknown term, numbers of another size than its term, joints that it
    does not have, and frames of terms with different histories.
    """

    def __init__(
        self, config: PolicyFileConfig, joints: Sequence[str], moved: Sequence[str], source: str
    ):
        legs = len(config.phase_offsets)
        names = {"joint_pos": joints, "joint_pos_rel": joints, "joint_vel": joints,
                 "last_action": moved, **dict.fromkeys(PER_JOINT, joints)}  # fmt: skip
        sizes = {**SIZES, **MOTION_SIZES, "motion_command": 2 * len(joints),
                 "phase_sin": legs, "phase_cos": legs,
                 **{term: len(each) for term, each in names.items()}}  # fmt: skip
        known = KnownTerms({term: list(each) for term, each in names.items()}, sizes, source)
        self._inputs: dict[str, _Side | _Part] = {}
        for name, parts in config.inputs.items():
            field = f"observations.{name}" if name else "observations"
            if config.history == "frame" and parts:
                self._inputs[name] = _Part(_framed(parts, field, source), field, known, field)
            else:
                self._inputs[name] = _Side(parts, field, known)

    @property
    def sizes(self) -> dict[str, int]:
        """Input → the numbers of an observation."""
        return {name: side.size for name, side in self._inputs.items()}

    def __str__(self) -> str:
        """How many numbers each input is given, and of which terms, for errors."""
        return "; ".join(f"{side.size} numbers{' for ' if name else ''}{name} ({side})"
                         for name, side in self._inputs.items())  # fmt: skip

    def places(self) -> dict[str, list[TermPlace]]:
        """Input → where its terms lie, in their order."""
        return {name: list(side.places(0, 0)) for name, side in self._inputs.items()}

    def forget(self) -> None:
        """Forget the last trial: the next observation fills the history."""
        for side in self._inputs.values():
            side.forget()

    def observe(self, seen: Seen) -> dict[str, np.ndarray]:
        """Input → the observation (size,) of this policy step, which enters the history."""
        return {name: side.now(seen) for name, side in self._inputs.items()}


def _framed(parts: Sequence[ObservationTerm], field: str, source: str) -> ObservationTerm:
    """All parts of an input as one frame, which has the history that they have alike."""
    first = parts[0]
    for i, part in enumerate(parts):
        if part.history != first.history:
            raise ConfigError(f"{part.history} steps, where the first term shows {first.history}",
                              source=source, field=f"{field}[{i}].history")  # fmt: skip
    alone = tuple(replace(part, history=1, lag=0, newest_first=False) for part in parts)
    return ObservationTerm(frame=alone, history=first.history, lag=first.lag, fill=first.fill,
                           newest_first=first.newest_first)  # fmt: skip


class _Side:
    """Parts side by side in one step."""

    def __init__(self, parts: Sequence[ObservationTerm], field: str, known: KnownTerms):
        self.parts = [_Part(part, f"{field}[{i}]", known) for i, part in enumerate(parts)]
        self.size: int = sum(part.size for part in self.parts)

    def __str__(self) -> str:
        return ", ".join(map(str, self.parts))

    def places(self, start: int, age: int) -> Iterator[TermPlace]:
        """Where their terms lie, from `start` on, of so many steps ago."""
        for part in self.parts:
            yield from part.places(start, age)
            start += part.size

    def now(self, seen: Seen) -> np.ndarray:
        """(size,) what they show in this step."""
        return np.concatenate([part.now(seen) for part in self.parts])

    def forget(self) -> None:
        for part in self.parts:
            part.forget()


class _Part:
    """A term, or a frame of them, and what it showed in the last steps, oldest first."""

    def __init__(self, described: ObservationTerm, field: str, known: KnownTerms, inside: str = ""):
        self.described = described
        self.inner: _Side | PolicyTerm = (
            _Side(described.frame, inside or f"{field}.frame", known)
            if described.frame
            else PolicyTerm(described, field, known)
        )
        self.kept: deque[np.ndarray] = deque(maxlen=described.history + described.lag)
        self.size: int = self.inner.size * described.history

    def __str__(self) -> str:
        count = self.described.history
        name = f"({self.inner})" if self.described.frame else str(self.inner)
        return name + (f" × {count}" if count > 1 else "")

    def places(self, start: int, age: int) -> Iterator[TermPlace]:
        """Where it lies, step by step."""
        steps = range(self.described.lag, self.described.lag + self.described.history)
        for step in steps if self.described.newest_first else reversed(steps):
            yield from self.inner.places(start, age + step)
            start += self.inner.size

    def now(self, seen: Seen) -> np.ndarray:
        """(size,) what it shows in this step, which enters the history."""
        own, value = self.described, self.inner.now(seen)
        if not self.kept:
            before = value if own.fill == "first" else np.zeros_like(value)
            self.kept.extend([before] * (own.history + own.lag))
        self.kept.append(value)
        steps = list(self.kept)[: own.history]
        return np.concatenate(steps[::-1] if own.newest_first else steps)

    def forget(self) -> None:
        self.kept.clear()
        self.inner.forget()
