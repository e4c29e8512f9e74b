"""Agents under standard and other conditions."""

from functools import cache
from typing import Any

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import on_terrain
from poise.envs.sensing.realism import Realism, load_realism, overlaid
from poise.envs.terrain.terrain import Terrain

from .agents import Agent
from .trial import Conditions


@cache
def level_of(conditions: Conditions) -> Realism:
    """Return the realism level of conditions: the named one, overridden by the single factors.

    Raises ConfigError for an unknown level.
    """
    level = load_realism(conditions.realism)
    changed: dict[str, dict[str, Any]] = {}
    if conditions.friction is not None:
        changed["ground"] = {"friction": conditions.friction}
    if conditions.delay > 0.0:
        changed["latency"] = {"sense": conditions.delay}
    if conditions.mass_error != 0.0:
        changed["body"] = {"scale": conditions.mass_error}
    if conditions.velocity_noise > 0.0:
        changed["sensors"] = {"velocity_noise": conditions.velocity_noise}
    return overlaid(level, changed, "conditions") if changed else level


class AgentVariants:
    """One agent under several conditions, in one environment.

    The environment's realism is set by the conditions.
    """

    def __init__(self, agent: Agent):
        self.agent = agent
        agent.env.realism = Realism()
        self._standard = agent.env.simulation
        self._motion = getattr(agent.env, "motion", None)

    def under(
        self,
        conditions: Conditions,
        terrain: Terrain | None = None,
        motion: ReferenceMotion | None = None,
    ) -> Agent:
        """Return the agent, whose environment has these conditions from its next reset on.

        `terrain` and `motion` replace those of the environment. Raises ConfigError for an unknown
        realism level.
        """
        env = self.agent.env
        motion = motion or self._motion
        if isinstance(env, ResidualBalanceEnv) and motion is not None and motion is not env.motion:
            env.motion = motion
        level = level_of(conditions)
        if terrain is not None:
            env.simulation = Simulation(on_terrain(env.robot, terrain))
        elif level.ideal or env.known_robot is not self._standard.robot:
            env.simulation = self._standard
        env.realism = level
        return self.agent
