"""An agent in the standard conditions, and in others."""

from __future__ import annotations

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.motions.reference_motion import ReferenceMotion
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import on_terrain
from poise.envs.robots.variants import perturbed_robot
from poise.envs.sensors.delayed import DelayedState
from poise.envs.terrain.terrain import Terrain

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
        self._motion = getattr(agent.env, "motion", None)

    def under(
        self,
        conditions: Conditions,
        terrain: Terrain | None = None,
        motion: ReferenceMotion | None = None,
    ) -> Agent:
        """Return the agent, whose environment has these conditions from its next reset on.

        `terrain` and `motion` take the place of the environment's own.
        """
        env = self.agent.env
        motion = motion or self._motion
        if isinstance(env, ResidualBalanceEnv) and motion is not None and motion is not env.motion:
            env.motion = motion
        body = env.robot if terrain is None else on_terrain(env.robot, terrain)
        known = conditions.mass_error == 0.0  # the controller's masses are the true ones
        if known and conditions.friction is None:
            env.simulation = self._standard if body is env.robot else Simulation(body)
        else:
            env.simulation = Simulation(
                perturbed_robot(
                    body, friction=conditions.friction, mass_error=conditions.mass_error
                )
            )
        if not known or conditions.delay > 0.0:
            delay = env.config.sensors.delay + conditions.delay
            env.state_source = DelayedState(env.simulation, env.robot, delay)
        return self.agent
