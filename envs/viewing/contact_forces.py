"""The forces that bodies have from the ground, as arrows."""

import mujoco
import numpy as np

from poise.envs.physics.simulation import Simulation

from .overlays import ARROW, Mark
from .quantities import CONTACT_FORCE

GAIN = 0.5  # arrow length over CoM height, for a force equal to the weight
LEAST = 0.02  # of the weight, below which a force is not drawn


class ContactForces:
    """Finds the forces of the ground on each body that touches it.

    The simulation is only read: the forces are those of its state and torques at this moment,
    computed on data of its own. (Those of the last step belong to the state before it.)
    """

    def __init__(self, simulation: Simulation):
        self.simulation = simulation
        self._data = mujoco.MjData(simulation.model)

    def find(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Body id → force (3,) [N] on it, world axes, and the point (3,) [m] where it acts."""
        model, data = self.simulation.model, self._data
        fixed = model.geom_bodyid[:] == 0  # the ground, and what is built on it
        for name in ("qpos", "qvel", "ctrl", "qfrc_applied", "xfrc_applied", "qacc_warmstart"):
            getattr(data, name)[:] = getattr(self.simulation.data, name)
        mujoco.mj_forward(model, data)
        sums: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        wrench = np.zeros(6)
        for i, contact in enumerate(data.contact):
            pair = contact.geom
            if not fixed[pair].any() or contact.efc_address < 0:
                continue
            mujoco.mj_contactForce(model, data, i, wrench)
            sign = 1.0 if fixed[pair[0]] else -1.0  # it is that of the first on the second
            force = sign * contact.frame.reshape(3, 3).T @ wrench[:3]
            body = int(model.geom_bodyid[pair[1] if fixed[pair[0]] else pair[0]])
            total, weighted = sums.get(body, (np.zeros(3), np.zeros(3)))
            sums[body] = total + force, weighted + wrench[0] * contact.pos
        return {
            body: (force, weighted / force[2])
            for body, (force, weighted) in sums.items()
            if force[2] > 1e-9
        }

    def marks(self) -> list[Mark]:
        """An arrow for each body, from the point where the force acts."""
        robot = self.simulation.robot
        weight = robot.mass * self.simulation.arrays.gravity
        scale = GAIN * robot.height_com / weight
        return [
            Mark("contact force", ARROW, point, point + scale * force, 0.02 * robot.height_com,
                 CONTACT_FORCE.colour)
            for force, point in self.find().values()
            if np.linalg.norm(force) > LEAST * weight
        ]  # fmt: skip
