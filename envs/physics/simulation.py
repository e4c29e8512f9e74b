"""One simulated robot: MuJoCo data, its compiled views, its pushes and its clock."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import apart
from poise.envs.compiled.mujoco_calls import mj_step1, mj_step2
from poise.envs.pushes.push import Kick, Push
from poise.envs.pushes.table import TABLE_COLUMNS, apply_kicks, apply_pushes, pack
from poise.envs.robots.robot import Robot

from .arrays import Plant, RobotArrays, plant_views, robot_arrays
from .kinematics import StateArrays, allocate_state, update_state
from .state import RobotState


@compiled
def advance(robot: RobotArrays, plant: Plant, pushes: np.ndarray, clock: np.ndarray):
    """One physics step with the controls in `plant.ctrl`.

    Enters and leaves with the position and velocity stages current, so whoever reads the state
    needs no second pass. `clock` (1,) counts steps since the reset.
    """
    dt = robot.timestep
    t = clock[0] * dt
    plant.xfrc_applied[:, :] = 0.0
    apply_pushes(pushes, t, dt, plant.xfrc_applied, plant.xmat)
    mj_step2(plant.model_address, plant.data_address)
    apply_kicks(pushes, t, dt, plant.qvel)
    clock[0] += 1
    mj_step1(plant.model_address, plant.data_address)


@dataclass(frozen=True, eq=False)
class World(Block):
    """What `Simulation.step` works on."""

    robot: RobotArrays
    plant: Plant
    state: StateArrays
    clock: np.ndarray  # (1,) int
    pushes: np.ndarray
    count: np.ndarray  # (1,) int: physics steps


@compiled
def advance_world(world: World):
    """`count` physics steps, then the state."""
    for _ in range(world.count[0]):
        advance(world.robot, world.plant, world.pushes, world.clock)
    update_state(world.robot, world.plant, world.state)


class Simulation(Copyable):
    """A robot on flat ground. `state` is current after `reset` and after every `step`."""

    def __init__(self, robot: Robot):
        self.robot = robot
        self.model = robot.model
        self.data = mujoco.MjData(robot.model)
        self.arrays = robot_arrays(robot)
        self.plant = plant_views(robot.model, self.data)
        self.state_arrays = allocate_state(robot.model.nv, len(robot.soles), robot.model.nbody)
        self.clock = apart(1, dtype=np.int64)
        self._count = apart(1, dtype=np.int64)
        self.pushes: tuple[Push | Kick, ...] = ()
        self.push_table = apart((0, TABLE_COLUMNS))
        self._tables = {0: self.push_table}  # by number of pushes: compiled code is bound to them
        self._world: World | None = None
        self.reset()

    @property
    def time(self) -> float:
        """Seconds since the reset."""
        return float(self.clock[0] * self.arrays.timestep)

    @property
    def state(self) -> RobotState:
        """The current state; its arrays are overwritten by the next step."""
        return RobotState(self.arrays, self.state_arrays, self.time)

    def reset(
        self,
        qpos: np.ndarray | None = None,
        qvel: np.ndarray | None = None,
        pushes: Sequence[Push | Kick] = (),
    ) -> RobotState:
        """Start anew from `qpos` (nq,) and `qvel` (nv,): by default standing, at rest.

        Push directions are relative to the heading at this moment.
        """
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.robot.standing_qpos if qpos is None else qpos
        if qvel is not None:
            self.data.qvel[:] = qvel
        mujoco.mj_normalizeQuat(self.model, self.data.qpos)
        mujoco.mj_forward(self.model, self.data)
        self.clock[0] = 0
        update_state(self.arrays, self.plant, self.state_arrays)
        self.set_pushes(pushes)
        return self.state

    def set_pushes(self, pushes: Sequence[Push | Kick]) -> None:
        """Replace the schedule; starts are seconds since the reset."""
        self.pushes = tuple(pushes)
        table = pack(self.pushes, self.robot, self.state.heading_yaw)
        if len(table) not in self._tables:
            self._tables[len(table)] = apart(table.shape)
        self.push_table = self._tables[len(table)]
        self.push_table[:] = table

    def step(self, torques: np.ndarray, count: int = 1) -> RobotState:
        """Apply joint torques (nu,) [N·m] for `count` physics steps."""
        if self._world is None or self._world.pushes is not self.push_table:
            self._world = World(
                self.arrays, self.plant, self.state_arrays, self.clock, self.push_table, self._count
            )
        self.plant.ctrl[:] = torques
        self._count[0] = count
        advance_world(self._world)
        return self.state
