"""The observation: its terms, their scales, their table and their mirror image."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import numpy as np

from poise.configs.errors import ConfigError, shown
from poise.configs.texts import plain
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.clock import Clock
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.mirror import SIDES, Mirror

F = TypeVar("F", bound=Callable[..., None])
CLIP = 10.0  # of every entry of an observation


@dataclass(frozen=True, eq=False)
class Scales(Block):
    """The units of the observation and the reward."""

    support_x: float  #: half length of the standing support polygon [m]
    support_y: float  #: half width [m]
    per_support_x: float  #: 1 over the half length [1/m]: a product rounds alike in every kernel
    per_support_y: float  #: [1/m]
    height: float  #: CoM height of the standing posture [m]
    velocity: float  #: 0.2 ω h [m/s]
    momentum: float  #: 0.1 m h² ω [N·m·s]
    omega: float  #: ω = √(g/h) [1/s]
    weight: float  #: m g [N]


def scales(robot: RobotArrays, support: np.ndarray) -> Scales:
    """Scales of a robot whose standing support polygon is `support` (k, 2), heading frame [m]."""
    omega = robot.units.omega
    half = 0.5 * (support.max(axis=0) - support.min(axis=0))
    return Scales(
        support_x=float(half[0]),
        support_y=float(half[1]),
        per_support_x=float(1.0 / half[0]),
        per_support_y=float(1.0 / half[1]),
        height=robot.height_com,
        velocity=0.2 * omega * robot.height_com,
        momentum=0.1 * robot.mass * robot.height_com**2 * omega,
        omega=omega,
        weight=robot.units.force,
    )


@dataclass(frozen=True, eq=False)
class View(Block):
    """The block of a term: what its kernel reads, and the part of the observation that it fills."""

    robot: RobotArrays  # nominal model
    state: StateArrays  # the estimated state
    scales: Scales
    q_ref: np.ndarray  # (nj,) joint positions of the reference [rad]
    v_ref: np.ndarray  # (nj,) its joint velocities [rad/s]
    action: np.ndarray  # (na,) of the policy step that has just ended
    views: SimViews  # the true robot: what the policy sent it (`ctrl`), what a teacher may see
    clock: Clock
    pushes: np.ndarray  # (k,) of the episode, see `pack`; rows of zeros are none
    out: np.ndarray  # (size,) the term's own entries


# fmt: off
Image = Literal[
    "vector", "turn", "root vector", "root turn", "number", "joints", "motors", "feet",
    "between feet", "actions",
]
# fmt: on
GROUND, SPACE = ("x", "y"), ("x", "y", "z")
Entries = tuple[str, ...] | Literal["joints", "motors", "feet", "actions"]


@dataclass(frozen=True)
class Term:
    """A named part of the observation vector of an environment.

    `image` is what it is to a mirror that exchanges left and right. Entries of a vector or a turn
    (an axial vector) end in x, y or z; those along the root's axes have all three.
    """

    name: str
    entries: tuple[str, ...]
    unit: str
    meaning: str
    image: Image
    # the compiled function that fills it; None: no observation, but an action
    kernel: Callable[..., None] | None = None
    view: type[Block] = View  # the block that the kernel works on

    @property
    def size(self) -> int:
        """The number of its entries."""
        return len(self.entries)


@dataclass(frozen=True)
class TermKind:
    """A term of any robot: its entries may be one for each joint, motor, foot or action."""

    name: str
    entries: Entries
    unit: str
    meaning: str
    image: Image
    default: bool
    kernel: Callable[..., None]
    view: type[Block]

    def of(self, names: Mapping[str, tuple[str, ...]]) -> Term:
        """The term of a robot whose joints, motors, feet and actions have these `names`."""
        entries = names[self.entries] if isinstance(self.entries, str) else self.entries
        return Term(self.name, entries, self.unit, self.meaning, self.image, self.kernel, self.view)


class Terms(dict[str, TermKind]):
    """Terms by name, in the order in which an observation has them by default.

    `add` makes one of a function that fills `out` of a `view`.
    """

    def __init__(self, known: Mapping[str, TermKind] | None = None, view: type[Block] = View):
        super().__init__(known or {})
        self.view = view

    def add(
        self, entries: Entries, unit: str, meaning: str, image: Image, default: bool = True
    ) -> Callable[[F], F]:
        """A decorator: the function, compiled, is the term of its name.

        Args:
            entries: names of its numbers, or of what each of them belongs to.
            unit: what the numbers are measured in.
            meaning: what they are.
            image: what they are to a mirror, see `Term`.
            default: whether observations have the term if no list is given.

        Raises ValueError for a name that another term has.
        """

        def decorate(function: F) -> F:
            kernel, name = compiled(function), function.__name__
            if name in self:
                raise ValueError(f"a term {name} exists already")
            self[name] = TermKind(name, entries, unit, meaning, image, default, kernel, self.view)
            return kernel

        return decorate

    def choose(
        self, names: Sequence[str] | None, extra: Sequence[str] = (), *, field: str = "terms"
    ) -> list[TermKind]:
        """The terms of these `names`, by default all that are on by default; then the `extra` ones.

        `field` of an observation's configuration is where the names stand.

        Raises ConfigError for a name that is unknown, or comes twice.
        """
        if names is None:
            names = [name for name, kind in self.items() if kind.default]
        for place, given in ((field, names), ("extra", extra)):
            for name in given:
                if name not in self:
                    raise ConfigError(f"unknown term {shown(name)}", field=f"observation.{place}",
                                      choices=self)  # fmt: skip
        chosen = [*names, *extra]
        for name in chosen:
            if chosen.count(name) > 1:
                raise ConfigError(f"{shown(name)} comes twice", field="observation")
        if not chosen and field == "terms":
            raise ConfigError("needs at least one term", field="observation.terms", choices=self)
        return [self[name] for name in chosen]


def observation_table(terms: Iterable[Term]) -> str:
    """The terms of an environment (`env.unwrapped.terms`) as a Markdown table, a row per index."""
    rows = ["| index | term | entry | unit | meaning |", "| --- | --- | --- | --- | --- |"]
    for term in terms:
        for entry in term.entries:
            index = len(rows) - 2
            cells = f"{term.name} | {plain(entry)} | {term.unit} | {term.meaning}"
            rows.append(f"| {index} | {cells} |")
    return "\n".join(rows)


def term_table(kinds: Iterable[TermKind]) -> str:
    """The terms of any robot as a Markdown table, a row per term."""
    rows = ["| term | entries | unit | meaning |", "| --- | --- | --- | --- |"]
    for kind in kinds:
        each = kind.entries if isinstance(kind.entries, str) else ", ".join(kind.entries)
        rows.append(f"| {kind.name} | {each} | {kind.unit} | {kind.meaning} |")
    return "\n".join(rows)


@dataclass(eq=False)
class Whole(Block):
    """A whole observation."""

    out: np.ndarray  # (no,)
    first: int  # where the newest frame begins
    steps: Mutable[int]  # policy steps since the reset


@compiled
def age(whole: Whole):
    """Every frame becomes a step older, the oldest is forgotten."""
    out, first = whole.out, whole.first
    size = out.shape[0] - first
    for i in range(first):
        out[i] = out[i + size]


@compiled
def clip(whole: Whole):
    """Every entry into [−10, 10]; an episode begins as if it had long been as it is."""
    out, first = whole.out, whole.first
    for i in range(first, out.shape[0]):
        out[i] = min(max(out[i], -CLIP), CLIP)
    if whole.steps == 0:
        size = out.shape[0] - first
        for i in range(first - 1, -1, -1):
            out[i] = out[i + size]


def frames(terms: Sequence[Term], history: int) -> list[Term]:
    """The terms of as many policy steps, oldest first: `joint_pos[-1]` is one step old."""
    older = [replace(t, name=f"{t.name}[-{k}]") for k in range(history - 1, 0, -1) for t in terms]
    return [*older, *terms]


def observer(
    terms: Iterable[Term],
    out: np.ndarray,
    steps: Any,
    view: Callable[[type[Block], np.ndarray], Block],
) -> list[tuple[Callable[..., None], Block]]:
    """What fills the end of `out` (no,) with `terms`; before them lie older frames.

    `steps` (1,) holds the policy steps since the reset; `view(kind, out)` makes the terms' blocks.
    """
    terms = list(terms)
    first = len(out) - sum(term.size for term in terms)
    whole = Whole(out, first, steps)
    calls: list[tuple[Callable[..., None], Block]] = [(age, whole)] if first else []
    for term in terms:
        assert term.kernel is not None  # those of actions are not observed
        calls.append((term.kernel, view(term.view, out[first : first + term.size])))
        first += term.size
    return [*calls, (clip, whole)]


def mirror_terms(terms: Iterable[Term], parts: Mapping[str, Mirror]) -> Mirror:
    """The mirror image of values of these `terms`; `parts` by what their `image` names."""
    order, sign, first = [], [], 0
    for term in terms:
        part = parts[term.image] if term.image in parts else _plain(term)
        order.append(first + part.order)
        sign.append(part.sign)
        first += term.size
    return Mirror(np.concatenate(order), np.concatenate(sign))


def _plain(term: Term) -> Mirror:
    """The image of numbers and vectors, which keep their places, and of feet, which change them."""
    places = np.arange(term.size)
    if term.image == "feet":
        return Mirror(places[::-1].copy(), np.ones(term.size))
    signs = {"number": np.ones(3), "vector": SIDES, "turn": -SIDES, "between feet": -SIDES}
    axes = [0 if term.image == "number" else "xyz".index(entry[-1]) for entry in term.entries]
    return Mirror(places, signs[term.image][axes])
