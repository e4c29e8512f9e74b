"""A robot in a simulation, its realism level, and the source of its estimated state."""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.physics.engines.config import Physics
from poise.envs.physics.engines.engine import make_engine
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state_source import StateSource
from poise.envs.robots.robot import Robot

from .config import RAW, EstimatorConfig
from .drawn import DrawnRobot, Plant, check_limbs, draw_robot
from .estimator import EstimatedState, check_latency
from .realism import Realism, overlaid


class SensedRobot:
    """Base of the classes with a simulation, a realism level and a `StateSource`."""

    robot: Robot  #: that is known; the simulated one may differ, see `Realism`
    physics = Physics()  #: of the engine that steps the robot
    estimator: EstimatorConfig  #: how the state is estimated where it is not known exactly
    drawn: DrawnRobot | None  #: of the running episode; None where it is the one that is known
    drawn_summary: dict[str, Any]  #: what `info` tells of it
    _simulation: Simulation
    _state_source: StateSource
    _raw = False  # whether the controller brings an estimator of its own

    def _unbind(self) -> None:
        """Forget what was made of the simulation or the source: there is another one."""

    @property
    def _holding(self) -> np.ndarray:
        """(nu,) torques that hold the robot before an episode [N·m]."""
        raise NotImplementedError

    @property
    def realism(self) -> Realism:
        """What the robot of an episode is drawn from; may be replaced between episodes.

        Raises ConfigError for delays that are longer than the prediction's memory, for bumps on a
        terrain, and for moved arms of a robot that has none.
        """
        return self._realism

    @realism.setter
    def realism(self, level: Realism) -> None:
        check_latency(level, self.robot.model.opt.timestep)
        check_limbs(level, self.robot)
        source = self._state_source
        if level.ideal:
            if isinstance(source, EstimatedState):
                self.simulation = Simulation(source.plant.robot)
        elif not isinstance(source, EstimatedState) or source.plant.bumpy != level.bumpy:
            plant = Plant(self.known_robot, level.bumpy)
            self._simulation = plant.simulation
            self._take(EstimatedState(plant, self.robot, self._estimator()))
        self._realism, self.drawn = level, None

    @property
    def known_robot(self) -> Robot:
        """The robot in its world as its model has it, whatever an episode draws."""
        source = self._state_source
        return source.plant.robot if isinstance(source, EstimatedState) else self._simulation.robot

    def _estimator(self) -> EstimatorConfig:
        return RAW if self._raw else self.estimator

    def use_raw(self, raw: bool) -> None:
        """Whether the controller gets what is measured, as it is, instead of an estimate."""
        if raw != self._raw:
            self._raw = raw
            source = self._state_source
            if isinstance(source, EstimatedState):
                self._take(EstimatedState(source.plant, self.robot, self._estimator()))

    @property
    def simulation(self) -> Simulation:
        """The robot and its world; may be replaced between episodes, and the state is then known.

        Setting it makes the realism ideal.
        """
        return self._simulation

    @simulation.setter
    def simulation(self, simulation: Simulation) -> None:
        self._simulation, self._realism, self.drawn = simulation, Realism(), None
        self._take(StateSource(simulation))

    @property
    def state_source(self) -> StateSource:
        """The source of the estimated state; may be replaced between episodes.

        The simulation's own state is what is judged. Raises ConfigError for a source of another
        simulation.
        """
        return self._state_source

    @state_source.setter
    def state_source(self, source: StateSource) -> None:
        if source.simulation is not self.simulation:
            raise ConfigError("is about another simulation", field="state_source")
        self._take(source)

    def _take(self, source: StateSource) -> None:
        self._state_source, simulation = source, source.simulation
        if simulation.engine.physics != self.physics:
            simulation.engine = make_engine(self.physics, simulation.robot, simulation.data)
        simulation.equip(source.drive, source.sense, source.bus)
        self._unbind()

    def _draw(self, given: object, rng: np.random.Generator) -> None:
        """Draw the robot of an episode, with fields that are `given` fixed; before the reset.

        The generator is one of its own, so that starts and pushes are those of the ideal world.
        Raises ConfigError for fields that are wrong, or that the ideal world does not have.
        """
        source = self._state_source
        asked = given is not None and not (isinstance(given, Mapping) and not given)
        if not isinstance(source, EstimatedState):
            if asked:
                raise ConfigError("only where the environment's realism is not ideal",
                                  source="reset", field="realism")  # fmt: skip
            return
        level = overlaid(self.realism, given, "reset: realism") if asked else self.realism
        check_latency(level, self.robot.model.opt.timestep)
        check_limbs(level, self.robot)
        if level.bumpy and not source.plant.bumpy:
            raise ConfigError("the environment's realism has no bumps, so that none are built",
                              source="reset: realism", field="ground.bumps")  # fmt: skip
        self.drawn = draw_robot(level, self.robot, rng.spawn(1)[0])
        source.plant.become(self.drawn)
        timestep = self.robot.model.opt.timestep
        self.drawn_summary = {"level": self.realism.name, **self.drawn.summary(timestep)}

    def _begin_sensing(self) -> None:
        """Let the estimator begin; the simulation has just been reset."""
        source = self._state_source
        if isinstance(source, EstimatedState):
            assert self.drawn is not None  # by `_draw`
            source.begin(self.drawn, self._holding)
        else:
            source.reset()

    @property
    def model(self) -> mujoco.MjModel:
        """MuJoCo's model, for reading: environments of one robot share it where it is ideal."""
        return self.simulation.model

    @property
    def data(self) -> mujoco.MjData:
        """MuJoCo's data of this environment, current after `reset` and after every `step`."""
        return self.simulation.data
