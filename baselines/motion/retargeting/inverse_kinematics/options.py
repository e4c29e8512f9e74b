"""What the methods of inverse kinematics are asked for, and what they answer."""

from dataclasses import dataclass

import numpy as np

from poise.configs.errors import ConfigError
from poise.configs.numbers import whole_number


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
                raise ConfigError(f"must be above 0, not {value:g}", field=name)


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
