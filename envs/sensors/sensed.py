"""A robot in a simulation, and the source of what is believed of its state."""

from __future__ import annotations

import mujoco

from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot

from .delayed import DelayedState
from .source import StateSource


class SensedRobot:
    """The base of what has a simulation and a `StateSource`, which both may be replaced.

    Attributes:
        robot: the robot that is known; the simulated one may have other masses.
        sensor_delay: of the source that belongs to a new simulation [s].
    """

    robot: Robot
    sensor_delay: float

    def _unbind(self) -> None:
        """Forget what was made of the simulation or the source: there is another one."""

    @property
    def simulation(self) -> Simulation:
        """The robot and its world; may be replaced between episodes, and `state_source` with it."""
        return self._simulation

    @simulation.setter
    def simulation(self, simulation: Simulation) -> None:
        self._simulation = simulation
        delay = self.sensor_delay
        self.state_source = (
            DelayedState(simulation, self.robot, delay) if delay else StateSource(simulation)
        )

    @property
    def state_source(self) -> StateSource:
        """The source of what is believed of the state; may be replaced between episodes.

        The simulation's own state is what is judged. Raises ConfigError for a source of another
        simulation.
        """
        return self._state_source

    @state_source.setter
    def state_source(self, source: StateSource) -> None:
        if source.simulation is not self.simulation:
            raise ConfigError("is about another simulation", field="state_source")
        self._state_source = source
        self.simulation.sensors = source.sense
        self._unbind()

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model, for reading: environments of one robot share it."""
        return self.simulation.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of this environment, current after `reset` and after every `step`."""
        return self.simulation.data
