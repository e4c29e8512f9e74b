"""Targets that lean against what pushes: CoM and CoP moved by an estimated external force.

At rest under a horizontal force F at the height z the CoP lies below the CoM's projection but for

    p − c = F z/W,    W the weight,

and a controller that keeps c in the middle has its CoP at the edge of the soles long before it need
be. With c moved by −F z/W the CoP stays in the middle [Stephens07]. So c_ref and p_ref are moved by

    Δ = −(h/W) k F̂ − λ d F̄/|F̄| min(|F̄|/F₀, 1) |F̄|/S

F̂ is the force that `push_force.py` estimates from momentum and CoP, F̄ its mean over the last
seconds and S that of |F̂|. The first part answers a push that lasts. The second one is for pushes
that come again from one side: it stays between them, and is zero for pushes from all sides, whose
|F̄|/S is. λ ∈ [0, 1] falls while the capture point is away from where it is to be, so that the
recovery from a push is that of the controller without it, and returns slowly. Δ is shortened where
c_ref would leave the support polygon but for a margin. F̂ passes two low-passes, since it jumps with
the contacts' forces, and torques would jump with it.
"""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from poise.baselines.controller import TargetArrays
from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import copy_into
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import (
    StateArrays,
    borne_weight,
    support_distance,
    update_support,
)
from poise.envs.sensing.push_force import (
    MEMORY,
    PushForce,
    forget_pushes,
    observe_push,
    push_force,
)

HALVINGS = 6  # of the search for how far Δ may go
LEAST = 1e-4  # [m] a shorter Δ is none


def _number(default: float, **bounds: float):
    return field(default=default, metadata=bounds)


@dataclass(frozen=True)
class ForceCompensation:
    """Gains of `compensation.py`, without units: lengths in h, times in 1/ω, forces in m g."""

    gain: float = _number(1.0, min=0.0, max=3.0)  # k of F̂
    smoothing: float = _number(0.35, min=0.0)  # τ of F̂ [1/ω]
    settling: float = _number(0.35, min=0.0)  # of the second low-pass [1/ω]
    reach: float = _number(0.07, min=0.0, max=0.5)  # d, for pushes from one side [h]
    memory: float = _number(MEMORY, above=0.0)  # T of F̄ [1/ω]
    full_at: float = _number(0.005, above=0.0)  # F₀ [m g]
    release: float = _number(0.03, above=0.0)  # of the capture point from its place [h]
    return_time: float = _number(1.0, min=0.0)  # of λ [1/ω]
    margin: float = _number(0.02, min=0.0)  # of c_ref from the edge of the support [h]


@dataclass(eq=False)
class Compensation(Block):
    """All that `compensate` works on; in SI units."""

    active: bool
    observes: bool  # false: whoever calls the tick calls `watch`
    robot: RobotArrays
    state: StateArrays
    given: TargetArrays  # what is asked of the controller
    moved: TargetArrays  # the same but for CoM and CoP, which are arrays of their own
    push: PushForce
    period: float  # [s]
    part: float  # of a tick, of the second low-pass
    gain: float
    reach: float  # [m]
    full_at: float  # [N]
    release: float  # [m]
    return_time: float  # [s]
    margin: float  # [m]
    force: Annotated[np.ndarray, 2]  # F̂ after the second low-pass [N], world
    shift: Annotated[np.ndarray, 2]  # Δ [m], world
    share: Mutable[float]  # λ


def make_compensation(
    config: ForceCompensation | None,
    robot: RobotArrays,
    state: StateArrays,
    given: TargetArrays,
    period: float,
    observes: bool,
) -> Compensation:
    """The block of a controller with this `period` [s]; inactive without a configuration, when the
    targets are those that are given."""
    active, c = config is not None, config or ForceCompensation()
    h, omega, force = robot.units.height, robot.units.omega, robot.units.force
    moved = given.replace(com=guarded_zeros(3), cop=guarded_zeros(2)) if active else given
    made = Compensation.allocate(
        active=active, observes=observes, robot=robot, state=state, given=given, moved=moved,
        push=push_force(omega, c.smoothing, c.memory),
        period=period, part=period / (c.settling / omega + period),
        gain=c.gain, reach=c.reach * h, full_at=c.full_at * force,
        release=c.release * h, return_time=c.return_time / omega, margin=c.margin * h,
    )  # fmt: skip
    forget_compensation(made)
    return made


def rebound(c: Compensation, state: StateArrays, given: TargetArrays) -> Compensation:
    """The same, with the same memory, of another state or other targets."""
    if c.state is state and c.given is given:
        return c
    moved = given.replace(com=c.moved.com, cop=c.moved.cop) if c.active else given
    return c.replace(state=state, given=given, moved=moved)


def forget_compensation(c: Compensation) -> None:
    """Start an episode."""
    forget_pushes(c.push)
    c.force[:] = c.shift[:] = 0.0
    c.share = 1.0


@compiled
def set_share(c: Compensation) -> None:
    """λ: down at once while ξ is away from c_ref + Δ, and back in `return_time`."""
    s, t = c.state, c.given
    x = s.capture_point[0] - t.com[0] - c.shift[0]
    y = s.capture_point[1] - t.com[1] - c.shift[1]
    if x * x + y * y > c.release * c.release:
        c.share = 0.0
    else:
        c.share += c.period / (c.return_time + c.period) * (1.0 - c.share)


@compiled
def watch(c: Compensation) -> None:
    """Observe what pushes in this tick."""
    observe_push(c.push, c.robot, c.state, c.period)


@compiled
def set_shift(c: Compensation) -> None:
    """Δ, before it is shortened."""
    s, push = c.state, c.push
    height = max(s.com[2] - s.origin[2], 0.2 * c.robot.height_com)
    per_force = c.gain * height / borne_weight(c.robot, s)
    mean, lasting = np.sqrt(push.mean[0] * push.mean[0] + push.mean[1] * push.mean[1]), 0.0
    if mean > 0.0:
        one_sided = min(mean / push.size, 1.0)
        lasting = c.share * c.reach * min(mean / c.full_at, 1.0) * one_sided / mean
    for a in range(2):
        c.force[a] += c.part * (push.force[a] - c.force[a])
        c.shift[a] = -per_force * c.force[a] - lasting * push.mean[a]


@compiled
def keep_supported(c: Compensation) -> None:
    """Shorten Δ so that c_ref + Δ stays `margin` within the support, as far as c_ref is."""
    x, y, com, s = c.shift[0], c.shift[1], c.given.com, c.state
    if x * x + y * y < LEAST * LEAST:
        return
    update_support(c.robot, s)
    least = min(support_distance(s, com[0], com[1]), c.margin)
    if support_distance(s, com[0] + x, com[1] + y) >= least:
        return
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if support_distance(s, com[0] + middle * x, com[1] + middle * y) >= least:
            low = middle
        else:
            high = middle
    c.shift[0], c.shift[1] = low * x, low * y


@compiled
def compensate(c: Compensation) -> None:
    """Move the targets of this tick against what pushes."""
    if c.observes:
        watch(c)
    set_share(c)
    set_shift(c)
    keep_supported(c)
    move_targets(c)


@compiled
def move_targets(c: Compensation) -> None:
    """c_ref + Δ and p_ref + Δ."""
    copy_into(c.given.com, c.moved.com)
    copy_into(c.given.cop, c.moved.cop)
    for a in range(2):
        c.moved.com[a] += c.shift[a]
        c.moved.cop[a] += c.shift[a]
