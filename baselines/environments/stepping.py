"""`poise/ResidualStep-v0`: the action moves the targets and the steps of a stepping controller."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.controller import told_by
from poise.baselines.motions.offsets import STEPS
from poise.baselines.stepping.blocks import StepMemory, SwingArrays
from poise.baselines.stepping.controller import SteppingController
from poise.baselines.stepping.swing import time_left
from poise.configs.errors import ConfigError
from poise.envs.balance.config import EnvConfig
from poise.envs.balance.observation import Term
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import CompiledStep, Erased, address_of, call
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import apart
from poise.envs.physics.kinematics import StateArrays
from poise.envs.robots.robot import Robot
from poise.envs.vector.vector_env import make_vector_env

from .policy_step import ResidualStep
from .residual import ResidualBalanceEnv, ResidualScales


@dataclass(frozen=True, eq=False)
class StepSight(Block):
    """What a policy sees of the steps."""

    state: StateArrays
    told: np.ndarray  # (7,) `Stepping.entries`
    height: float  # h [m]
    omega: float  # [1/s]
    observation: np.ndarray  # (≥ 15,) of which the last are filled


@compiled
def _put_local(sight: StepSight, first: int, x: float, y: float):
    """(x, y) in the heading frame, in 0.5 h."""
    cos, sin, half = sight.state.heading[0], sight.state.heading[1], 0.5 * sight.height
    sight.observation[first] = (cos * x + sin * y) / half
    sight.observation[first + 1] = (cos * y - sin * x) / half


@compiled
def observe_step(sight: StepSight):
    """The terms `swing` to `stance_capture_point` of `ResidualStepEnv`, clipped to ±10."""
    s, told, out = sight.state, sight.told, sight.observation
    first, foot, feet = out.shape[0] - 15, int(told[1]), s.sole_point
    for i in range(2):
        out[first + i] = 1.0 if foot == i else 0.0
    out[first + 2], out[first + 5] = told[4], told[0]
    out[first + 3], out[first + 4] = sight.omega * told[5], sight.omega * told[6]
    _put_local(sight, first + 6, feet[0, 0] - feet[1, 0], feet[0, 1] - feet[1, 1])
    for i in range(first + 8, first + 15):
        out[i] = 0.0
    if foot >= 0:
        stance, moving, xi = feet[1 - foot], feet[foot], s.capture_point
        _put_local(sight, first + 8, moving[0] - stance[0], moving[1] - stance[1])
        out[first + 10] = (moving[2] - stance[2]) / (0.5 * sight.height)
        _put_local(sight, first + 11, told[2] - stance[0], told[3] - stance[1])
        _put_local(sight, first + 13, xi[0] - stance[0], xi[1] - stance[1])
    for i in range(first, first + 15):
        out[i] = min(max(out[i], -10.0), 10.0)


@dataclass(frozen=True)
class StepScales(ResidualScales):
    """What an action of 1 adds, heading frame; a scale of 0 takes it away."""

    com: float = field(default=0.1, metadata={"min": 0.0})  # Δc_ref x, y [m]
    cop: float = field(default=0.05, metadata={"min": 0.0})  # Δp_ref x, y [m]
    foothold: float = field(default=0.15, metadata={"min": 0.0})  # x, y [m]
    time: float = field(default=0.08, metadata={"min": 0.0})  # of a step [s]
    trigger: float = field(default=0.0, metadata={"min": 0.0})  # of a step [m]

    def entries(self) -> dict[str, float]:
        """Scale of each target that can be moved: those of the base class first."""
        scales = self.foothold, self.foothold, self.time, self.trigger
        return {**super().entries(), **dict(zip(STEPS, scales, strict=True))}


@dataclass(frozen=True, eq=False)
class SteppingStep(Block):
    """A policy step of a compiled controller that steps."""

    residual: Erased  # a `ResidualStep`
    ticks: np.ndarray  # (1,) int: of the running policy step
    kernel: int  # address of `residual_tick`
    memory: StepMemory
    swing: SwingArrays
    sight: StepSight


@compiled
def stepping_tick(step: SteppingStep):
    """`residual_tick`, after the last one what the policy sees of the steps."""
    call(step.kernel, step.residual)
    if step.ticks[0] > 0:
        return
    m, w, told = step.memory, step.swing, step.sight.told
    told[0], told[1] = m.steps[0], -1.0
    told[4], told[5], told[6] = 0.0, 0.0, m.clock[0]
    if m.swinging[0]:
        told[1], told[2], told[3] = m.foot[0], w.foothold[0], w.foothold[1]
        told[4], told[5], told[6] = w.time[0] / w.duration[0], time_left(w), 0.0
    observe_step(step.sight)


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

    Observation: that of `ResidualBalanceEnv` with these actions (0 to 70), then

    | index | term | entry | unit | meaning |
    | --- | --- | --- | --- | --- |
    | 71 | swing | left | 1 | 1 where the foot swings, else 0 |
    | 72 | swing | right | 1 | 1 where the foot swings, else 0 |
    | 73 | phase | share | 1 | share of the swing that is over |
    | 74 | time_left | t | 1/ω | until touchdown is planned |
    | 75 | since | t | 1/ω | since the last touchdown |
    | 76 | steps | count | 1 | steps begun |
    | 77 | feet | x | 0.5 h | first sole from the second |
    | 78 | feet | y | 0.5 h | first sole from the second |
    | 79 | swing_foot | x | 0.5 h | swinging sole from the stance sole, 0 if both are down |
    | 80 | swing_foot | y | 0.5 h | swinging sole from the stance sole, 0 if both are down |
    | 81 | swing_foot | z | 0.5 h | swinging sole from the stance sole, 0 if both are down |
    | 82 | foothold | x | 0.5 h | foothold from the stance sole, 0 if both are down |
    | 83 | foothold | y | 0.5 h | foothold from the stance sole, 0 if both are down |
    | 84 | stance_capture_point | x | 0.5 h | ξ from the stance sole, 0 if both are down |
    | 85 | stance_capture_point | y | 0.5 h | ξ from the stance sole, 0 if both are down |

    Info: besides those of `ResidualBalanceEnv`, "steps", begun in this episode.

    Arguments: as of `ResidualBalanceEnv`; `controller` must be a `SteppingController`;
    `residual` is a `StepScales`.

    Version history: v0, first release.
    """

    scales_class = StepScales

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        controller: Any = "capture-step",
        **arguments: Any,
    ):
        super().__init__(robot, config, controller=controller, **arguments)

    @ResidualBalanceEnv.controller.setter  # type: ignore[attr-defined]
    def controller(self, controller: Any) -> None:
        """As of `ResidualBalanceEnv`; raises ConfigError for one that does not step."""
        stepper = told_by(controller, self.robot).unwrapped
        if not isinstance(stepper, SteppingController):
            raise ConfigError("does not step, so that no step can be moved", field="controller")
        ResidualBalanceEnv.controller.fset(self, controller)  # type: ignore[attr-defined]
        self.stepper = stepper  #: the controller that steps, of which `controller` may be a wrapper
        self._offsets = stepper.offsets.values  # one array is both
        self._residual = replace(self._residual, offsets=self._offsets)

    def _observation_terms(self, soles: list[str]) -> list[Term]:
        ground, stance = ("x", "y"), "the stance sole, 0 if both are down"
        return [
            *super()._observation_terms(soles),
            Term("swing", tuple(soles), "1", "1 where the foot swings, else 0", "feet"),
            Term("phase", ("share",), "1", "share of the swing that is over", "number"),
            Term("time_left", ("t",), "1/ω", "until touchdown is planned", "number"),
            Term("since", ("t",), "1/ω", "since the last touchdown", "number"),
            Term("steps", ("count",), "1", "steps begun", "number"),
            Term("feet", ground, "0.5 h", "first sole from the second", "between feet"),
            Term("swing_foot", (*ground, "z"), "0.5 h", f"swinging sole from {stance}", "vector"),
            Term("foothold", ground, "0.5 h", f"foothold from {stance}", "vector"),
            Term("stance_capture_point", ground, "0.5 h", f"ξ from {stance}", "vector"),
        ]

    def _observe(self) -> None:
        super()._observe()
        told, sight = np.array(self.stepper.stepping().entries()), self.scales
        observe_step(
            StepSight(
                self.simulation.state_arrays, told, sight.height, sight.omega,
                self.episode.observation,
            )
        )  # fmt: skip

    def _whole_step(self, bound: ResidualStep) -> CompiledStep:
        alone = super()._whole_step(bound)
        block = self.bind_steps(bound, alone.kernel)
        return CompiledStep(address_of(stepping_tick, block), block, alone.ticks)

    def bind_steps(self, residual: ResidualStep, kernel: int) -> SteppingStep:
        """All that a step works on, with what `bind` made and the address of `residual_tick`."""
        tick: Any = residual.tick.inner
        scales, observation = self.scales, self.episode.observation
        sight = StepSight(residual.state, apart(7), scales.height, scales.omega, observation)
        return SteppingStep(
            Erased(residual), self.episode.ticks, kernel, tick.memory, tick.swing, sight
        )

    def info(self) -> dict[str, Any]:
        """As of `ResidualBalanceEnv`, and the number of steps."""
        return {**super().info(), "steps": self.stepper.stepping().steps}


vector_env = partial(make_vector_env, ResidualStepEnv)  # for gymnasium.make_vec
