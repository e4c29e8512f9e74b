"""`poise/ResidualStep-v0`: the action moves the targets and the steps of a stepping controller."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from poise.baselines.balance.stepping.controller import SteppingController
from poise.baselines.controller import BaseController, Controller
from poise.baselines.registry import ControllerConfig
from poise.configs.errors import ConfigError
from poise.envs.balance.config import EnvConfig
from poise.envs.balance.vector.vector_env import make_vector_env
from poise.envs.compiled.block import Block
from poise.envs.robots.robot import Robot

from .residual import ResidualBalanceEnv
from .scales import StepScales
from .terms import STEP_TERMS, StepReport, StepReporter, StepView, report_steps


class ResidualStepEnv(ResidualBalanceEnv):
    """Keep a pushed robot on its feet by moving the targets and the steps of a planner.

    `ResidualBalanceEnv` around a controller that steps: rewards, start, end and arguments are the
    same. Zero is the controller alone, bit for bit.

    Action: Box(−1, 1, (7,)), heading frame.

    | index | name | 1 adds | to |
    | --- | --- | --- | --- |
    | 0 | com_x | `residual.com`, 0.1 m | CoM target, after a step where ξ is to rest: forward |
    | 1 | com_y | `residual.com`, 0.1 m | the same, left |
    | 2 | cop_x | `residual.cop`, 0.05 m | CoP target, forward |
    | 3 | cop_y | `residual.cop`, 0.05 m | CoP target, left |
    | 4 | foothold_x | `residual.foothold`, 0.15 m | foothold, forward, within the step's limits |
    | 5 | foothold_y | `residual.foothold`, 0.15 m | foothold, left, within the step's limits |
    | 6 | time | `residual.time`, 0.08 s | time from lift-off to touchdown |

    A scale `residual.trigger` [m] above 0 appends `trigger`: how much further ξ may leave the reach
    of the feet before a step is taken. `height`, `lean` and `momentum` come before `foothold_x`.

    Observation: <observation>

    The push is not observed. The reference is that of `motion`.

    Info: in addition to `ResidualBalanceEnv`'s, "steps" begun in this episode.

    Arguments: as of `ResidualBalanceEnv`; `controller` must be a `SteppingController`;
    `residual` is a `StepScales`.

    Version history: v0, first release.
    """

    scales_class = StepScales
    known_terms = STEP_TERMS

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        controller: str | Path | Mapping | ControllerConfig | Controller = "capture-step",
        **arguments: Any,
    ):
        self._step_report = StepReport.allocate()
        super().__init__(robot, config, controller=controller, **arguments)

    def _accept(self, controller: Controller, base: BaseController) -> None:
        stepper = base.unwrapped
        if not isinstance(stepper, SteppingController):
            raise ConfigError("does not step, so that no step can be moved", field="controller")
        super()._accept(controller, base)
        self.stepper = stepper  #: the controller that steps, of which `controller` may be a wrapper
        self._offsets = stepper.offsets
        self._residual = self._residual.replace(offsets=self._offsets)

    def _readings(self, kind: type[Block]) -> tuple[Any, ...]:
        return (self._step_report,) if kind is StepView else super()._readings(kind)

    def _observe(self) -> None:
        self._step_report.fill(self.stepper.stepping())
        super()._observe()

    def _reports(self, tick: Any) -> list[tuple[Callable[..., None], Block]]:
        reporter = StepReporter(tick.memory, tick.swing, self._step_report)
        return [*super()._reports(tick), (report_steps, reporter)]

    def info(self) -> dict[str, Any]:
        """The entries of `ResidualBalanceEnv`, and the number of steps."""
        return {**super().info(), "steps": self.stepper.stepping().steps}


vector_env = partial(make_vector_env, ResidualStepEnv)  # for gymnasium.make_vec
