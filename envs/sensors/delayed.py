"""A state that is known late, and by the model of a robot that may have other masses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from poise.configs.numbers import whole_steps
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.mujoco_calls import mj_step1
from poise.envs.maths.vectors import copy_into
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.kinematics import StateArrays, update_state
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot, on_terrain

from .source import StateSource


@dataclass(frozen=True, eq=False)
class Delay(Block):
    """The measurements of the last n − 1 physics steps and now, and the state that is believed.

    The measurements lie in rings of n rows, the oldest one where the next one will be written.
    """

    robot: RobotArrays  # the true one
    views: SimViews
    state: StateArrays
    known_robot: RobotArrays  # the one that is believed in
    known_views: SimViews
    known_state: StateArrays
    next: np.ndarray  # (1,) int: the row of the next measurement
    qpos: np.ndarray  # (n, nq)
    qvel: np.ndarray  # (n, nv)
    contact_wrench: np.ndarray  # (n, 6)
    cop: np.ndarray  # (n, 2)
    contacts: np.ndarray  # (n, nc)
    other_contacts: np.ndarray  # (n, 1)


def allocate_delay(true: Simulation, known: Simulation, rows: int) -> Delay:
    """Zeroed rings of `rows` measurements."""
    s = true.state_arrays
    return Delay(
        robot=true.arrays,
        views=true.views,
        state=s,
        known_robot=known.arrays,
        known_views=known.views,
        known_state=known.state_arrays,
        next=guarded_zeros(1, dtype=np.int64),
        qpos=guarded_zeros((rows, len(s.qpos))),
        qvel=guarded_zeros((rows, len(s.qvel))),
        contact_wrench=guarded_zeros((rows, 6)),
        cop=guarded_zeros((rows, 2)),
        contacts=guarded_zeros((rows, len(s.contacts))),
        other_contacts=guarded_zeros((rows, 1)),
    )


@compiled
def measure(d: Delay):
    """Write the true positions, velocities and ground contacts over the oldest measurement."""
    s, k = d.state, d.next[0]
    update_state(d.robot, d.views, s)
    copy_into(s.qpos, d.qpos[k])
    copy_into(s.qvel, d.qvel[k])
    copy_into(s.contact_wrench, d.contact_wrench[k])
    copy_into(s.cop, d.cop[k])
    copy_into(s.contacts, d.contacts[k])
    copy_into(s.other_contacts, d.other_contacts[k])
    d.next[0] = (k + 1) % d.qpos.shape[0]


@compiled
def believe_oldest(d: Delay):
    """The state that the known robot would have with the oldest measurement."""
    s, k = d.known_state, d.next[0]
    copy_into(d.qpos[k], d.known_views.qpos)
    copy_into(d.qvel[k], d.known_views.qvel)
    mj_step1(d.known_views.model_address, d.known_views.data_address)
    update_state(d.known_robot, d.known_views, s)
    copy_into(d.contact_wrench[k], s.contact_wrench)
    copy_into(d.cop[k], s.cop)
    copy_into(d.contacts[k], s.contacts)
    copy_into(d.other_contacts[k], s.other_contacts)


class DelayedState(StateSource):
    """The state of `delay` seconds ago, of a robot whose masses are thought to be others.

    The sensors give positions, velocities and contact forces of `delay` seconds ago (of the start,
    before that). Everything else of the believed state (masses, CoM, momentum, capture point) comes
    from the model of the robot that is known.

    Args:
        simulation: the true robot in its world.
        robot: the robot that is known; the same joints and feet as the true one.
        delay: a whole number of physics steps [s].

    Raises ConfigError for another delay.
    """

    def __init__(self, simulation: Simulation, robot: Robot, delay: float = 0.0):
        super().__init__(simulation)
        late = whole_steps(delay, simulation.model.opt.timestep, "sensors.delay", least=0)
        self.delay = delay
        self.known = Simulation(on_terrain(robot, simulation.robot.terrain))
        self.arrays, self.state_arrays = self.known.arrays, self.known.state_arrays
        self._delay = allocate_delay(simulation, self.known, late + 1)
        self.sense = Program.of([(measure, self._delay)])
        self.estimate = Program.of([(believe_oldest, self._delay)])
        self.reset()

    def reset(self) -> None:
        """The sensors show the simulation's present state until the delay has passed."""
        for _ in range(len(self._delay.qpos)):
            measure(self._delay)
        self.update()
