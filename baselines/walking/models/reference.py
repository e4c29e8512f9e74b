"""The interface of reference models: their inputs and outputs of a tick.

All models share the horizontal balance of `dcm.py`. A model says how high the hip of a leg that
bears the robot is over its ankle, from the horizontal way of the CoM. On both feet the heights of
both legs count as much as their loads are to be, w and 1 − w, so that height and its first two
derivatives are continuous. The hip moves as the CoM does.
"""

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np

from poise.baselines.whole_body.parts.part import Bound
from poise.baselines.whole_body.tasks.task import Rows, Task, TaskInput, TaskTick
from poise.configs.kinds import OfKind
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.easing import eased
from poise.envs.compiled.maths.pendulum import Units
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot

from .legs import LegArrays


@dataclass(eq=False)
class Reference(Block):
    """Inputs and outputs of a model; legs in the order of the soles."""

    legs: LegArrays
    gravity: float  # g [m/s²]
    period: float  # of a tick [s]
    begun: Mutable[int]  # 0 in the first tick of a walk
    share: Annotated[np.ndarray, 3, 2]  # of the load that each leg is to bear, and its rates [s]
    com_vel: Annotated[np.ndarray, 2]  # horizontal [m/s]
    com_acc: Annotated[np.ndarray, 2]  # horizontal, asked for [m/s²]
    cop: Annotated[np.ndarray, 2]  # asked for [m]
    ahead: Annotated[np.ndarray, 2]  # unit vector of the heading
    time_left: Mutable[float]  # until touchdown, or until the foot behind leaves [s]
    landing: Annotated[np.ndarray, 2]  # the swinging sole's foothold [m]
    # answers: by how much the CoM is to be higher [m], ż and z̈ [m, s]; accelerations of the
    # flexions, forward ones of the thighs [rad/s²], and their weights
    height: Annotated[np.ndarray, 3]
    knee: Annotated[np.ndarray, 2, 2]
    hip: Annotated[np.ndarray, 2, 2]


@dataclass(frozen=True)
class ReferenceModel(OfKind):
    """Base of the models. A subclass is a frozen dataclass of numbers, with a `kind`.

    `bind` makes the program that fills `Reference.height` in a tick, and `knee` and `hip` where the
    model has rows in the QP, from the inputs that the walk has set.
    """

    room: ClassVar[str] = str(__package__)
    has_rows: ClassVar[bool] = False  #: whether it asks for accelerations of the stance leg
    keeps_height: ClassVar[bool] = False  #: whether the gait's own constant height holds

    def bind(self, robot: Robot, state: StateArrays, reference: Reference) -> Program:
        """The model's kernel with its block; numbers in SI units."""
        raise NotImplementedError


@dataclass(frozen=True)
class RowWeights:
    """Weights of the stance leg's rows in the QP, and the stiffness with which it follows."""

    knee: float = field(default=0.0, metadata={"min": 0.0})  # per (g/h)²
    hip: float = field(default=0.0, metadata={"min": 0.0})
    stiffness: float = field(default=20.0, metadata={"min": 0.0})  # ω²
    damping_ratio: float = field(default=1.0, metadata={"min": 0.0})


@dataclass(frozen=True, eq=False)
class RowGains(Block):
    """`RowWeights` in SI units."""

    knee: float
    hip: float
    stiffness: float  # [1/s²]
    damping: float  # [1/s]


def row_gains(weights: RowWeights, units: Units) -> RowGains:
    """The weights for a robot with these units."""
    k = weights.stiffness * units.omega**2
    return RowGains(
        knee=weights.knee / units.omega**4, hip=weights.hip / units.omega**4,
        stiffness=k, damping=2.0 * weights.damping_ratio * float(np.sqrt(k)),
    )  # fmt: skip


def allocate_reference(robot: Robot, period: float, legs: LegArrays) -> Reference:
    """The reference of a robot that has not walked."""
    return Reference.allocate(legs=legs, gravity=float(robot.units.gravity), period=period)


