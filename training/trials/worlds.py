"""A player in the standard world, and in others."""

from __future__ import annotations

from dataclasses import replace

from poise.baselines.environments.sensed import SensedResidualEnv, SensedTorqueEnv, sensed_env
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.variants import altered_robot

from .players import Player
from .trial import World


class Worlds:
    """The environments of a player, each built when a world first needs it.

    Without a delay and with the masses that the controller knows, the environment is the player's
    own, and its fast path.
    """

    def __init__(self, player: Player):
        self.player = player
        self._standard = player.env.simulation
        self._sensed: SensedResidualEnv | SensedTorqueEnv | None = None

    def enter(self, world: World) -> Player:
        """The player with an environment that is of this world, from its next reset on."""
        env = self.player.env
        if world.mass_error == 0.0 and world.delay == 0.0:
            env.simulation = self._standard
            if world.friction is not None:
                env.simulation = Simulation(altered_robot(env.robot, friction=world.friction))
            return self.player
        if self._sensed is None:
            self._sensed = sensed_env(env)
        actual = altered_robot(env.robot, friction=world.friction, mass_error=world.mass_error)
        self._sensed.set_plant(actual, world.delay)
        return replace(self.player, env=self._sensed)
