"""The environment of a recovery policy that guards a walker, and the guard's decision.

At the start of each policy step the guard selects the walker or the recovery policy.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from poise.baselines.controller import BaseController, Controller
from poise.baselines.environments.hand_over import (
    HandOver,
    WholeStep,
    is_calm,
    shared_tick,
)
from poise.baselines.environments.policy_step import PolicyStep, capture_error
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.configs.errors import ConfigError
from poise.envs.balance.mdp.termination import uprightness
from poise.envs.compiled.block import Block
from poise.envs.compiled.callbacks import call_back
from poise.envs.compiled.calls import CompiledStep, address_of
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.kinematics import support_distance, update_support

from .config import GuardConfig


@dataclass(eq=False)
class Guard(Block):
    """The limits beyond which the guard takes over, and how often it did."""

    margin: float  # [m]
    cos_tilt: float
    count: Mutable[int]  # in the episode


@dataclass(eq=False)
class GuardStep(Block):
    """All that a policy step works on."""

    whole: WholeStep
    guard: Guard


@compiled
def is_off(g: Guard, step: PolicyStep) -> bool:
    """Return whether the estimated state is beyond the guard's limits."""
    robot, s = step.inputs.robot, step.inputs.state
    update_support(robot, s)
    outside = -support_distance(s, s.capture_point[0], s.capture_point[1])
    return outside > g.margin or uprightness(robot, s) < g.cos_tilt


@compiled
def set_guard(g: Guard, h: HandOver, step: PolicyStep):
    """Take over, or hand back to the walker, which restarts."""
    a, m = step.inputs, h.memory
    if not m.open:
        if is_off(g, step):
            m.open, m.calm = 1, 0.0
            g.count += 1
    else:
        distance = capture_error(a.state, a.motion, a.com_offset)
        m.calm = m.calm + 1.0 if is_calm(h, step, distance) else 0.0
        if m.calm >= h.calm_steps:
            m.open = 0
            call_back(h.begin)
    m.authority = m.open


@compiled
def guard_tick(step: GuardStep):
    """A control tick of the walker, or one of the recovery policy's servos alone."""
    base = step.whole.base
    if base.episode.ticks == 0:
        set_guard(step.guard, step.whole.hand, base)
    shared_tick(step.whole)


class GuardedEnv(ResidualWholeEnv):
    """A walker, `controller`, from which servos that the action moves take over in need.

    Action: as of `ResidualWholeEnv`; its last entry, `authority`, has no effect. The servos have
    all torques from when a limit of `guard` is passed until the robot was calm. Before and after
    that the walker has them, bit for bit as alone.

    Observation: <observation>

    Walker, guard and observation use the same estimate of the state: the guard needs the velocity
    of the root, which no sensor measures.

    <rewards>

    <start>
    """

    def __init__(self, *arguments: Any, guard: GuardConfig, **named: Any):
        self.guard = guard
        self._guard = Guard(guard.margin, float(np.cos(guard.tilt)), 0)
        super().__init__(*arguments, **named)

    def _accept(self, controller: Controller, base: BaseController) -> None:
        super()._accept(controller, base)
        if self.command is None:
            raise ConfigError("does not walk: it sees no velocity_commands", field="walker")

    @property
    def takeovers(self) -> int:
        """How often the guard took over in this episode."""
        return self._guard.count

    def use_raw(self, raw: bool) -> None:
        """Estimate the state, also for a walker that takes raw measurements."""
        super().use_raw(False)

    def arguments(self) -> dict[str, Any]:
        return {**super().arguments(), "guard": self.guard}

    def _begin(self, options: Mapping[str, Any]) -> None:
        super()._begin(options)
        self._guard.count = 0

    def _restart_controller(self) -> None:
        """The walker's new beginning, with the command that holds now."""
        orders = self._expect_orders("guard")
        now = orders.copy()
        super()._restart_controller()
        orders[:] = now

    def _stepping(self, bound: PolicyStep) -> CompiledStep:
        step = GuardStep(self.whole_step(bound), self._guard)
        return CompiledStep(address_of(guard_tick, step), step, bound.ticks)
