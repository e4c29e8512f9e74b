"""What a posture is to reach, how it is looked for, and by how much it misses that."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from poise.baselines.motion.clips.rotations import to_scipy
from poise.baselines.motion.graphs.joining.states import vector_rate
from poise.configs.errors import ConfigError
from poise.configs.numbers import finite_array, whole_number
from poise.configs.problems import out_of_range

from .chain import Chain


@dataclass(frozen=True, eq=False)
class IkGoal:
    """A point of a body is to be at a place; the body may be asked to lie in an orientation, too.

    Attributes:
        body: its name.
        position: (3,) in the world [m].
        orientation: (4,) of the body in the world, a quaternion, scalar first; None for any.
        point: (3,) in the body's axes [m].
        weight: above 0, beside those of other goals.

    Raises:
        ConfigError: other than finite numbers, a quaternion of length 0, a weight not above 0.
    """

    body: str
    position: np.ndarray
    orientation: np.ndarray | None = None
    point: np.ndarray = (0.0, 0.0, 0.0)  # type: ignore[assignment] # made an array below
    weight: float = 1.0

    def __post_init__(self) -> None:
        for name, size in (("position", 3), ("orientation", 4), ("point", 3)):
            value = getattr(self, name)
            if value is None and name == "orientation":
                continue
            array = finite_array(value, (size,))
            if array is None or (size == 4 and np.linalg.norm(array) < 1e-9):
                raise ConfigError(f"must be {size} finite numbers", source=f"goal {self.body!r}",
                                  field=name)  # fmt: skip
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if not 0.0 < self.weight < np.inf:
            raise ConfigError(f"must be above 0, not {self.weight:g}",
                              source=f"goal {self.body!r}", field="weight")  # fmt: skip


@dataclass(frozen=True)
class IkOptions:
    """How a posture is looked for.

    Attributes:
        iterations: at most as many steps from one start; of CCD, sweeps over all joints.
        tolerance: residual [m] at which goals are reached.
        lever: metres that count as much as a radian of an orientation.
        damping: λ of the damped method [m].
        largest_step: of any joint in one step [rad or m]; the whole step is shortened.
        patience: steps without a smaller residual after which a method has come to its end.
        limits: whether joints keep their limits.

    Raises:
        ConfigError: a number that is not above 0, a count below 1.
    """

    iterations: int = 200
    tolerance: float = 1e-4
    lever: float = 0.2
    damping: float = 0.05
    largest_step: float = 1.0
    patience: int = 20
    limits: bool = True

    def __post_init__(self) -> None:
        for name in ("iterations", "patience"):
            whole_number(getattr(self, name), 1, name)
        for name in ("tolerance", "lever", "damping", "largest_step"):
            if not 0.0 < (value := getattr(self, name)) < np.inf:
                raise out_of_range(value, field=name, above=0, form="g")


@dataclass(frozen=True, eq=False)
class IkResult:
    """A posture and how near it comes to its goals.

    Attributes:
        qpos: (nq,) of the whole robot; the base is where it was.
        residual: the largest √(‖p − p*‖² + ℓ²‖Log(R*ᵀ R)‖²) of a goal [m].
        iterations: steps taken, those of all starts together.
        starts: how many starts were tried.
        reached: whether the residual is at most the tolerance.
        within_limits: whether every joint of the chain is within its limits.
        objective: what the bounded method makes least, with the prior; of the others ½‖e‖².
    """

    qpos: np.ndarray
    residual: float
    iterations: int
    starts: int
    reached: bool
    within_limits: bool
    objective: float

    def __post_init__(self) -> None:
        self.qpos.setflags(write=False)


class Misses:
    """The errors of goals in the axes of a chain's base.

    e stacks w (p − p*) and, for a goal with an orientation, w ℓ Log(R*ᵀ R) of every goal, with its
    weight w and the lever ℓ [m per rad].
    """

    def __init__(self, chain: Chain, goals: Sequence[IkGoal], lever: float):
        self.chain, self.goals, self.lever = chain, tuple(goals), lever
        place, axes = (part.copy() for part in chain.frame())
        self.places = np.array([axes.T @ (goal.position - place) for goal in goals])
        self.turns = [
            None if goal.orientation is None
            else axes.T @ to_scipy(goal.orientation).as_matrix()[0]
            for goal in goals
        ]  # fmt: skip

    def errors(self) -> tuple[np.ndarray, np.ndarray]:
        """(g, 3) distances p − p* [m] and (g, 3) rotation vectors [rad], 0 where any will do."""
        moved, turned = np.zeros((2, len(self.goals), 3))
        for i, goal in enumerate(self.goals):
            place, axes = self.chain.end_pose(i, goal.point)
            moved[i] = place - self.places[i]
            if (wanted := self.turns[i]) is not None:
                turned[i] = Rotation.from_matrix(wanted.T @ axes).as_rotvec()
        return moved, turned

    def residual(self) -> float:
        """The largest √(‖p − p*‖² + ℓ²‖Log(R*ᵀ R)‖²) of a goal [m]."""
        moved, turned = self.errors()
        squares = (moved**2).sum(axis=1) + self.lever**2 * (turned**2).sum(axis=1)
        return float(np.sqrt(squares.max()))

    def vector(self) -> np.ndarray:
        """(r,) e."""
        moved, turned = self.errors()
        parts = []
        for i, goal in enumerate(self.goals):
            parts.append(goal.weight * moved[i])
            if self.turns[i] is not None:
                parts.append(goal.weight * self.lever * turned[i])
        return np.concatenate(parts)

    def jacobian(self) -> np.ndarray:
        """(r, n) ∂e/∂q, with d Log(R*ᵀ R) = J_r⁻¹ Rᵀ J_ω dq."""
        rows = []
        for i, goal in enumerate(self.goals):
            of_place, of_turn = self.chain.jacobians(i, goal.point)
            rows.append(goal.weight * of_place)
            if (wanted := self.turns[i]) is not None:
                axes = self.chain.end_pose(i, goal.point)[1]
                turn = Rotation.from_matrix(wanted.T @ axes).as_rotvec()
                rates = vector_rate(turn, (axes.T @ of_turn).T).T
                rows.append(goal.weight * self.lever * rates)
        return np.concatenate(rows)
