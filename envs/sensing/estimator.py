"""State estimation for a robot with sensor noise, delays and motor limits."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Annotated
from weakref import WeakKeyDictionary

import mujoco
import numpy as np

from poise.configs.errors import ConfigError
from poise.envs.compiled.block import Block
from poise.envs.compiled.calls import Program
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import axes_of, copy_into, quaternion_of
from poise.envs.compiled.mujoco_calls import mj_step1
from poise.envs.compiled.mutable import Mutable
from poise.envs.physics.arms import allocate_arms, begin_arms, move_arms
from poise.envs.physics.arrays import RobotArrays, SimViews
from poise.envs.physics.kinematics import StateArrays, update_state
from poise.envs.physics.motor_bus import MotorBus
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state_source import StateSource
from poise.envs.robots.robot import Robot, on_terrain
from poise.envs.terrain.flat import Flat

from .config import EstimatorConfig
from .drawn import DrawnRobot, Plant
from .external_force import ExternalForce, bear_load, begin_force, keep_load, observe_force
from .friction import SlidingFriction, allocate_friction, begin_friction, learn_friction
from .inekf import Invariant, allocate_invariant, begin_invariant, follow_invariant
from .measurement import RING, Rings, Sensors, arrived, begin_sensors, measure
from .motors import MotorHistory, Motors, begin_motors, drive_motors
from .odometry import Odometry, begin_odometry, copy_axes, follow_measurements
from .promises import Promises, keep_promises, predict
from .realism import Realism
from .rollout import Rollout, roll_out

#: `Estimation.simulated`, to which a running servo adds one: two is a simulation
SIMULATES = {"none": 0, "promised": 0, "auto": 1, "rollout": 2}
WITHOUT_CONTACTS: WeakKeyDictionary[Robot, Robot] = WeakKeyDictionary()
SINK = 0.05  # of the height error of the soles that a tick takes away


@dataclass(eq=False)
class Estimation(Block):
    """The block of `estimate_state`."""

    rings: Rings
    odometry: Odometry
    invariant: Invariant
    robot: RobotArrays  # the nominal one
    views: SimViews  # of its simulation
    state: StateArrays
    rollout: Rollout
    force: ExternalForce
    friction: SlidingFriction
    sense: Mutable[int]  # physics steps by which measurements are late
    earlier: Mutable[int]  # by which what acts was asked for before
    horizon: Mutable[int]  # that are predicted
    exact: Mutable[bool]  # the true state is known
    simulated: Mutable[int]  # see `SIMULATES`
    invariant_filter: Mutable[bool]  # the velocity is that of `invariant`, not of `odometry`
    pushed: Mutable[bool]  # the external force is estimated
    loaded: Mutable[bool]  # what of it lasts is borne
    axes: Annotated[np.ndarray, 3, 3]  # of the root, predicted
    q: Annotated[np.ndarray, "nj"]  # predicted
    v: Annotated[np.ndarray, "nv"]
    position: Annotated[np.ndarray, 3]


@compiled
def estimate_state(b: Estimation):
    """Estimate the state of the nominal robot from the measurements until now."""
    r, o = b.rings, b.odometry
    now = r.count - 1
    keep_promises(o.promises, now)
    known = max(now - b.sense, 0)
    row = arrived(r, b.sense)
    if b.exact:
        copy_into(r.truth_qpos[row, :3], b.position)
        axes_of(r.truth_qpos[row, 3:7], b.axes)
        copy_into(r.truth_qpos[row, 7:], b.q)
        copy_into(r.truth_qvel[row], b.v)
    else:
        if b.invariant_filter:
            follow_invariant(b.invariant, known + 1, b.earlier)
        else:
            follow_measurements(o, known + 1, b.earlier)
        copy_into(o.position, b.position)
        copy_axes(o.axes, b.axes)
        copy_into(o.q, b.q)
        copy_into(o.v, b.v)
        if b.invariant_filter:
            for a in range(3):
                b.v[3 + a] -= b.invariant.gyro_bias[a]
    if b.pushed or b.loaded:
        _write_state(b, row)
        observe_force(b.force, b.robot, b.state, r, known, b.exact)
        if not b.pushed:
            keep_load(b.force)
    ahead = b.horizon - b.sense + now - known  # at an episode's start less is late
    if b.horizon > 0 and b.simulated + b.rollout.motors.bus.servoed > 1:
        roll_out(
            b.rollout, known, ahead, b.earlier, b.force.wrench,
            b.position, b.axes, b.q, b.v,
        )  # fmt: skip
    elif b.horizon > 0:
        predict(
            o.promises, known, ahead, b.earlier, b.robot.timestep,
            b.position, b.axes, b.q, b.v,
        )  # fmt: skip
    _write_state(b, row)
    if not b.exact:
        _stand_on_ground(b)
    learn_friction(b.friction, b.robot, b.state, r, row)
    if b.loaded:
        bear_load(b.force, b.robot, b.state)


@compiled
def _write_state(b: Estimation, row: int):
    """Fill `b.state` from the estimated pose, velocity and forces of the soles."""
    v, r, robot = b.views, b.rings, b.robot
    copy_into(b.position, v.qpos[:3])
    quaternion_of(b.axes, v.qpos[3:7])
    copy_into(b.q, v.qpos[7:])
    copy_into(b.v, v.qvel)
    mj_step1(v.model_address, v.data_address)
    for i in range(robot.sole_sensor.shape[0]):
        v.sensordata[robot.sole_sensor[i]] = r.found[row, i]
    v.sensordata[robot.ground_sensor] = r.found[row, robot.sole_sensor.shape[0]]
    for a in range(3):
        v.qfrc_constraint[a] = 0.0
        for c in range(3):
            v.qfrc_constraint[a] += b.axes[a, c] * r.wrench[row, c]
        v.qfrc_constraint[3 + a] = r.wrench[row, 3 + a]
    update_state(robot, v, b.state)


@compiled
def _stand_on_ground(b: Estimation):
    """Lead the root's height to where the soles that touch the ground are on it."""
    s, total, feet = b.state, 0.0, 0
    for i in range(s.contacts.shape[0]):
        if s.contacts[i] > 0.5:
            total += s.sole_point[i, 2] - s.ground[i]
            feet += 1
    if feet > 0:
        b.odometry.position[2] -= SINK * total / feet
        b.invariant.position[2] -= SINK * total / feet
        for i in range(b.invariant.soles.shape[0]):
            b.invariant.soles[i, 2] -= SINK * total / feet


