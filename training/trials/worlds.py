"""An agent in the standard world, and in others."""

from __future__ import annotations

from dataclasses import replace

from poise.baselines.environments.sensed import SensedResidualEnv, SensedTorqueEnv, sensed_env
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.variants import altered_robot

from .agents import Agent
from .trial import World


class Worlds:
    """The environments of an agent, each built when a world first needs it.

    Without a delay and with the masses that the controller knows, the environment is the agent's
    own, and its fast path.
    """

    def __init__(self, agent: Agent):
        self.agent = agent
        self._standard = agent.env.simulation
        self._sensed: SensedResidualEnv | SensedTorqueEnv | None = None

    def enter(self, world: World) -> Agent:
        """The agent with an environment that is of this world, from its next reset on."""
        env = self.agent.env
        if world.mass_error == 0.0 and world.delay == 0.0:
            env.simulation = self._standard
            if world.friction is not None:
                env.simulation = Simulation(altered_robot(env.robot, friction=world.friction))
            return self.agent
        if self._sensed is None:
            self._sensed = sensed_env(env)
        actual = altered_robot(env.robot, friction=world.friction, mass_error=world.mass_error)
        self._sensed.set_plant(actual, world.delay)
        return replace(self.agent, env=self._sensed)
