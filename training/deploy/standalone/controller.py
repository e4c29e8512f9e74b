"""A controller or a policy that runs outside of an environment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import overload

import mujoco
import numpy as np

from poise.baselines.allowance import allows
from poise.baselines.environments.hand_over import WholeStep, blend_torques
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.configs.errors import PoiseError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.servos import drive
from poise.envs.physics.kinematics import update_state
from poise.envs.physics.state_source import StateSource
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.sensing.realism import Realism, load_realism
from poise.training.benchmarking.trials.agents import Agent, load_agent

from .outside import OutsideController
from .readings import Readings
from .sensed import SensedController


@overload
def load_standalone(
    name: str, robot: str | Path | Robot = ..., *, allow: str | Iterable[str] = ...
) -> StandaloneController: ...
@overload
def load_standalone(
    name: str,
    robot: str | Path | Robot = ...,
    *,
    realism: str | Path | Mapping | Realism,
    allow: str | Iterable[str] = ...,
) -> SensedController: ...
@allows("name")
def load_standalone(
    name: str,
    robot: str | Path | Robot = "humanoid",
    *,
    realism: str | Path | Mapping | Realism | None = None,
    allow: str | Iterable[str] = (),
) -> StandaloneController | SensedController:
    """A controller or a policy that runs outside of an environment, from readings of a robot.

    Without `realism` the state is given; with a level it is estimated from measurements.

    Args:
        name: as `poise evaluate` takes it: a packaged controller or policy, a .yaml file of a
            controller, a folder of `poise train`, an external policy, or ``module:Class``.
        robot: a packaged robot, a .yaml description, or a robot. A policy must be for it.
        realism: what is known of a real robot: a level's name, a .yaml file, or a mapping.
        allow: what may run though a file names it, as of `load_policy`.

    Raises:
        ConfigError: no such controller, robot or level, or one that cannot run on a robot: it
            pulls the root by an external force, or it observes the push.
    """
    body = robot if isinstance(robot, Robot) else load_robot(robot)
    agent = load_agent(name, body)
    if realism is not None:
        return SensedController(agent, load_realism(realism))
    return StandaloneController(agent)


class StandaloneController(OutsideController):
    """Joint torques from readings of base and joints, the same bits as in an environment.

    Call `reset` once, and then `torques` every `period` seconds; hold what it returns meanwhile.
    A model of the robot is set to each reading; everything else the controller needs (masses,
    CoM, contacts, observations) is computed from it. Feet are on the ground where the model's
    are, so the base's height matters by the millimetre. Where `ground_wrench` is not measured, it
    is what the ground would have done with the last torques; a push in between is not in it.

    On the same readings, with `ground_wrench`, the torques are bit for bit those of `poise
    evaluate`; without it they are for as long as nothing but the ground pushes the robot.
    Attributes are those of `OutsideController`.
    """

    def __init__(self, agent: Agent):
        super().__init__(agent)
        env = self._env
        env.state_source = StateSource(env.simulation)  # delays are now the robot's own
        self._servos = _servos(env)
        #: calls of `torques` in a control tick: servos answer in every physics step
        self._calls = self._substeps if self._servos else 1
        self.period = self._substeps * env.arrays.timestep / self._calls
        self._call: int | None = None  # of the tick; None before a reset

    def reset(self, readings: Readings) -> None:
        """Forget everything; the robot stands, or moves, as `readings` tell.

        Raises ConfigError naming what is missing, or no number.
        """
        self._begin(readings)
        self._call = 0

    def torques(self, readings: Readings) -> np.ndarray:
        """Return motor torques (nu,) [N·m], within the limits, to hold for one `period`.

        Raises ConfigError naming what is missing or no number; PoiseError before a `reset`.
        """
        if self._call is None:
            raise PoiseError("torques() before reset(): tell the controller where it starts")
        qpos, qvel = readings.qpos(self.robot), readings.qvel(self.robot)
        views = self._env.simulation.views
        if self._call == 0:
            self._set_state(qpos, qvel, readings.wrench())
            self._act()
            self._env.tick()  # its torques are in `views.ctrl`
        views.qpos[:], views.qvel[:] = qpos, qvel  # the tick has led the model on
        if self._servos is not None:
            self._servos()
        self._call = (self._call + 1) % self._calls
        limit = self.robot.torque_limit
        return np.clip(views.ctrl, -limit, limit)

    def _set_state(self, qpos: np.ndarray, qvel: np.ndarray, wrench: np.ndarray | None) -> None:
        """The model's state, and all that follows from it; by default its own force of the ground.

        That one is what the tick before has computed with the torques that it gave.
        """
        sim = self._env.simulation
        sim.data.qpos[:], sim.data.qvel[:] = qpos, qvel
        mujoco.mj_step1(sim.model, sim.data)
        if wrench is not None:
            sim.data.qfrc_constraint[:6] = wrench
        update_state(sim.arrays, sim.views, sim.state_arrays)


def _servos(env: BalanceEnv) -> Callable[[], object] | None:
    """What gives the torques between two control ticks, from `views`; None where they are held."""
    if isinstance(env, PositionBalanceEnv):
        return lambda: drive(env.servos, env.simulation.world())
    if isinstance(env, ResidualWholeEnv):
        return lambda: _blend(env)
    return None


def _blend(env: ResidualWholeEnv) -> None:
    """The servos' share of the torques, where they have one; else those of the tick hold."""
    step = env.compiled_step()
    assert step is not None and isinstance(step.block, WholeStep)  # it has no other
    if env.authority > 0.0:
        blend_torques(step.block)
