"""What a description leaves open, tried: how a history lies, and what a clock shows at rest."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Literal, TypeAlias

from poise.baselines.policy_files.config import ObservationTerm, PolicyFileConfig
from poise.baselines.policy_files.controller import observer_of
from poise.baselines.policy_files.terms import CLOCKS, meaning
from poise.configs.schema import to_dict
from poise.envs.robots.robot import Robot

from .guess import LONGEST, Sizes
from .standing import Stood, stand

Say: TypeAlias = Callable[[str], object]  # progress, a line at a time
SECONDS = 5.0  # of a trial: what is read in a wrong order falls within one


def silent(line: str) -> None:
    """No progress."""


@dataclass(frozen=True)
class Tried:
    """A reading that was tried.

    Attributes:
        what: that is left open: the order of a history, or a clock at rest.
        name: of this reading.
        config: the policy, so read.
        stood: how it stood for `SECONDS`.
        lines: of a description that says so.
    """

    what: str
    name: str
    config: PolicyFileConfig
    stood: Stood
    lines: str


def steps_missing(robot: Robot, config: PolicyFileConfig, sizes: Sizes) -> int:
    """Return how many steps of the described terms the only input takes; 1 where that fits.

    It is 1, too, where a term has a history already, and where the sizes are no whole multiple.
    """
    given = [size for size in sizes.inputs.values() if size]
    parts = config.inputs.get("", ())
    if not given or any(part.history > 1 or part.lag for part in parts):
        return 1
    one = observer_of(robot, config).sizes.get("", 0)
    steps, rest = divmod(max(given), one) if one else (1, 0)
    return steps if not rest and 1 < steps <= LONGEST else 1


def try_histories(
    robot: Robot, config: PolicyFileConfig, steps: int, say: Say = silent
) -> list[Tried]:
    """Let the policy stand with its history in each order: by frame or term, either end first.

    Args:
        steps: of the history; 1 where the terms say theirs.
        say: takes a line before each trial.
    """
    found = []
    orders: tuple[Literal["frame", "term"], ...] = ("frame", "term")
    for history in orders:
        for newest_first, end in ((False, "oldest first"), (True, "newest first")):
            parts = tuple(
                replace(part, history=max(steps, part.history), newest_first=newest_first)
                for part in config.inputs[""]
            )
            tried = replace(config, history=history, observations=parts)
            found.append(_tried("history", f"by {history}, {end}", robot, tried, say))
    return found


def order_is_open(config: PolicyFileConfig) -> bool:
    """Return whether terms have a history of which nothing says how it lies."""
    parts = config.inputs.get("", ())
    return "history" not in config.said and any(part.history > 1 and part.term for part in parts)


def try_clocks(robot: Robot, config: PolicyFileConfig, say: Say = silent) -> list[Tried]:
    """Let a policy stand whose clock shows something else while no velocity is commanded."""
    return [_tried("clock", name, robot, changed, say) for name, changed in _clocks(config)]


def clock_is_open(config: PolicyFileConfig) -> bool:
    """Return whether a clock runs always, at rest too, and nothing says that it should."""
    return config.phase_runs == "always" and any(term.at_rest is None for term in clocks(config))


def clocks(config: PolicyFileConfig) -> list[ObservationTerm]:
    """The terms that show a clock."""
    return [term for parts in config.inputs.values() for part in parts for term in part.terms
            if meaning(term) in CLOCKS]  # fmt: skip


def _clocks(config: PolicyFileConfig) -> Iterator[tuple[str, PolicyFileConfig]]:
    """What a clock may show at rest: zeros, or all its legs at 0 or at half a period."""
    legs = len(config.phase_offsets)
    sizes = {"phase": 2, "phase_sin": legs, "phase_cos": legs}
    shown = {"zeros": {name: (0.0,) * size for name, size in sizes.items()}}
    for name, cosine in (("the phase 0", 1.0), ("half a period", -1.0)):
        shown[name] = {"phase": (0.0, cosine), "phase_sin": (0.0,) * legs,
                       "phase_cos": (cosine,) * legs}  # fmt: skip
    for name, values in shown.items():
        inputs = {each: tuple(_resting(part, values) for part in parts)
                  for each, parts in config.inputs.items()}  # fmt: skip
        observations = inputs if "" not in inputs else inputs[""]
        yield name, replace(config, observations=observations)


def _resting(part: ObservationTerm, shown: dict[str, tuple[float, ...]]) -> ObservationTerm:
    """Return a term, or those of a frame, that shows this of a clock at rest."""
    if part.frame:
        return replace(part, frame=tuple(_resting(each, shown) for each in part.frame))
    if meaning(part) not in shown or part.at_rest is not None:
        return part
    values = shown[meaning(part)]
    return replace(part, at_rest=tuple(values[i] for i in part.pick or range(len(values))))


def _tried(what: str, name: str, robot: Robot, config: PolicyFileConfig, say: Say) -> Tried:
    say(f"trying its {what}, {name}: {SECONDS:g} s")
    return Tried(what, name, config, stand(robot, config, SECONDS), _lines(config))


def _lines(config: PolicyFileConfig) -> str:
    """Return the observations of a description in YAML, one a line, and how their history lies."""
    lines = [f"history: {config.history}"] if any(
        part.history > 1 for parts in config.inputs.values() for part in parts) else []  # fmt: skip
    lines.append("observations:")
    for name, parts in config.inputs.items():
        lines += [f"  {name}:"] if name else []
        lines += [f"{'    ' if name else '  '}- {_flow(to_dict(part))}" for part in parts]
    return "\n".join(lines)


_DEFAULTS = {f.name: to_dict(f.default) for f in fields(ObservationTerm)}


def _flow(value: object) -> str:
    """Return a term as YAML on a line, without what is as by default."""
    if isinstance(value, dict) and "term" in value:
        value = {key: each for key, each in value.items() if each != _DEFAULTS.get(key)}
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)}: {_flow(each)}" for key, each in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_flow, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)


def _key(key: object) -> str:
    """Return a key of YAML; patterns are in quotation marks."""
    return f'"{key}"' if "*" in str(key) else str(key)
