"""`poise/ResidualWhole-v0`: joint servos that the action moves take over from a controller."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from poise.baselines.controller import BaseController, CompiledController, Controller
from poise.baselines.registry import ControllerConfig
from poise.baselines.warmup import prepare
from poise.configs.errors import ConfigError
from poise.configs.schema import build, to_dict
from poise.envs.balance.config import EnvConfig
from poise.envs.balance.mdp.observation import Term, mirror_terms
from poise.envs.balance.position import servo_config
from poise.envs.balance.servos import ServoConfig, make_servos
from poise.envs.balance.vector.vector_env import make_vector_env
from poise.envs.compiled.callbacks import Callback
from poise.envs.compiled.calls import CompiledStep, address_of
from poise.envs.robots.mirror import Mirror
from poise.envs.robots.robot import Robot

from .hand_over import (
    HandOver,
    HandOverConfig,
    HandOverMemory,
    WholeStep,
    whole_tick,
)
from .policy_step import PolicyStep
from .residual import ResidualBalanceEnv
from .scales import WholeScales, action_term


class ResidualWholeEnv(ResidualBalanceEnv):
    """Keep a pushed robot on its feet by joint servos that take over from a controller.

    Action: Box(−1, 1, (nu + 1,)): a target for each motor's servo, and `authority`, the last entry.
    The torques are the controller's τ_c and the servos', within the motors' limits:

        w = clip(2 authority, 0, 1) where the servos may take over, else 0
        q* = q_hold + reach · a,    τ = (1 − w) τ_c + w clip(K (q* − q) − D q̇, ± τ_max)

    Zero is the controller alone, bit for bit; so is any action near rest. The servos may take over
    from the moment when the capture point leaves the reference's by `hand_over.opens`, and until
    the robot was calm for `hand_over.calm_time` (`HandOverConfig`); the controller then restarts,
    as at the start of an episode, wherever the feet stand. A scale above 0 in `residual` puts
    entries that move the controller's targets before all others, see `ResidualBalanceEnv`.

    Observation: <observation>

    The push is not observed. The reference is that of `motion`.

    <rewards>

    <start>

    Arguments: those of `ResidualBalanceEnv`; `residual` is a `WholeScales`, `servos` a
    `ServoConfig` or a mapping, `hand_over` a `HandOverConfig` or a mapping. The controller must
    have a compiled tick and no soft root: else ConfigError.

    Version history: v0, first release.
    """

    scales_class = WholeScales
    only_targets = False

    def __init__(
        self,
        robot: str | Path | Robot = "humanoid",
        config: EnvConfig | str | Path | Mapping | None = None,
        *,
        controller: str | Path | Mapping | ControllerConfig | Controller = "momentum-qp",
        servos: ServoConfig | Mapping | None = None,
        hand_over: HandOverConfig | Mapping | None = None,
        **arguments: Any,
    ):
        given = {} if hand_over is None else to_dict(hand_over)
        self.hand_over = build(HandOverConfig, given, "hand_over")
        prepare("whole")
        self.servo_config = servo_config(servos)
        self._memory = HandOverMemory.allocate()
        self._callback = Callback(self._restart_controller)
        super().__init__(robot, config, controller=controller, **arguments)
        self.servos = make_servos(self.robot, self.servo_config)

    def _accept(self, controller: Controller, base: BaseController) -> None:
        super()._accept(controller, base)
        if not self._compiled or not isinstance(base, CompiledController):
            raise ConfigError("has no compiled tick, from which servos could take over",
                              field="controller")  # fmt: skip
        if base.outputs().soft_root:
            raise ConfigError("has a soft root, from which servos cannot take over",
                              field="controller")  # fmt: skip

    @property
    def authority(self) -> float:
        """w, the fraction of the torques that was the servos' in the last policy step."""
        return self._memory.authority

    def arguments(self) -> dict[str, Any]:
        own = {"servos": self.servo_config, "hand_over": self.hand_over}
        return {**super().arguments(), **own}

    def _action_names(self) -> tuple[str, ...]:
        return (*super()._action_names(), *self.robot.motor_names, "authority")

    def _mirror_actions(self, parts: dict[str, Mirror]) -> Mirror:
        targets = [action_term(name) for name in super()._action_names()]
        motors = Term("motors", self.action_names[len(targets) : -1], "1", "", "motors")
        return mirror_terms([*targets, motors, action_term("authority")], parts)

    def _begin(self, options: Mapping[str, Any]) -> None:
        super()._begin(options)
        opens, closes = self.hand_over.distances(self.realism)
        self._memory.clear()
        self._memory.opens, self._memory.closes = opens**2, closes**2
        self._callback.error = None

    def _restart_controller(self) -> None:
        """The controller's new trial; the failures of the episode's ticks stay counted."""
        controller = self.controller
        assert isinstance(controller, CompiledController)  # by `_accept`
        failures = controller.failures
        controller.reset(self.state_source.state)
        controller.outputs().failures = failures

    def check(self) -> None:
        """See `BalanceEnv`; of the controller, and of its new beginning."""
        super().check()
        self._callback.check()

    def whole_step(self, bound: PolicyStep) -> WholeStep:
        """All that a policy step works on, `bound` to the controller."""
        h = self.hand_over
        hand = HandOver(
            cos_tilt=float(np.cos(h.tilt)),
            speed=h.speed**2,
            joint_speed=h.joint_speed**2,
            calm_steps=float(np.ceil(h.calm_time / self.config.policy_period - 1e-9)),
            memory=self._memory,
            begin=self._callback.address,
        )
        return WholeStep(bound, self.servos, hand)

    def _stepping(self, bound: PolicyStep) -> CompiledStep:
        step = self.whole_step(bound)
        return CompiledStep(address_of(whole_tick, step), step, bound.ticks)


vector_env = partial(make_vector_env, ResidualWholeEnv)  # for gymnasium.make_vec
