"""The state given to controller and policy: by default the true state."""

import numpy as np

from poise.envs.compiled.calls import Program, run
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.arrays import RobotArrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.motor_bus import ideal_bus
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state import RobotState


class StateSource(Copyable):
    """The source of the estimated state of a simulation; this class gives the true state.

    An environment judges the simulation's own state. Its targets, its controller and its
    observation go by this one. A subclass has a state of its own and two programs of compiled
    kernels: `sense` measures after every physics step, `estimate` makes a state of what was
    measured, before every control tick and every observation. Neither may allocate or raise.

    Attributes:
        simulation: whose state it is about.
        promise: (nv,) where a controller writes the accelerations that it promises; (0,) where
            they are not read.
        arrays: the constants of the nominal robot.
        state_arrays: the estimated state; the same arrays for as long as the source exists.
        bus: between the computer and the motors.
        drive: the program before every physics step, of motors that do not do what they are asked.
        sense: the program after every physics step.
        estimate: the program before the state is read.
    """

    arrays: RobotArrays
    state_arrays: StateArrays

    def __init__(self, simulation: Simulation):
        self.simulation = simulation
        self.arrays, self.state_arrays = simulation.arrays, simulation.state_arrays
        self.bus = ideal_bus()
        self.promise: np.ndarray = guarded_zeros(0)
        self.drive = Program.of(())
        self.sense, self.estimate = Program.of(()), Program.of(())

    @property
    def state(self) -> RobotState:
        """The estimated state, as of the last `update`; its clock is the simulation's."""
        return RobotState(self.arrays, self.state_arrays, self.simulation.time)

    def reset(self) -> None:
        """Forget all measurements; the simulation has just been reset."""

    def update(self) -> None:
        """Estimate the state from what has been measured, for a caller in Python."""
        run(self.estimate)
