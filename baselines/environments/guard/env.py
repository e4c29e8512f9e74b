"""The environment of a recovery policy that guards a walker."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from poise.baselines.controller import Controller
from poise.baselines.environments.policy_step import PolicyStep
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.configs.errors import ConfigError
from poise.envs.compiled.calls import CompiledStep, address_of
from poise.envs.compiled.memory import guarded_zeros

from .config import GuardConfig
from .tick import Guard, GuardStep, guard_tick


class GuardedEnv(ResidualWholeEnv):
    """A walker, `controller`, from which servos that the action moves take over in need.

    Action: as of `ResidualWholeEnv`; its last entry, `authority`, has no effect. The servos have
    all torques from when a limit of `guard` is passed until the robot was calm. Before and after
    that the walker has them, bit for bit as alone.

    Observation: <observation>

    Walker, guard and observation go by the same estimate of the state: the guard needs the velocity
    of the root, which nobody measures.

    <rewards>

    <start>
    """

    def __init__(self, *arguments: Any, guard: GuardConfig, **named: Any):
        self.guard = guard
        self._guard = Guard(guard.margin, float(np.cos(guard.tilt)), guarded_zeros(1, np.int64))
        super().__init__(*arguments, **named)

    @ResidualWholeEnv.controller.setter
    def controller(self, controller: Controller) -> None:
        """The walker. Raises ConfigError as `ResidualWholeEnv`, and for one that does not walk."""
        ResidualWholeEnv.controller.fset(self, controller)
        if self.command is None:
            raise ConfigError("does not walk: it sees no velocity_commands", field="walker")

    @property
    def takeovers(self) -> int:
        """How often the guard took over in this episode."""
        return int(self._guard.count[0])

    def believe_raw(self, raw: bool) -> None:
        """The state is estimated, whatever the walker would be content with."""
        super().believe_raw(False)

    def arguments(self) -> dict[str, Any]:
        """See `ResidualWholeEnv`."""
        return {**super().arguments(), "guard": self.guard}

    def _begin(self, options: Mapping[str, Any]) -> None:
        super()._begin(options)
        self._guard.count[0] = 0

    def _begin_anew(self) -> None:
        """The walker's new beginning, with the command that holds now."""
        orders = self._expect_orders("guard")
        now = orders.copy()
        super()._begin_anew()
        orders[:] = now

    def _stepping(self, bound: PolicyStep) -> CompiledStep:
        step = GuardStep(self.whole_step(bound), self._guard)
        return CompiledStep(address_of(guard_tick, step), step, bound.ticks)
