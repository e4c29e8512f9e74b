"""Settings of a search and the trials of its candidates: pushes around a limit, or walks.

All of a generation meet the same; every generation draws new ones. The limit of each direction, or
the speed of each command, follows the candidates: it rises while they succeed in more than half.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from poise.baselines.walking.schedule import TimedCommand
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import push_bodies
from poise.envs.robots.robot import Robot
from poise.envs.sensing.realism import IDEAL
from poise.training.benchmarking.trials.trial import Trial

START = 0.5  # [s] of a push


@dataclass(frozen=True)
class TuningPushes:
    """Pushes of a generation: `levels` times the limit found so far, in each of `directions`.

    Directions [°] are those of the environment's pushes, ± up to `jitter`; one that is named twice
    counts twice. The limit of a direction starts at `impulse` [N·s/kg] and follows the candidates:
    it rises while they recover more than half of its pushes, and falls else.
    """

    directions: tuple[float, ...] = tuple(22.5 * k for k in range(16))
    jitter: float = field(default=11.25, metadata={"min": 0.0, "max": 180.0})
    levels: tuple[float, ...] = (0.95, 1.05)
    impulse: float = field(default=0.4, metadata={"above": 0.0})
    duration: float = field(default=0.1, metadata={"above": 0.0})
    seconds: float = field(default=5.0, metadata={"above": START})

    def __post_init__(self) -> None:
        if not self.directions:
            raise ValueError("directions: must be one or more")
        _check_levels(self.levels)

    def first(self, robot: Robot) -> np.ndarray:
        """Return the limit of each direction in the first generation [N·s]."""
        return np.full(len(self.directions), self.impulse * robot.mass)

    def draw(self, seed: int, robot: Robot, limits: np.ndarray) -> list[Trial]:
        """Return trials, direction by direction; directions are jittered, so that all angles occur.

        `limits` [N·s] has one for each.
        """
        rng = np.random.default_rng(seed)
        body = push_bodies(robot)[0]
        trials: list[Trial] = []
        for direction, limit in zip(self.directions, limits, strict=True):
            for level in self.levels:
                angle = (direction + self.jitter * rng.uniform(-1.0, 1.0)) % 360.0
                push = Push(body, START, self.duration, float(level * limit), float(angle))
                number = len(trials)
                trials.append(Trial(number, seed + number, (push,), limit_fraction=level))
        return trials

    def words(self, who: str, limits: np.ndarray) -> str:
        """Return a line for the terminal: what half of the candidates recover from or follow."""
        return f"half recovered {who} at {limits.mean():.1f} N·s (worst {limits.min():.1f})"


@dataclass(frozen=True)
class TuningWalks:
    """Walks of a generation: `levels` times the speed found so far, of each of `commands`.

    A command applies from the start of the trial, to the left or right at random. Its speeds are
    those of the first generation.
    """

    commands: tuple[TimedCommand, ...]
    levels: tuple[float, ...] = (0.95, 1.05)
    seconds: float = field(default=12.0, metadata={"above": 0.0})

    def __post_init__(self) -> None:
        if not self.commands:
            raise ValueError("commands: must be one or more")
        _check_levels(self.levels)

    def first(self, robot: Robot) -> np.ndarray:
        """Return the speed factor of each command in the first generation."""
        return np.ones(len(self.commands))

    def draw(self, seed: int, robot: Robot, limits: np.ndarray) -> list[Trial]:
        """Return trials, command by command; `limits` are the speed factors of the commands."""
        rng = np.random.default_rng(seed)
        trials: list[Trial] = []
        for command, limit in zip(self.commands, limits, strict=True):
            for level in self.levels:
                fast, side = float(level * limit), float(rng.choice((-1.0, 1.0)))
                scaled = replace(command, ahead=fast * command.ahead,
                                 left=side * fast * command.left,
                                 turn=side * fast * command.turn)  # fmt: skip
                number = len(trials)
                walk = Trial(number, seed + number, commands=(scaled,), limit_fraction=level)
                trials.append(walk)
        return trials

    def words(self, who: str, limits: np.ndarray) -> str:
        """Return a line for the terminal: what half of the candidates recover from or follow."""
        return (f"half walk {who} at {limits.mean():.2f} of the command "
                f"(worst {limits.min():.2f})")  # fmt: skip


def _check_levels(levels: tuple[float, ...]) -> None:
    if not levels or min(levels) <= 0.0:
        raise ValueError("levels: must be one or more fractions above 0")


@dataclass(frozen=True)
class TuneConfig:
    """Everything that decides a search; written beside its results.

    Attributes:
        controller: where the search starts: a packaged controller or a .yaml file.
        gains: the range of each number that is searched, by its path in the controller's
            configuration (``com.weight``); on a log scale if both ends are above 0.
        pushes: what candidates meet, unless there are `walks`.
        walks: commands used instead, for a controller that walks.
        policy: a policy on top of the candidates counts too, by `policy_share` of the whole.
        in_place: a foot that moves is no recovery.
        realism: name or file of the realism level of the trials.
        chatter: what a trial's worth loses for torques that change by their limit in every tick.
        generations, population, spread: of CMA-ES; spread is the first standard deviation, as a
            fraction of each range.
    """

    controller: str
    gains: dict[str, tuple[float, float]]
    robot: str = "humanoid"
    pushes: TuningPushes = field(default_factory=TuningPushes)
    walks: TuningWalks | None = field(default=None, metadata={"omit": "default"})
    policy: str | None = None
    policy_share: float = field(default=0.4, metadata={"min": 0.0, "max": 1.0})
    in_place: bool = False
    realism: str = field(default=IDEAL, metadata={"omit": "default"})
    chatter: float = field(default=0.0, metadata={"min": 0.0, "omit": "default"})
    generations: int = field(default=60, metadata={"min": 1})
    population: int = field(default=14, metadata={"min": 4})
    spread: float = field(default=0.15, metadata={"above": 0.0, "max": 1.0})
    seed: int = field(default=0, metadata={"min": 0})

    def __post_init__(self) -> None:
        if not self.gains:
            raise ValueError("gains: must name one or more")
        for path, (low, high) in self.gains.items():
            if not low < high:
                raise ValueError(f"gains.{path}: must be [low, high] with low < high")

    @property
    def tasks(self) -> TuningPushes | TuningWalks:
        """What candidates meet."""
        return self.walks or self.pushes
