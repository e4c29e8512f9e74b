"""What the benchmark asks: an envelope of J50, margins, factors one at a time, and a random mix.

Which cases a controller meets depends on the suite, the robot and the seed, and in the second stage
of the envelope on its own first stage: never on who else takes part. Pushes are measured by the
ankle limit, which is physics: a result stays comparable when a controller changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from poise.configs.files import resolve
from poise.configs.schema import build, read_yaml
from poise.envs.balance.config import StartNoise
from poise.envs.pushes.sampler import Range


@dataclass(frozen=True)
class EnvelopePart:
    """J50 per direction, in two stages as in `EnvelopeSuite`, but the second is each one's own."""

    directions: int = field(default=16, metadata={"min": 1})  # evenly around the circle
    fractions: Range = field(default=(0.2, 1.5), metadata={"above": 0.0})  # of the ankle limit
    first_trials: int = field(default=8, metadata={"min": 2})  # per direction
    trials: int = field(default=12, metadata={"min": 1})  # per direction, in the second stage
    spread: float = field(default=0.3, metadata={"above": 0.0, "max": 1.0})  # around rough J50s

    def __post_init__(self) -> None:
        _rising(self.fractions, "fractions")


@dataclass(frozen=True)
class MarginPart:
    """Equal pushes, repeated from differently disturbed starts: EUROBENCH's stability margin."""

    directions: tuple[float, ...] = field(
        default=(0.0, 90.0), metadata={"min": -360.0, "max": 360.0}
    )
    levels: tuple[float, ...] = field(default=(), metadata={"above": 0.0})  # of the ankle limit
    runs: int = field(default=10, metadata={"min": 1})


@dataclass(frozen=True)
class Levels:
    """Levels of every factor, besides the standard case's own; none: it is not varied."""

    duration: tuple[float, ...] = field(default=(), metadata={"above": 0.0})  # [s]
    body: bool = False  # every body that the robot's description names
    height: tuple[float, ...] = field(default=(), metadata={"above": 0.0})  # of the CoM's height
    friction: tuple[float, ...] = field(default=(), metadata={"above": 0.0})
    delay: tuple[float, ...] = field(default=(), metadata={"min": 0.0, "max": 0.1})  # [s]
    mass_error: tuple[float, ...] = field(default=(), metadata={"above": -1.0, "max": 1.0})
    pushes: tuple[int, ...] = field(default=(), metadata={"min": 2})


@dataclass(frozen=True)
class FactorsPart:
    """One factor at a time; every level meets the same starts, directions and fractions."""

    trials: int = field(default=12, metadata={"min": 1})  # per level
    fractions: Range = field(default=(0.4, 1.0), metadata={"above": 0.0})
    levels: Levels = field(default_factory=Levels)

    def __post_init__(self) -> None:
        _rising(self.fractions, "fractions")


@dataclass(frozen=True)
class MixPart:
    """All factors drawn at once. Durations are drawn evenly on a logarithmic scale."""

    trials: int = field(default=160, metadata={"min": 1})
    fractions: Range = field(default=(0.3, 1.1), metadata={"above": 0.0})
    duration: Range = field(default=(0.05, 0.5), metadata={"above": 0.0})  # [s]
    height: Range = field(default=(1.0, 1.8), metadata={"above": 0.0})  # where the trunk is pushed
    friction: Range = field(default=(0.4, 1.0), metadata={"above": 0.0})
    delay: tuple[float, ...] = field(default=(0.0,), metadata={"min": 0.0, "max": 0.1})
    mass_error: Range = field(default=(-0.1, 0.1), metadata={"above": -1.0, "max": 1.0})
    repeated: float = field(default=0.25, metadata={"min": 0.0, "max": 1.0})  # share pushed twice

    def __post_init__(self) -> None:
        for name in ("fractions", "duration", "height", "friction", "mass_error"):
            _rising(getattr(self, name), name)
        if not self.delay:
            raise ValueError("delay: must not be empty")


@dataclass(frozen=True)
class BenchmarkSuite:
    """The parts, and what they share. A part that is null is left out; the envelope never is."""

    duration: float = field(default=6.0, metadata={"above": 1.0})  # of a trial [s]
    start: float = field(default=0.5, metadata={"min": 0.0})  # of the first push [s]
    push_duration: float = field(default=0.1, metadata={"above": 0.0})  # of the standard case [s]
    interval: float = field(default=1.0, metadata={"above": 0.0})  # between repeated pushes [s]
    noise: StartNoise = field(default_factory=StartNoise)
    envelope: EnvelopePart = field(default_factory=EnvelopePart)
    margin: MarginPart | None = None
    factors: FactorsPart | None = None
    mix: MixPart | None = None

    def resized(self, trials: int) -> BenchmarkSuite:
        """At most `trials` in every cell: of a direction and stage, a level, the mix."""

        def least(part, *names):
            if part is None:
                return None
            changes = {name: min(getattr(part, name), trials) for name in names}
            return replace(part, **changes)

        envelope = least(self.envelope, "first_trials", "trials")
        return replace(
            self,
            envelope=replace(envelope, first_trials=max(envelope.first_trials, 2)),
            margin=least(self.margin, "runs"),
            factors=least(self.factors, "trials"),
            mix=least(self.mix, "trials"),
        )


def load_benchmark(name: str | Path) -> BenchmarkSuite:
    """A packaged suite (`configs/benchmarks`) or a path to one.

    Raises ConfigError naming the file, the field and the choices.
    """
    path = resolve("benchmarks", name)
    return build(BenchmarkSuite, read_yaml(path), str(path))


def _rising(pair: Range, name: str) -> None:
    if pair[0] > pair[1]:
        raise ValueError(f"{name}: the range [{pair[0]}, {pair[1]}] must not decrease")
