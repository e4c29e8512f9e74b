"""The entries of an action: which targets they move, and how far."""

from dataclasses import dataclass, field

import numpy as np

from poise.baselines.balance.references.targets import NAMES, STEPS, TARGETS, no_offsets
from poise.envs.balance.mdp.observation import Term
from poise.envs.compiled.memory import guarded_zeros

from .policy_step import Residual


@dataclass(frozen=True)
class ResidualScales:
    """The offsets that an action of 1 gives, heading frame; a scale of 0 takes an entry away.

    Attributes:
        com: Offset of the CoM's target along x and y [m].
        cop: Offset of the CoP's target along x and y [m].
        height: Offset of the CoM's target height [m].
        lean: Lean of the root about x and y [rad].
        momentum: Angular momentum that is asked for about x and y [m h² ω].
        torque: Torque added to each motor's, over its limit.
    """

    com: float = field(default=0.2, metadata={"min": 0.0})
    cop: float = field(default=0.15, metadata={"min": 0.0})
    height: float = field(default=0.0, metadata={"min": 0.0})
    lean: float = field(default=0.0, metadata={"min": 0.0})
    momentum: float = field(default=0.0, metadata={"min": 0.0})
    torque: float = field(default=0.0, metadata={"min": 0.0, "omit": "default"})

    def entries(self) -> dict[str, float]:
        """The scale of each target that can be moved, in the order of `TARGETS`."""
        scales = (
            self.com, self.com, self.cop, self.cop, self.height,
            self.lean, self.lean, self.momentum, self.momentum,
        )  # fmt: skip
        return dict(zip(TARGETS, scales, strict=True))


@dataclass(frozen=True)
class StepScales(ResidualScales):
    """The offsets that an action of 1 gives, heading frame; a scale of 0 takes an entry away.

    Attributes:
        foothold: Offset of the next foothold along x and y [m].
        time: Change of the time that the next step takes [s].
        trigger: Change of the distance at which a step begins [m].
    """

    com: float = field(default=0.1, metadata={"min": 0.0})
    cop: float = field(default=0.05, metadata={"min": 0.0})
    foothold: float = field(default=0.15, metadata={"min": 0.0})
    time: float = field(default=0.08, metadata={"min": 0.0})
    trigger: float = field(default=0.0, metadata={"min": 0.0})

    def entries(self) -> dict[str, float]:
        """The scale of each target that can be moved: those of the base class come first."""
        scales = self.foothold, self.foothold, self.time, self.trigger
        return {**super().entries(), **dict(zip(STEPS, scales, strict=True))}


@dataclass(frozen=True)
class WholeScales(ResidualScales):
    """The offsets of the controller's targets that an action of 1 gives; by default none."""

    com: float = field(default=0.0, metadata={"min": 0.0})  # Δc_ref x, y [m]
    cop: float = field(default=0.0, metadata={"min": 0.0})  # Δp_ref x, y [m]

    def __post_init__(self) -> None:
        if self.torque > 0.0:
            raise ValueError("torque: must be 0, here the servos move them")


@dataclass(frozen=True)
class Lag:
    """The lag and the gate between the action and the targets."""

    smoothing: float = field(default=0.0, metadata={"min": 0.0})  # τ [s]
    gate: float = field(default=0.0, metadata={"min": 0.0})  # d₀ [m]


def make_residual(
    scales: ResidualScales,
    lag: Lag,
    policy_period: float,
    momentum: float,
    torque_limit: np.ndarray,
) -> Residual:
    """The law by which an action becomes offsets: one entry for each scale above 0.

    In a policy step of T = `policy_period` [s] the residual goes 1 − e^(−T/τ) of the way to the
    action. `momentum` [N·m·s] is the m h² ω of the robot, `torque_limit` (nu,) [N·m] its motors'.
    """
    scale = np.array(list(scales.entries().values()))
    moved = np.flatnonzero(scale)
    scale[[NAMES.index("momentum_x"), NAMES.index("momentum_y")]] *= momentum
    blend = 1.0 if lag.smoothing == 0.0 else -np.expm1(-policy_period / lag.smoothing)
    return Residual(
        moved=moved,
        scale=scale[moved],
        blend=float(blend),
        gate=lag.gate,
        offsets=no_offsets(),
        torque_scale=scales.torque * torque_limit if scales.torque > 0.0 else np.zeros(0),
        torques=guarded_zeros(len(torque_limit) if scales.torque > 0.0 else 0),
    )


def action_term(name: str) -> Term:
    """The term that tells a mirror what the action `name` is."""
    if name[-2:] not in ("_x", "_y", "_z"):
        return Term(name, (name,), "1", "", "number")
    turns = name.startswith(("lean", "momentum"))
    return Term(name, (name,), "1", "", "turn" if turns else "vector")
