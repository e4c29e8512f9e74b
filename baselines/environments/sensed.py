"""Environments whose controller and policy see the robot through late sensors and a wrong model."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from poise.baselines.controller import Controller, Targets, WrappedController
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.episode import judge_step, record_tick
from poise.envs.balance.torque import TorqueBalanceEnv
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot
from poise.envs.sensors.delayed import SensedSimulation

from .residual import ResidualBalanceEnv
from .stepping import ResidualStepEnv


class SensingController(WrappedController):
    """Hands the believed state to a controller, whatever state it is called with."""

    def __init__(self, controller: Controller, robot: Robot):
        super().__init__(controller, robot)
        self.simulation: SensedSimulation | None = None

    def _believed(self) -> RobotState:
        assert self.simulation is not None
        return self.simulation.believe().state

    def reset(self, state: RobotState) -> None:
        """Forget everything; the trial starts at what is believed."""
        self.inner.reset(self._believed())

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        return self.inner.torques(self._believed(), targets)


class Sensed(BalanceEnv):
    """What both kinds share: observations from the believed state; the truth is judged."""

    def set_plant(self, actual: Robot, delay: float) -> None:
        """Simulate `actual`, seen `delay` seconds late, from the next reset on."""
        self.simulation = SensedSimulation(actual, self.robot, delay)

    @contextmanager
    def _through_sensors(self) -> Iterator[None]:
        """Inside, `self.simulation` is what the controller believes."""
        true = self.simulation
        if isinstance(true, SensedSimulation):
            self.simulation = true.believe()
        try:
            yield
        finally:
            self.simulation = true

    def _observe(self) -> None:
        with self._through_sensors():
            super()._observe()


class SensedResidualEnv(Sensed, ResidualBalanceEnv):
    """`ResidualBalanceEnv`, where targets, controller, gate and policy go by the believed state."""

    def set_plant(self, actual: Robot, delay: float) -> None:
        super().set_plant(actual, delay)
        assert isinstance(self.controller, SensingController)
        self.controller.simulation = self.simulation  # type: ignore[assignment]

    def _update_targets(self) -> None:
        with self._through_sensors():
            super()._update_targets()

    def _set_offsets(self) -> None:
        with self._through_sensors():
            super()._set_offsets()


class SensedStepEnv(SensedResidualEnv, ResidualStepEnv):
    """The same of a stepping controller."""


class SensedTorqueEnv(Sensed, TorqueBalanceEnv):
    """`TorqueBalanceEnv`, where the policy goes by the believed state."""

    def compiled_step(self) -> None:
        """Sensors are late in Python only."""

    def advance(self) -> None:
        sim, e = self.simulation, self.episode
        ctrl = sim.plant.ctrl
        ctrl[:] = e.action * self.arrays.torque_limit
        s, period = sim.state_arrays, self.config.policy_period
        record_tick(self.arrays, s, ctrl, period, e)
        sim.step(ctrl, self.substeps)
        judge_step(
            self.arrays, sim.plant, s, self.scales, self.judge, self.arrays.q_standing,
            ctrl, sim.time, e,
        )  # fmt: skip
        self._observe()


def sensed_env(env: BalanceEnv) -> SensedResidualEnv | SensedTorqueEnv:
    """An environment like `env` with sensors; it shares `env`'s controller. Call `set_plant`."""
    if isinstance(env, ResidualBalanceEnv):
        kind = SensedStepEnv if isinstance(env, ResidualStepEnv) else SensedResidualEnv
        return kind(
            env.robot,
            env.config,
            controller=SensingController(env.controller, env.robot),
            motion=env.motion,
            residual=env.residual,
            smoothing=env.smoothing,
            gate=env.gate,
        )
    return SensedTorqueEnv(**env.arguments())
