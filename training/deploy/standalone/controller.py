"""A controller or a policy that runs outside of an environment."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import overload

import mujoco
import numpy as np

from poise.baselines.allowance import allows
from poise.baselines.controller import CompiledController
from poise.baselines.environments.hand_over import WholeStep, blend_torques
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.whole import ResidualWholeEnv
from poise.configs.errors import ConfigError, PoiseError
from poise.envs.balance.base import BalanceEnv
from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.servos import drive
from poise.envs.compiled.calls import run
from poise.envs.physics.kinematics import update_state
from poise.envs.physics.state_source import StateSource
from poise.envs.robots.robot import Robot, load_robot
from poise.envs.sensing.realism import Realism, load_realism
from poise.training.benchmarking.trials.agents import Agent, load_agent

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

    Without `realism` the state is told; with a level it is estimated from what sensors measure.

    Args:
        name: as `poise evaluate` takes it: a packaged controller or policy, a .yaml file of a
            controller, a folder of `poise train`, a policy from outside, or ``module:Class``.
        robot: a packaged robot, a .yaml description, or a robot. A policy must be for it.
        realism: what is known of a real robot: a level's name, a .yaml file, or a mapping.
        allow: what may run though a file names it, as of `load_policy`.

    Raises:
        ConfigError: no such controller, robot or level, or one that is no use outside: it pulls the
            root by a force from nowhere, or it observes the push.
    """
    body = robot if isinstance(robot, Robot) else load_robot(robot)
    agent = load_agent(name, body)
    if realism is not None:
        check_usable(agent.name, agent.env)
        return SensedController(agent, load_realism(realism))
    return StandaloneController(agent)


class StandaloneController:
    """Joint torques from readings of base and joints, the same bits as in an environment.

    Call `reset` once, and then `torques` every `period` seconds; hold what it returns meanwhile.
    A model of the robot is set to each reading; all that the controller needs besides (masses,
    CoM, contacts, what a policy observes) follows from it. Feet are on the ground where the model's
    are, so the base's height matters by the millimetre. Where `ground_wrench` is not measured, it
    is what the ground would have done with the last torques; a push in between is not in it.

    On the same readings, with `ground_wrench`, the torques are bit for bit those of `poise
    evaluate`; without it they are for as long as nothing but the ground pushes the robot.

    Attributes:
        name: of the controller, as it was loaded.
        robot: that it is made for; `robot.torque_limit` (nu,) [N·m] has the motors' limits.
        period: seconds between two calls of `torques`.
        joint_names: (nj,) in the order of `Readings`.
        motor_names: (nu,) in the order of the torques.
        fingerprint: hash of the controller's configuration and the policy's weights.
    """

    def __init__(self, agent: Agent):
        env = agent.env
        check_usable(agent.name, env)
        env.state_source = StateSource(env.simulation)  # delays are now the robot's own
        self._agent, self._env = agent, env
        self.name, self.robot, self.fingerprint = agent.name, env.robot, agent.fingerprint
        self.joint_names, self.motor_names = env.robot.joint_names, env.robot.motor_names
        self._servos = _servos(env)
        steps = env.control_substeps if isinstance(env, ResidualBalanceEnv) else env.substeps
        #: calls of `torques` in a control tick: servos answer in every physics step
        self._calls = steps if self._servos else 1
        self.period: float = steps * env.arrays.timestep / self._calls
        self._call: int | None = None  # of the tick; None before a reset

    def reset(self, readings: Readings) -> None:
        """Forget everything; the robot stands, or moves, as `readings` tell.

        Raises ConfigError naming what is missing, or no number.
        """
        start = {"qpos": readings.qpos(self.robot), "qvel": readings.qvel(self.robot)}
        self._env.reset(options={"push": [], **start})
        if self._agent.begin is not None:
            self._agent.begin()
        self._call = 0

    def torques(self, readings: Readings) -> np.ndarray:
        """Motor torques (nu,) [N·m], within the limits, to hold for one `period`.

        Raises ConfigError naming what is missing or no number; PoiseError before a `reset`.
        """
        if self._call is None:
            raise PoiseError("torques() before reset(): tell the controller where it starts")
        qpos, qvel = readings.qpos(self.robot), readings.qvel(self.robot)
        views = self._env.simulation.views
        if self._call == 0:
            self._set_state(qpos, qvel, readings.wrench())
            self._tick()
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

    def _tick(self) -> None:
        """A control tick of the environment; its torques are in `views.ctrl`."""
        env = self._env
        if env.episode.ticks[0] == 0:  # a policy step begins
            run(env.step_end().observe)
            env.set_action(self._agent.act(env.episode.observation.astype(np.float32)))
        env.tick()


def check_usable(name: str, env: BalanceEnv) -> None:
    """Raise ConfigError for a controller that is no use outside of a simulation."""
    controller = env.controller if isinstance(env, ResidualBalanceEnv) else None
    if isinstance(controller, CompiledController) and controller.outputs().soft_root:
        raise ConfigError("has a soft root: it needs a force from nowhere, which no robot has",
                          source=name, field="root")  # fmt: skip
    if any(term.name == "push" for term in env.terms):
        raise ConfigError("observes the push, which no sensor tells", source=name,
                          field="observation")  # fmt: skip


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