@compiled
def way_of(r: Reference, leg: int) -> tuple[float, float, float]:
    """d², d ḋ and ḋ² + d d̈ of the horizontal distance d of a leg's hip from its ankle [m, s]."""
    x = r.legs.hip[leg, 0] - r.legs.ankle[leg, 0]
    y = r.legs.hip[leg, 1] - r.legs.ankle[leg, 1]
    u, v = r.com_vel[0], r.com_vel[1]
    return (
        x * x + y * y,
        x * u + y * v,
        u * u + v * v + x * r.com_acc[0] + y * r.com_acc[1],
    )


@compiled
def add_height(r: Reference, leg: int, z: float, rise: float, accel: float) -> None:
    """Add the height z, ż, z̈ of a leg's hip over its ankle, weighted by the leg's share."""
    w, w1, w2 = r.share[0, leg], r.share[1, leg], r.share[2, leg]
    ground = r.legs.ankle[leg, 2]
    r.height[0] += w * (ground + z - r.legs.hip[leg, 2])
    r.height[1] += w * rise + w1 * (ground + z)
    r.height[2] += w * accel + 2.0 * w1 * rise + w2 * (ground + z)


@compiled
def clear_answers(r: Reference) -> None:
    """Set all answers to zero."""
    for a in range(3):
        r.height[a] = 0.0
    for i in range(2):
        for a in range(2):
            r.knee[i, a] = r.hip[i, a] = 0.0


@compiled
def ask_flexion(
    r: Reference, leg: int, gains: RowGains, flexion: float, rate: float, accel: float
) -> None:
    """Ask a leg's knee to follow β, β̇, β̈, as much as the leg is to bear."""
    r.knee[leg, 0] = (
        accel
        + gains.stiffness * (flexion - r.legs.flexion[leg])
        + gains.damping * (rate - r.legs.flexion_rate[leg])
    )
    r.knee[leg, 1] = r.share[0, leg] * gains.knee


@compiled
def share_load(r: Reference, leg: int, fraction: float, duration: float) -> None:
    """Set the shares w of `leg` and 1 − w of the other one, `fraction` of a transfer of
    `duration` [s] over: w = 10 s³ − 15 s⁴ + 6 s⁵, whose first two derivatives are 0 at both ends.
    An infinite duration has no rates."""
    s = min(max(fraction, 0.0), 1.0)
    w = eased(s)
    rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / duration
    accel = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (duration * duration)
    for i, sign in ((leg, 1.0), (1 - leg, -1.0)):
        r.share[0, i] = w if i == leg else 1.0 - w
        r.share[1, i], r.share[2, i] = sign * rate, sign * accel


@dataclass(frozen=True, eq=False)
class LegRowsBlock(Block):
    """A leg, and the reference whose answers its rows are."""

    leg: int
    reference: Reference


@compiled
def fill_leg_rows(t: TaskTick[LegRowsBlock]) -> None:
    """The rows of a leg, see `LegRows`."""
    leg, r, rows = t.task.leg, t.task.reference, t.rows
    rows.A[0, r.legs.knee_dof[leg]] = r.legs.knee_sign[leg]
    rows.A[1, r.legs.hip_dof[leg]] = r.legs.hip_sign[leg]
    rows.b[0], rows.weights[0] = r.knee[leg, 0], r.knee[leg, 1]
    rows.b[1], rows.weights[1] = r.hip[leg, 0], r.hip[leg, 1]


@dataclass(frozen=True)
class LegRows(Task[LegRowsBlock]):
    """± q̈_knee = β̈ and ± q̈_hip = φ̈ of a stance leg [Zhao, OBJ2].

    It has no `kind`: its accelerations and weights come from a reference model.
    """

    size: ClassVar[int] = 2
    kernel = staticmethod(fill_leg_rows)

    def rows(self, t: TaskInput, block: LegRowsBlock) -> Rows:
        """The rows in v̇, in NumPy."""
        r, leg = block.reference, block.leg
        A = np.zeros((2, len(t.state.qvel)))
        A[0, r.legs.knee_dof[leg]] = r.legs.knee_sign[leg]
        A[1, r.legs.hip_dof[leg]] = r.legs.hip_sign[leg]
        asked = np.array([r.knee[leg], r.hip[leg]])
        return Rows(A, asked[:, 0], asked[:, 1])


def leg_task(leg: int, reference: Reference) -> Bound[Task]:
    """The task of the QP for one leg."""
    return Bound(LegRows(), LegRowsBlock(leg, reference))
