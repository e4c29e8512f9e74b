"""What controllers and policies outside of an environment have in common."""

import numpy as np

from poise.baselines.controller import CompiledController
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.configs.errors import ConfigError
from poise.envs.balance.base import BalanceEnv
from poise.envs.compiled.calls import run
from poise.training.benchmarking.trials.agents import Agent

from .readings import Readings


class OutsideController:
    """A controller or a policy whose environment is set to a robot's readings.

    Attributes:
        name: of the controller, as it was loaded.
        robot: that it is made for; `robot.torque_limit` (nu,) [N·m] has the motors' limits.
        period: seconds between two of its answers.
        joint_names: (nj,) in the order of readings and measurements.
        motor_names: (nu,) in the order of its answers.
        fingerprint: hash of the controller's configuration and the policy's weights.
    """

    period: float

    def __init__(self, agent: Agent):
        env = agent.env
        check_usable(agent.name, env)
        self._agent, self._env = agent, env
        self.name, self.robot, self.fingerprint = agent.name, env.robot, agent.fingerprint
        self.joint_names, self.motor_names = env.robot.joint_names, env.robot.motor_names
        #: physics steps of a control tick
        self._substeps = (
            env.control_substeps if isinstance(env, ResidualBalanceEnv) else env.substeps
        )

    def _begin(self, start: Readings) -> None:
        """An episode without pushes from `start`; raises ConfigError naming what is wrong of it."""
        pose = {"qpos": start.qpos(self.robot), "qvel": start.qvel(self.robot)}
        self._env.reset(options={"push": [], **pose})
        if self._agent.begin is not None:
            self._agent.begin()

    def _act(self) -> None:
        """Let the policy observe and act, where a policy step begins."""
        env = self._env
        if env.episode.ticks == 0:
            run(env.step_end().observe)
            env.set_action(self._agent.act(env.episode.observation.astype(np.float32)))


def check_usable(name: str, env: BalanceEnv) -> None:
    """Raise ConfigError for a controller that is no use outside of a simulation."""
    controller = env.controller if isinstance(env, ResidualBalanceEnv) else None
    if isinstance(controller, CompiledController) and controller.outputs().soft_root:
        raise ConfigError("has a soft root: it needs an external force, which no robot has",
                          source=name, field="root")  # fmt: skip
    if any(term.name == "push" for term in env.terms):
        raise ConfigError("observes the push, which no sensor tells", source=name,
                          field="observation")  # fmt: skip
