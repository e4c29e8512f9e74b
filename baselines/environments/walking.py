"""`poise/ResidualWalk-v0`: the action moves targets and steps of a controller that walks."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.controller import BaseController, Controller
from poise.baselines.registry import ControllerConfig, walking_controllers
from poise.baselines.walking.controller import WalkingController
from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.schedule import CommandSampler, TimedCommand, command_sampler
from poise.configs.errors import ConfigError
from poise.envs.balance.config import EnvConfig
from poise.envs.balance.vector.vector_env import make_vector_env
from poise.envs.compiled.block import Block
from poise.envs.robots.robot import Robot

from .commanded import FollowingEnv, check_reach
from .stepping import ResidualStepEnv
from .walk_terms import WALK_TERMS, Strides, WalkReport, WalkReporter, WalkView, report_walk


class ResidualWalkEnv(FollowingEnv, ResidualStepEnv):
    """Walk as commanded, pushed or not, by moving the targets and the steps of a planner.

    `ResidualStepEnv` around a controller that walks. Zero is the controller alone, bit for bit.

    Action: Box(−1, 1, (7,)), heading frame.

    | index | name | 1 adds | to |
    | --- | --- | --- | --- |
    | 0 | com_x | `residual.com`, 0.1 m | b, where ξ is to be from the new sole: forward |
    | 1 | com_y | `residual.com`, 0.1 m | the same, left |
    | 2 | cop_x | `residual.cop`, 0.05 m | CoP target, forward |
    | 3 | cop_y | `residual.cop`, 0.05 m | CoP target, left |
    | 4 | foothold_x | `residual.foothold`, 0.15 m | foothold, forward, within the step's limits |
    | 5 | foothold_y | `residual.foothold`, 0.15 m | foothold, left, within the step's limits |
    | 6 | time | `residual.time`, 0.08 s | time from lift-off to touchdown |

    `height`, `lean`, `momentum` and `trigger` are those of `ResidualStepEnv`.

    Observation: <observation>

    The push is not observed. Pushes have the axes of the start. The reference is that of `motion`.

    Info: in addition to `ResidualStepEnv`'s, "command" (3,) [m/s, m/s, rad/s] and
    "velocity_error" (3,) of the last stride, which `reward.tracking` uses. "is_success" is not to
    have fallen, as in the benchmark of walks, or to rest where the command is zero.

    Arguments: as of `ResidualStepEnv`, with a `controller` that walks, and `command`: a
    `GaitCommand`, a mapping of `ahead`, `left` [m/s] and `turn` [rad/s] or of ranges [lo, hi] of
    these, which are drawn from at the reset and, with `interval` [s], every so often; see
    `CommandSampler`. What is out of the robot's reach is refused at once. The option "command" of
    `reset` takes its place in that episode.
    `config` is `configs/envs/walking.yaml` by default.

    Version history: v0, first release.
    """

    known_terms = WALK_TERMS
    _keeps_arms = False  # policies have learned with arms that balance

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = "walking",
        *,
        controller: str | Path | Mapping | ControllerConfig | Controller = "walk",
        command: CommandSampler | GaitCommand | Mapping | None = None,
        **arguments: Any,
    ):
        self.command_sampler = CommandSampler() if command is None else command_sampler(command)
        self._walk_report = WalkReport.allocate()
        self._strides = Strides.allocate()
        super().__init__(robot, config, controller=controller, **arguments)

    def _accept(self, controller: Controller, base: BaseController) -> None:
        walker = base.unwrapped
        if not isinstance(walker, WalkingController):
            choices = walking_controllers(planners=True)
            raise ConfigError("does not walk", field="controller", choices=choices)
        for command in self.command_sampler.extremes():
            check_reach(walker, command)
        super()._accept(controller, base)
        self.walker = walker  #: the controller that walks, of which `controller` may be a wrapper

    def arguments(self) -> dict[str, Any]:
        return {**super().arguments(), "command": self.command_sampler}

    def _commands(self, options: Mapping[str, Any]) -> Sequence[TimedCommand]:
        if "command" in options:
            return super()._commands(options)
        return self.command_sampler.sample(self.np_random, self.config.duration)

    def _velocity_error(self) -> np.ndarray:
        return self._strides.error

    def _commanded(self) -> np.ndarray:
        return self.walker.gait.command[:3]

    def _begin(self, options: Mapping[str, Any]) -> None:
        super()._begin(options)
        self._strides.clear()

    def _readings(self, kind: type[Block]) -> tuple[Any, ...]:
        walk = self.walker.gait.command, self._walk_report
        return walk if kind is WalkView else super()._readings(kind)

    def _reporter(self) -> WalkReporter:
        walker, simulation = self.walker, self.simulation
        return WalkReporter(
            gait=walker.gait,
            memory=walker.memory,
            state=simulation.state_arrays,
            clock=simulation.clock,
            timestep=self.arrays.timestep,
            steps=self._step_report,
            strides=self._strides,
            report=self._walk_report,
        )

    def _reports(self, tick: Any) -> list[tuple[Callable[..., None], Block]]:
        return [*super()._reports(tick), (report_walk, self._reporter())]

    def _observe(self) -> None:
        self._step_report.fill(self.stepper.stepping())
        report_walk(self._reporter())
        super()._observe()


vector_env = partial(make_vector_env, ResidualWalkEnv)  # for gymnasium.make_vec
