"""A guard's decision, at the start of each policy step, who moves the robot."""

from dataclasses import dataclass

import numpy as np

from poise.baselines.environments.hand_over import (
    AUTHORITY,
    CALM,
    OPEN,
    HandOver,
    WholeStep,
    is_calm,
    shared_tick,
)
from poise.baselines.environments.policy_step import PolicyStep, capture_error
from poise.envs.balance.mdp.termination import uprightness
from poise.envs.compiled.block import Block
from poise.envs.compiled.callbacks import call_back
from poise.envs.compiled.jit import compiled
from poise.envs.physics.kinematics import support_distance, update_support


@dataclass(frozen=True, eq=False)
class Guard(Block):
    """The limits beyond which the guard takes over, and how often it did."""

    margin: float  # [m]
    cos_tilt: float
    count: np.ndarray  # (1,) int: of the episode


@dataclass(frozen=True, eq=False)
class GuardStep(Block):
    """All that a policy step works on."""

    whole: WholeStep
    guard: Guard


@compiled
def is_off(g: Guard, step: PolicyStep) -> bool:
    """Return whether what is believed of the robot is beyond the guard's limits."""
    robot, s = step.inputs.robot, step.inputs.state
    update_support(robot, s)
    outside = -support_distance(s, s.capture_point[0], s.capture_point[1])
    return outside > g.margin or uprightness(robot, s) < g.cos_tilt


@compiled
def set_guard(g: Guard, h: HandOver, step: PolicyStep):
    """Take over, or hand back to the walker, which begins anew."""
    a, m = step.inputs, h.memory
    if m[OPEN] == 0.0:
        if is_off(g, step):
            m[OPEN], m[CALM] = 1.0, 0.0
            g.count[0] += 1
    else:
        distance = capture_error(a.state, a.motion, a.com_offset)
        m[CALM] = m[CALM] + 1.0 if is_calm(h, step, distance) else 0.0
        if m[CALM] >= h.calm_steps:
            m[OPEN] = 0.0
            call_back(h.begin)
    m[AUTHORITY] = m[OPEN]


@compiled
def guard_tick(step: GuardStep):
    """A control tick of the walker, or one of the recovery policy's servos alone."""
    base = step.whole.base
    if base.episode.ticks[0] == 0:
        set_guard(step.guard, step.whole.hand, base)
    shared_tick(step.whole)
