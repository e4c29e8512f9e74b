"""Gains of the built-in tasks, contacts and limits of the momentum QP: numbers without units, so
that one set serves every robot.

Accelerations are measured in g (linear) and g/h (angular, h the CoM's standing height), forces
in m g, moments in m g h; a stiffness of 1 is ω² = g/h and a damping of 1 is ω.
"""

from dataclasses import dataclass, field
from typing import Literal

from .compensation import ForceCompensation
from .contacts.contact import Contact
from .limits.limit import Limit
from .tasks.task import Task

COMPILED_SOLVER = "active-set"


def _at_least(minimum: float, default: float):
    return field(default=default, metadata={"min": minimum})


def _above(bound: float, default: float):
    return field(default=default, metadata={"above": bound})


@dataclass(frozen=True)
class PostureTask:
    """h_t = ‖v̇ − (a_ref + k_t (q_ref ⊖ q) + d_t (v_ref − v))‖², weights per kind of joint.

    Joints are classified by what they carry: legs move one sole, the trunk moves several, the
    rest (arms, head) none. Damping is d_t = 2 ζ √k_t. All weights fall to a fraction of themselves
    as the CoM leaves c_ref: β = s + (1 − s) exp(−(|c − c_ref|/d)²), horizontally [Abe07]; then
    balance counts more than the posture.
    """

    leg_weight: float = _above(0.0, 1.0)
    trunk_weight: float = _above(0.0, 1.0)
    free_weight: float = _above(0.0, 1.0)
    root_weight: float = _at_least(0.0, 1.0)  # orientation of the root
    stiffness: float = _at_least(0.0, 2.5)
    free_stiffness: float = _at_least(0.0, 2.5)
    root_stiffness: float = _at_least(0.0, 2.5)
    damping_ratio: float = _at_least(0.0, 1.0)
    far_share: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0})  # s; 1: no fall
    far_distance: float = _above(0.0, 0.02)  # d, in h


@dataclass(frozen=True)
class CoMTask:
    """h_c = ‖A_P v̇ + Ȧ_P v − Ṗ_des‖², Ṗ_des = m (c̈_ref + s_c (c_ref − c) + d_c (ċ_ref − ċ)).

    `offset` moves the default c_ref and p_ref forward of the middle of the soles, in h, on a robot
    whose description has `posture.com: controller`; others stand as their posture has the CoM.
    """

    weight: float = _at_least(0.0, 3600.0)
    height_weight: float = _at_least(0.0, 3600.0)
    stiffness: float = _at_least(0.0, 3.0)
    height_stiffness: float = _at_least(0.0, 3.0)
    damping_ratio: float = _at_least(0.0, 1.0)
    offset: float = field(default=0.0, metadata={"min": -0.2, "max": 0.2})


@dataclass(frozen=True)
class CoPTask:
    """h_p = ‖A_L v̇ + Ȧ_L v − L̇_des‖², L̇_des = (p_des − c) × (Ṗ_des − m g) − k_L L.

    p_des integrates p̈_des = −s_p (p − p_ref) − d_p ṗ over `horizon` from the measured p.
    """

    weight: float = _at_least(0.0, 0.1)
    yaw_weight: float = _at_least(0.0, 0.1)
    stiffness: float = _at_least(0.0, 20.0)
    damping: float = _at_least(0.0, 2.0)
    horizon: float = _above(0.0, 0.05)  # in 1/ω
    angular_damping: float = _at_least(0.0, 0.0)


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
    wrench u_root on it (a game character that must not fail). `tasks`: what else v̇ is to do, each
    under a name of its own, see `tasks/`; `contacts`: contacts other than the soles, see
    `contacts/`; `limits`: what else bounds the solution, see `limits/`. Without `joint` (null)
    nothing stops joints before their limits. With `compensation` CoM and CoP lean against what
    pushes, see `compensation.py`.
    """

    kind: Literal["momentum-qp"] = "momentum-qp"
    period: float = field(default=0.004, metadata={"above": 0.0, "max": 0.05})  # [s]
    solver: str = COMPILED_SOLVER
    solver_options: dict[str, bool | float] = field(default_factory=dict)
    root: Literal["hard", "soft"] = "hard"
    root_weight: float = field(default=1e3, metadata={"above": 0.0})
    posture: PostureTask = field(default_factory=PostureTask)
    com: CoMTask = field(default_factory=CoMTask)
    cop: CoPTask = field(default_factory=CoPTask)
    contact: SoleContact = field(default_factory=SoleContact)
    torque: TorqueLimit = field(default_factory=TorqueLimit)
    joint: JointLimit | None = field(default_factory=JointLimit)
    compensation: ForceCompensation | None = field(default=None, metadata={"omit": "default"})
    tasks: dict[str, Task] = field(default_factory=dict, metadata={"omit": "default"})
    contacts: dict[str, Contact] = field(default_factory=dict, metadata={"omit": "default"})
    limits: dict[str, Limit] = field(default_factory=dict, metadata={"omit": "default"})
