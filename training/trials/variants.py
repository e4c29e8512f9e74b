"""An agent in the standard conditions, and in others."""

from __future__ import annotations

from poise.envs.physics.simulation import Simulation
from poise.envs.robots.variants import perturbed_robot
from poise.envs.sensors.delayed import DelayedState

from .agents import Agent
from .trial import Conditions


class AgentVariants:
    """One agent under several conditions, whose environment is the same in all of them.

    The simulation and the state source of the environment are those of the conditions. The delays
    of conditions and environment (`sensors.delay`) add up.
    """

    def __init__(self, agent: Agent):
        self.agent = agent
        self._standard = agent.env.simulation

    def under(self, conditions: Conditions) -> Agent:
        """Return the agent, whose environment has these conditions from its next reset on."""
        env = self.agent.env
        known = conditions.mass_error == 0.0  # the controller's masses are the true ones
        if known and conditions.friction is None:
            env.simulation = self._standard
        else:
            env.simulation = Simulation(
                perturbed_robot(
                    env.robot, friction=conditions.friction, mass_error=conditions.mass_error
                )
            )
        if not known or conditions.delay > 0.0:
            delay = env.config.sensors.delay + conditions.delay
            env.state_source = DelayedState(env.simulation, env.robot, delay)
        return self.agent
