"""A simulation seen through sensors that are late, by a controller that knows other masses."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.physics.kinematics import update_state
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state import RobotState
from poise.envs.pushes.push import Kick, Push
from poise.envs.robots.robot import Robot

MEASURED = ("contact_wrench", "cop", "contacts", "other_contacts")  # not from the model's own


class SensedSimulation(Simulation):
    """The true robot; `known` is what a controller believes of it.

    The sensors give positions, velocities and contact forces of `delay` seconds ago (of the start,
    before that). Everything else of the believed state (masses, CoM, momentum, capture point) comes
    from the model of the robot that the controller knows.

    Args:
        actual: who is simulated.
        robot: who the controller knows; the same joints and feet as `actual`.
        delay: a whole number of physics steps [s].

    Raises ConfigError for another delay.
    """

    def __init__(self, actual: Robot, robot: Robot, delay: float = 0.0):
        step = actual.model.opt.timestep
        self.late = round(delay / step)
        if self.late < 0 or abs(self.late * step - delay) > 1e-9:
            raise ConfigError(f"{delay} s is not a whole number of steps of {step} s",
                              field="delay")  # fmt: skip
        self.known = Simulation(robot)
        self._history: deque[tuple[np.ndarray, ...]] = deque(maxlen=self.late + 1)
        self._believed_at = -1  # clock
        super().__init__(actual)

    def reset(
        self,
        qpos: np.ndarray | None = None,
        qvel: np.ndarray | None = None,
        pushes: Sequence[Push | Kick] = (),
    ) -> RobotState:
        """As `Simulation.reset`; the sensors show the start until the delay has passed."""
        state = super().reset(qpos, qvel, pushes)
        self._history.clear()
        self._believed_at = -1
        self._measure()
        return state

    def step(self, torques: np.ndarray, count: int = 1) -> RobotState:
        """As `Simulation.step`, with a measurement after every physics step."""
        state = self.state
        for _ in range(count):
            state = super().step(torques)
            self._measure()
        return state

    def _measure(self) -> None:
        s = self.state_arrays
        arrays = (s.qpos, s.qvel, *(getattr(s, name) for name in MEASURED))
        self._history.append(tuple(array.copy() for array in arrays))

    def believe(self) -> Simulation:
        """`known` with the state that the controller sees now; its clock is the true one."""
        if self._believed_at == self.clock[0]:
            return self.known
        qpos, qvel, *measured = self._history[0]
        known = self.known
        known.data.qpos[:], known.data.qvel[:] = qpos, qvel
        mujoco.mj_step1(known.model, known.data)
        update_state(known.arrays, known.plant, known.state_arrays)
        for name, value in zip(MEASURED, measured, strict=True):
            getattr(known.state_arrays, name)[:] = value
        known.clock[0] = self._believed_at = self.clock[0]
        return known
