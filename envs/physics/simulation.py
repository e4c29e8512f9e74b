"""One simulated robot: MuJoCo data, its compiled views, its pushes and its clock."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.callbacks import CallbackAddress, call_back
from poise.envs.compiled.calls import Program, run
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.mujoco_calls import mj_step1, mj_step2
from poise.envs.physics.engines.engine import Engine
from poise.envs.physics.pushes.push import Kick, Push
from poise.envs.physics.pushes.table import ROW, apply_kicks, apply_pushes, pack
from poise.envs.robots.robot import Robot

from .arrays import RobotArrays, SimViews, robot_arrays, sim_views
from .clock import Clock
from .kinematics import StateArrays, allocate_state, update_state
from .motor_bus import MotorBus, ideal_bus
from .state import RobotState

SOME_PUSHES = 4  # rows of a table that may grow


@compiled
def advance(
    robot: RobotArrays,
    views: SimViews,
    pushes: np.ndarray,
    clock: Clock,
    stepper: CallbackAddress,
):
    """Take one physics step with the controls in `views.ctrl`.

    Enters and leaves with the position and velocity stages current, so whoever reads the state
    needs no second pass. `stepper` is that of the simulation's `Engine`.
    """
    dt = robot.timestep
    t = clock.steps * dt
    views.xfrc_applied[:, :] = 0.0
    apply_pushes(pushes, t, dt, views.xfrc_applied, views.xmat)
    if stepper == 0:
        mj_step2(views.model_address, views.data_address)
    else:
        call_back(stepper)
    apply_kicks(pushes, t, dt, views.qvel)
    clock.steps += 1
    mj_step1(views.model_address, views.data_address)


@dataclass(frozen=True, eq=False)
class World(Block):
    """A simulated robot and all that moves it, for compiled code."""

    robot: RobotArrays
    views: SimViews
    state: StateArrays
    clock: Clock
    pushes: np.ndarray  # see `apply_pushes`
    motors: Program  # what comes of the controls, before each physics step
    sensors: Program  # what measures, after each physics step
    bus: MotorBus  # between the computer and the motors
    stepper: CallbackAddress  # of the engine


@compiled
def physics_step(world: World):
    """Take one physics step with the controls in `views.ctrl`, by motors and sensors."""
    run(world.motors)
    advance(world.robot, world.views, world.pushes, world.clock, world.stepper)
    run(world.sensors)


@compiled
def simulate(world: World, count: int):
    """`count` physics steps with the controls in `views.ctrl`, then the state."""
    for _ in range(count):
        physics_step(world)
    update_state(world.robot, world.views, world.state)


class Simulation(Copyable):
    """A robot on its terrain. `state` is current after `reset` and after every `step`."""

    def __init__(self, robot: Robot):
        self.robot = robot
        self.model = robot.model
        self.data = mujoco.MjData(robot.model)
        self.arrays = robot_arrays(robot)
        self.views = sim_views(robot.model, self.data)
        self.state_arrays = allocate_state(robot.model.nv, len(robot.soles), robot.model.nbody)
        self.clock = Clock(0)
        self.pushes: tuple[Push | Kick, ...] = ()
        self.start_yaw = 0.0  #: of the heading frame at the reset [rad]
        self.push_table = guarded_zeros(SOME_PUSHES, ROW)
        self._engine = Engine(robot, self.data)
        self._world: World | None = None
        self.equip(Program.of(()), Program.of(()), ideal_bus())
        self.reset()

    @property
    def engine(self) -> Engine:
        """What takes the physics steps; may be replaced between episodes."""
        return self._engine

    @engine.setter
    def engine(self, engine: Engine) -> None:
        self._engine, self._world = engine, None

    def equip(self, motors: Program, sensors: Program, bus: MotorBus) -> None:
        """Have compiled code call these kernels before and after every physics step."""
        self.motors, self.sensors, self.bus = motors, sensors, bus
        self._world = None

    def world(self) -> World:
        """The block of this simulation; the same object until `equip`, or a longer `push_table`."""
        if self._world is None or self._world.pushes is not self.push_table:
            self._world = World(
                robot=self.arrays,
                views=self.views,
                state=self.state_arrays,
                clock=self.clock,
                pushes=self.push_table,
                motors=self.motors,
                sensors=self.sensors,
                bus=self.bus,
                stepper=self._engine.stepper,
            )
        return self._world

    @property
    def sizes(self) -> dict[str, int]:
        """What `Block.allocate` takes: nq, nv, nj joints, nu motors, nc soles."""
        nq, nv, nu = self.model.nq, self.model.nv, self.model.nu
        return {"nq": nq, "nv": nv, "nj": nv - 6, "nu": nu, "nc": len(self.robot.soles)}

    @property
    def time(self) -> float:
        """Seconds since the reset."""
        return float(self.clock.steps * self.arrays.timestep)

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
        """Reset to `qpos` (nq,) and `qvel` (nv,): by default standing, at rest.

        Directions of pushes are relative to the heading at this moment.
        """
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.robot.standing_qpos if qpos is None else qpos
        if qvel is not None:
            self.data.qvel[:] = qvel
        mujoco.mj_normalizeQuat(self.model, self.data.qpos)
        mujoco.mj_forward(self.model, self.data)
        self._engine.begin()
        self.clock.steps = 0
        self.state_arrays.edges[:] = 0.0
        update_state(self.arrays, self.views, self.state_arrays)
        self.start_yaw = self.state.heading_yaw
        self.set_pushes(pushes)
        return self.state

    def set_pushes(self, pushes: Sequence[Push | Kick]) -> None:
        """Replace the schedule, at any time.

        Starts are seconds since the reset, directions relative to the heading at the reset.
        """
        self.pushes = tuple(pushes)
        table = pack(self.pushes, self.robot, self.start_yaw)
        if len(table) > len(self.push_table):  # seldom: compiled code is bound to the table
            self.push_table = guarded_zeros(2 * len(table), ROW)
        self.push_table[:] = np.zeros((), ROW)
        self.push_table[: len(table)] = table

    def step(self, torques: np.ndarray, count: int = 1) -> RobotState:
        """Apply joint torques (nu,) [N·m] for `count` physics steps."""
        self.views.ctrl[:] = torques
        simulate(self.world(), count)
        self._engine.check()
        return self.state
