"""An agent in the standard world, and in others."""

from __future__ import annotations

from poise.envs.physics.simulation import Simulation
from poise.envs.robots.variants import perturbed_robot
from poise.envs.sensors.delayed import DelayedState

from .agents import Agent
from .trial import World


class Worlds:
    """The worlds of one agent, whose environment is the same in all of them.

    The simulation and the state source of the environment are those of the world. The delays of
    world and environment (`sensors.delay`) add up.
    """

    def __init__(self, agent: Agent):
        self.agent = agent
        self._standard = agent.env.simulation

    def enter(self, world: World) -> Agent:
        """The agent with an environment that is of this world, from its next reset on."""
        env = self.agent.env
        known = world.mass_error == 0.0  # the controller's masses are the true ones
        if known and world.friction is None:
            env.simulation = self._standard
        else:
            env.simulation = Simulation(
                perturbed_robot(env.robot, friction=world.friction, mass_error=world.mass_error)
            )
        if not known or world.delay > 0.0:
            delay = env.config.sensors.delay + world.delay
            env.state_source = DelayedState(env.simulation, env.robot, delay)
        return self.agent
