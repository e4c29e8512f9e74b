"""A suite: a list of parts, and what they share; `configs/suites/*.yaml` or a file like them."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.files import resolve
from poise.configs.schema import build, read_yaml

from .directions import Envelope, Grid, Margin
from .draw import Standard, SuitePart
from .factors import Factors, Mix
from .getting_up import GetUpPart
from .lasting import Gusts, Sustained
from .motions import MotionTrials
from .random import PushSequence, Quiet, Random
from .scenarios import Scenarios
from .walking import (
    WALKING,
    GaitTrials,
    Terrains,
    Velocity,
    WalkKick,
    WalkPush,
    WalkRepeated,
    WalkTrials,
)


@dataclass(frozen=True)
class Suite(Standard):
    """A suite; parts that are null are left out, the others run in this order.

    All parts but `factors` are repeated at each of the realism `levels` (names or files), with the
    same starts, directions and pushes; an envelope's second stage is around the J50 there.
    """

    envelope: Envelope | None = None
    grid: Grid | None = None
    margin: Margin | None = None
    factors: Factors | None = None
    mix: Mix | None = None
    random: Random | None = None
    sequence: PushSequence | None = None
    quiet: Quiet | None = None
    sustained: Sustained | None = field(default=None, metadata={"omit": "default"})
    gusts: Gusts | None = field(default=None, metadata={"omit": "default"})
    walk: WalkTrials | None = field(default=None, metadata={"omit": "default"})
    gait: GaitTrials | None = field(default=None, metadata={"omit": "default"})
    velocity: Velocity | None = field(default=None, metadata={"omit": "default"})
    walk_push: WalkPush | None = field(default=None, metadata={"omit": "default"})
    walk_kick: WalkKick | None = field(default=None, metadata={"omit": "default"})
    walk_repeated: WalkRepeated | None = field(default=None, metadata={"omit": "default"})
    terrains: Terrains | None = field(default=None, metadata={"omit": "default"})
    motions: MotionTrials | None = field(default=None, metadata={"omit": "default"})
    scenarios: Scenarios | None = field(default=None, metadata={"omit": "default"})
    get_up: GetUpPart | None = field(default=None, metadata={"omit": "default"})
    levels: tuple[str, ...] = field(default=(), metadata={"omit": "default"})

    def __post_init__(self) -> None:
        if not self.parts:
            raise ValueError(f"needs one part or more: {', '.join(PARTS)}")
        if self.walk_push is not None and (self.envelope or self.grid):
            raise ValueError("walk_push: J50 is that of a walk or of standing, not of both")
        if self.motions is not None and len(self.parts) > 1:
            raise ValueError("motions: must be the only part: they define what a fall is")
        if self.scenarios is not None and (len(self.parts) > 1 or self.levels):
            raise ValueError("scenarios: must be the only part, each of them at its own level")
        if self.scenarios is not None and self.scenarios.duration > self.duration:
            raise ValueError(f"duration: a scenario lasts {self.scenarios.duration:g} s")
        self._check_starts()
        stems = [Path(level).stem for level in (self.realism, *self.levels)]
        for stem in stems:
            if stems.count(stem) > 1:
                raise ValueError(f"levels: {stem} comes twice, or is also the suite's own realism")

    def _check_starts(self) -> None:
        """Raise ValueError for first pushes that may begin when their trial is over."""
        cells: dict[str, tuple[Any, float]] = {"start": (self, self.duration)}
        for name, part in self.parts.items():
            cells[f"{name}.start"] = part, self.duration
            cells[f"{name}.pushes.start"] = getattr(part, "pushes", None), self.duration
        for name, each in self.scenarios.each.items() if self.scenarios else ():
            cells[f"scenarios.each.{name}.pushes.start"] = each.pushes, each.duration
        for name, (cell, duration) in cells.items():
            if np.max(getattr(cell, "start", 0.0)) >= duration:
                raise ValueError(f"{name}: must lie within the duration, {duration:g} s")

    @property
    def parts(self) -> dict[str, SuitePart]:
        """The parts that it has, by name."""
        found = {name: getattr(self, name) for name in PARTS}
        return {name: part for name, part in found.items() if part is not None}

    @property
    def relative(self) -> bool:
        """Whether pushes are fractions of the J50 in `--limits`."""
        found = (getattr(part, "pushes", None) for part in self.parts.values())
        return any(getattr(pushes, "unit", "") == "controller_fraction" for pushes in found)

    @property
    def paired(self) -> bool:
        """Whether trials depend on the other controllers."""
        return any(part is not None and part.paired for part in (self.envelope, self.walk_push))

    @property
    def walks(self) -> bool:
        """True if it is for controllers that walk alone."""
        commanded = (getattr(part, "command", None) for part in (self.sustained, self.gusts))
        return any(name in WALKING for name in self.parts) or any(commanded)

    def performing(self, names: Many[str]) -> Suite:
        """Return the suite with other motions; raise ConfigError where none is performed."""
        if self.motions is None:
            raise ConfigError("this suite performs no motions", field="motions")
        return replace(self, motions=replace(self.motions, names=tuple(names)))

    def resized(self, trials: int) -> Suite:
        """Return the suite with another number of trials in its only part.

        With several parts, cap the number in every cell: a direction and stage, a level, `mix`.
        """
        alone = len(self.parts) == 1
        changed: dict[str, Any] = {
            name: part.resized(trials) if alone else part.capped(trials)
            for name, part in self.parts.items()
        }
        return replace(self, **changed)


PARTS = tuple(f.name for f in fields(Suite)
              if f.name not in (*Standard.__dataclass_fields__, "levels"))  # fmt: skip


def load_suite(name: str | Path) -> Suite:
    """Return a packaged suite (`configs/suites`) or a path to one.

    Raises ConfigError naming the file, the field and the choices.
    """
    path = resolve("suites", name)
    return build(Suite, read_yaml(path), str(path))
