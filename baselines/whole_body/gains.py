"""The configuration of the momentum QP: numbers without units, so that one set serves every
robot.

Accelerations are measured in g (linear) and g/h (angular, h the CoM's standing height), forces
in m g, moments in m g h; a stiffness of 1 is ω² = g/h and a damping of 1 is ω.
"""

from dataclasses import dataclass, field
from typing import Literal

from .compensation import ForceCompensation
from .contacts.contact import Contact
from .limits.limit import Limit
from .tasks.com import CoM
from .tasks.cop import CoP
from .tasks.posture import Posture
from .tasks.root import RootWrench
from .tasks.task import Task, TaskSpace
from .tasks.torques import Torques
from .tasks.wrenches import Wrenches

COMPILED_SOLVER = "active-set"


def _at_least(minimum: float, default: float):
    return field(default=default, metadata={"min": minimum})


def _above(bound: float, default: float):
    return field(default=default, metadata={"above": bound})


@dataclass(frozen=True)
class SoleContact:
    """J v̇ + J̇ v = −k_v J v; wrenches inside a fraction of the real cone, and small."""

    damping: float = _at_least(0.0, 5.0)
    friction_share: float = field(default=0.9, metadata={"above": 0.0, "max": 1.0})
    polygon_share: float = field(default=0.95, metadata={"above": 0.0, "max": 1.0})
    force_weight: float = _above(0.0, 1e-3)
    moment_weight: float = _above(0.0, 1e-3)


@dataclass(frozen=True)
class TorqueLimit:
    """|τ| ≤ `share` · τ_max, and a cost on τ."""

    share: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0})
    weight: float = _at_least(0.0, 0.0)


@dataclass(frozen=True)
class JointLimit:
    """v̇ may be what still lets a joint stop before its limit, braking with `brake`."""

    brake: float = _above(0.0, 4.0)
    horizon: float = _above(0.0, 0.1)  # in 1/ω
    floor: float = _above(0.0, 20.0)


@dataclass(frozen=True)
class MomentumQPConfig:
    """Tasks, contacts, limits and how they are solved [Macchietto09, Moskalev24 §2].

    `root`: "hard" lets nothing but the ground push the root (physics); "soft" adds a penalised
    wrench u_root on it (a game character that must not fail). `posture`, `com` and `cop` are tasks,
    null for none; `tasks`: further ones by name, see `tasks/`; `contacts`: contacts other than the
    soles, see `contacts/`; `limits`: what else bounds the solution, see `limits/`. Without `joint`
    (null) nothing stops joints before their limits. With `compensation` CoM and CoP lean against
    what pushes, see `compensation.py`.
    """

    kind: Literal["momentum-qp"] = "momentum-qp"
    period: float = field(default=0.004, metadata={"above": 0.0, "max": 0.05})  # [s]
    solver: str = COMPILED_SOLVER
    solver_options: dict[str, bool | float] = field(default_factory=dict)
    root: Literal["hard", "soft"] = "hard"
    root_weight: float = field(default=1e3, metadata={"above": 0.0})
    posture: Posture | None = field(default_factory=Posture)
    com: CoM | None = field(default_factory=CoM)
    cop: CoP | None = field(default_factory=CoP)
    contact: SoleContact = field(default_factory=SoleContact)
    torque: TorqueLimit = field(default_factory=TorqueLimit)
    joint: JointLimit | None = field(default_factory=JointLimit)
    compensation: ForceCompensation | None = field(default=None, metadata={"omit": "default"})
    tasks: dict[str, Task] = field(default_factory=dict, metadata={"omit": "default"})
    contacts: dict[str, Contact] = field(default_factory=dict, metadata={"omit": "default"})
    limits: dict[str, Limit] = field(default_factory=dict, metadata={"omit": "default"})

    def __post_init__(self) -> None:
        for name, task in self.tasks.items():
            if task.space is TaskSpace.ROOT and self.root != "soft":
                raise ValueError(f"tasks.{name}: weighs the wrench on a soft root; root is 'hard'")

    def objective(self) -> dict[str, Task]:
        """Return all tasks by name, in the order in which they read each other's desired force.

        These are `posture`, `com`, `cop`, `wrenches`, `torques` and with a soft root `root`, then
        those of `tasks`; one of these names there replaces it.
        """
        named: dict[str, Task | None] = {
            "posture": self.posture,
            "com": self.com,
            "cop": self.cop,
            "wrenches": Wrenches(
                force_weight=self.contact.force_weight, moment_weight=self.contact.moment_weight
            ),
            "torques": Torques(weight=self.torque.weight),
            "root": RootWrench(weight=self.root_weight) if self.root == "soft" else None,
        }
        return {name: task for name, task in (named | self.tasks).items() if task is not None}