class EstimatedState(StateSource, Copyable):
    """The estimated state of a `Plant`, whose sensors and motors are the randomised robot's.

    Args:
        plant: the true robot in its world.
        robot: the one that is known.
        config: how its state is estimated.
    """

    def __init__(self, plant: Plant, robot: Robot, config: EstimatorConfig):
        super().__init__(plant.simulation)
        self.plant, self.config = plant, config
        terrain = plant.robot.terrain
        assumed = on_terrain(robot, terrain if terrain.assumed() else Flat())
        self.known, self.ahead = Simulation(without_contacts(assumed)), Simulation(assumed)
        true, sizes = self.simulation, self.simulation.sizes
        world = {"robot": true.arrays, "views": true.views, "bus": MotorBus.allocate(sizes)}
        rings = Rings.allocate(sizes)
        self.sensors = Sensors.allocate(sizes, **world, rings=rings)
        self.bus = self.sensors.bus
        self.motors = Motors.allocate(sizes, **world, asked=MotorHistory.allocate(sizes))
        self.arms = allocate_arms(plant.simulation, self.known)
        self.known.state_arrays = self.known.state_arrays.replace(
            motor_q=self.bus.q, motor_dq=self.bus.dq
        )
        self.arrays, self.state_arrays = self.known.arrays, self.known.state_arrays
        promises = Promises.allocate({"n": RING, **sizes})
        self.promise = promises.last
        own = {"robot": self.arrays, "state": self.state_arrays, "rings": rings}
        self.odometry = Odometry.allocate(sizes, **own, promises=promises)
        self.invariant = allocate_invariant(self.odometry, sizes)
        self.estimation = Estimation.allocate(
            sizes,
            **own,
            odometry=self.odometry,
            invariant=self.invariant,
            views=self.known.views,
            rollout=Rollout(self.ahead.arrays, self.ahead.views, self.motors),
            force=ExternalForce.allocate(),
            friction=allocate_friction(robot),
        )
        self.drive = Program.of([(drive_motors, self.motors), (move_arms, self.arms)])
        self.sense = Program.of([(measure, self.sensors)])
        self.estimate = Program.of([(estimate_state, self.estimation)])

    def begin(self, drawn: DrawnRobot, holding: np.ndarray) -> None:
        """Start an episode with the robot that was drawn.

        The simulation has just been reset, and motors were asked for `holding` (nu,) [N·m].
        """
        self.drawn = drawn
        begin_motors(self.motors, drawn, holding)
        begin_arms(self.arms, drawn.arms, drawn.arms_seed)
        begin_sensors(self.sensors, drawn, self.simulation.model)
        dt, c = self.arrays.timestep, self.config
        predicted = c.predictor != "none"
        acting = round((drawn.command * dt + drawn.lag + drawn.misjudged) / dt)
        earlier = max(acting, 0)  # below 0 the sensing's delay is underrated
        horizon = max(drawn.sense + acting, 0) if predicted else 0
        exact = c.kind == "exact" or (c.kind == "auto" and not drawn.measured)
        pushed = c.external_force and horizon > 0 and SIMULATES[c.predictor] > 0
        loaded = c.load and (drawn.measured or drawn.loaded)
        b = self.estimation
        b.sense, b.earlier, b.horizon = drawn.sense, earlier, horizon
        b.exact, b.simulated = exact, SIMULATES[c.predictor]
        b.invariant_filter, b.pushed, b.loaded = c.kind == "inekf", pushed, loaded
        self._begin_estimate()

    def _begin_estimate(self) -> None:
        """Set out from what was measured before the episode."""
        estimation = self.estimation
        begin_force(estimation.force, self.config.load_time if estimation.loaded else 0.0)
        self.state_arrays.load[:] = 0.0
        begin_friction(self.estimation.friction, self.state_arrays, self.config.slide_speed)
        begin_odometry(self.odometry, self.drawn.noise, self.config)
        turn = np.zeros(4)
        quaternion_of(self.odometry.axes, turn)
        for each in (self.known, self.ahead):  # not where an episode ended
            each.reset(np.concatenate([self.odometry.position, turn, self.odometry.q]))
        begin_invariant(self.invariant, self.drawn.noise, self.config)
        self.update()

    def reset(self) -> None:
        """Nothing: `begin` says who the robot is."""


def check_latency(level: Realism, timestep: float) -> None:
    """Raise ConfigError where a level's delays and lag exceed the prediction's memory."""
    most = (RING - 2) * timestep
    parts = {
        "latency.sense": level.latency.sense,
        "latency.command": level.latency.command,
        "motors.lag": level.motors.lag,
        "latency.misjudged": level.latency.misjudged,
    }
    longest = {name: x[1] if isinstance(x, tuple) else x for name, x in parts.items()}
    if sum(longest.values()) > most:
        sums = ", ".join(f"{name} {value:g}" for name, value in longest.items() if value)
        raise ConfigError(f"delays and lag may sum to at most {most:g} s: {sums}",
                          source=level.name, field="latency")  # fmt: skip


def without_contacts(robot: Robot) -> Robot:
    """A copy of `robot` whose model has no contacts and no constraints to look for.

    Environments of one robot share it: a model with its meshes may have 75 MB.
    """
    if robot not in WITHOUT_CONTACTS:
        model = copy.copy(robot.model)
        off = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        model.opt.disableflags |= int(off)
        WITHOUT_CONTACTS[robot] = replace(robot, model=model)
    return WITHOUT_CONTACTS[robot]
