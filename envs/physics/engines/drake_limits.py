"""Joint limits of MuJoCo's law in Drake: rotors that are dampers for one step."""

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointActuator, PdControllerGains, default_model_instance
from pydrake.systems.framework import Context

from .limits import LimitForces

OFF = PdControllerGains(p=0.0, d=0.0)


class LimitDampers:
    """The limits that act in a step, as Drake's implicit damping of rotors.

    Drake's solver has the force d (v* − v⁺) of a rotor's controller, v⁺ after the step. With
    d = 1/(R Δt) and v* = v + a* Δt it is that of `LimitForces`, solved together with contact.

    Args:
        plant, context: with no port of desired states connected.
        rotors: joint → its rotor, of all joints that have limits.
        qvel: (nj,) of each joint its index in Drake's velocities.
    """

    def __init__(self, plant: MultibodyPlant, context: Context,
                 rotors: dict[int, JointActuator], qvel: np.ndarray):  # fmt: skip
        self._plant, self._context, self._rotors, self._qvel = plant, context, rotors, qvel
        self._active: list[JointActuator] = []
        port = plant.get_desired_state_input_port(default_model_instance())
        self._wanted = port.FixValue(context, np.zeros(2 * plant.num_actuators()))

    def step(self, beyond: LimitForces | None) -> np.ndarray:
        """Drake's positions and velocities after a step, with the limits of `beyond` that push."""
        first = self._plant.num_positions()
        while True:
            if self._active or beyond is not None:
                self._engage(beyond)
            update = self._plant.EvalUniquePeriodicDiscreteUpdate(self._context)
            values: np.ndarray = update.get_vector().CopyToVector()
            if beyond is None:
                return values
            after = values[first:][self._qvel[beyond.joints]]
            pushing = beyond.sign * (self._target(beyond) - after) >= 0.0
            if pushing.all():
                return values
            beyond = beyond.some(pushing)

    def _target(self, beyond: LimitForces) -> np.ndarray:
        """(k,) v*."""
        before = self._plant.GetVelocities(self._context)[self._qvel[beyond.joints]]
        target: np.ndarray = before + beyond.reference * self._plant.time_step()
        return target

    def _engage(self, beyond: LimitForces | None) -> None:
        """Make dampers of the rotors of joints beyond their limits, and of no others."""
        for rotor in self._active:
            rotor.set_controller_gains(OFF)
        self._active, count = [], self._plant.num_actuators()
        wanted = np.zeros(2 * count)
        if beyond is not None:
            damping = 1.0 / (beyond.regularisation * self._plant.time_step())
            for joint, d, target in zip(beyond.joints, damping, self._target(beyond), strict=True):
                rotor = self._rotors[int(joint)]
                rotor.set_controller_gains(PdControllerGains(p=0.0, d=float(d)))
                self._active.append(rotor)
                wanted[count + rotor.input_start()] = target
        self._wanted.GetMutableData().get_mutable_value().SetFromVector(wanted)
