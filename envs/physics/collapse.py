"""A fallen robot without a controller: it goes down with damped motors."""

import numpy as np

from .simulation import Simulation

DURATION = 1.5  # [s] in which a robot is on the ground
SPEED = 10.0  # [rad/s] at which a motor would brake with its largest torque
STABLE = 0.1  # of a joint's inertia over the physics step: more damping would ring


class Collapse:
    """Motors that brake, τ = −d q̇ within their limits, with nothing that they hold up.

    d = min(τ_max / `SPEED`, `STABLE` M₀ / dt) with the inertia M₀ of the joint in the model's own
    posture. Pictures alone show it: whatever is judged ends before.
    """

    def __init__(self, simulation: Simulation):
        robot, model = simulation.robot, simulation.robot.model
        dofs, limit = np.asarray(robot.motor_dofs), np.asarray(robot.torque_limit)
        stable = STABLE * model.dof_M0[dofs] / model.opt.timestep
        self._simulation, self._dofs, self._limit = simulation, dofs, limit
        self.damping = np.minimum(limit / SPEED, stable)  #: (nu,) d [N·m·s/rad]

    def step(self, count: int) -> None:
        """Go on for `count` physics steps."""
        for _ in range(count):
            speed = self._simulation.data.qvel[self._dofs]
            torques = np.clip(-self.damping * speed, -self._limit, self._limit)
            self._simulation.step(torques)
