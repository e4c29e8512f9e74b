"""Robots, states and contact forces for the tests of the state and of the controllers."""

from __future__ import annotations

import copy
import functools
from dataclasses import replace
from typing import NamedTuple

import mujoco
import numpy as np

from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.baselines.whole_body.parameters import QPParameters
from poise.baselines.whole_body.parts.part import Bound
from poise.baselines.whole_body.tasks.task import Task
from poise.envs.physics.kinematics import update_state
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.simulation import Simulation
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot, fingerprint, load_robot
from poise.envs.sensing.external_force import ExternalForce, bear_load

robot_named = functools.cache(load_robot)


def slippery(robot: Robot, friction: float) -> Robot:
    """The robot on a ground of another sliding friction."""
    model = copy.copy(robot.model)
    model.geom_friction[:, 0] = friction
    return replace(robot, model=model, fingerprint=fingerprint(model, robot.standing_qpos))


def push(robot: Robot, specific: float, direction: float, start: float = 0.02) -> Push:
    """A push of 0.1 s on the root with J/m = `specific` [N·s/kg]."""
    body = robot.model.body(robot.root_body_id).name
    return Push(body, start, 0.1, specific * robot.mass, direction)


def random_state(robot: Robot, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """qpos and qvel with everything turned and moving, high above the ground."""
    low, high = np.clip(robot.joint_range, -1.0, 1.0).T
    quat = rng.normal(size=4)
    qpos = np.concatenate(
        [rng.uniform(-1, 1, 2), [3.0], quat / np.linalg.norm(quat), rng.uniform(low, high)]
    )
    return qpos, rng.normal(size=robot.model.nv)


def forward(simulation: Simulation) -> RobotState:
    """The state with accelerations and contact forces of this very instant, not the last step."""
    mujoco.mj_forward(simulation.model, simulation.data)
    update_state(simulation.arrays, simulation.views, simulation.state_arrays)
    return simulation.state


def contact_forces(
    simulation: Simulation, body: int | None = None
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(point, force on the robot) of every contact with the ground, or of one body's; world."""
    model, data = simulation.model, simulation.data
    fixed = model.geom_bodyid == 0
    out = []
    for i, contact in enumerate(data.contact):
        if not fixed[contact.geom].any():
            continue
        other = contact.geom2 if fixed[contact.geom1] else contact.geom1
        if body is not None and model.geom_bodyid[other] != body:
            continue
        wrench = np.zeros(6)
        mujoco.mj_contactForce(model, data, i, wrench)
        assert not wrench[3:].any()  # contact dimension 3
        sign = 1.0 if fixed[contact.geom1] else -1.0  # the force is on geom2
        out.append((contact.pos.copy(), sign * contact.frame.reshape(3, 3).T @ wrench[:3]))
    return out


def wrench_about(point: np.ndarray, forces: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """(6,) sum of forces at points: force, and moment about `point`."""
    total = np.zeros(6)
    for position, force in forces:
        total[:3] += force
        total[3:] += np.cross(position - point, force)
    return total


class Tick(NamedTuple):
    """One control tick on the way back from a push."""

    state: RobotState
    targets: Targets
    parameters: QPParameters
    tasks: list[Bound[Task]]
    cop_vel: np.ndarray  # what the controller measured
    torques: np.ndarray  # (nu,) its answer
    vdot: np.ndarray
    wrenches: np.ndarray
    root_wrench: np.ndarray
    solved: bool


def controller(robot: Robot, **config) -> MomentumQP:
    """The default momentum QP with some of its configuration changed."""
    return MomentumQP(robot, MomentumQPConfig(**config))


@functools.cache
def recovery(
    name: str = "humanoid",
    root: str = "hard",
    specific: float = 0.28,
    every: int = 6,
    load: tuple[float, float, float] = (0.0, 0.0, 0.0),
    friction: float = 1.0,
) -> tuple[Tick, ...]:
    """Ticks along push recoveries in four directions, 0.4 s each, from contact lost to at rest.

    The robot is believed to bear a `load`, and to stand on so much of its `friction`, see
    `RobotState`.
    """
    robot = robot_named(name)
    qp = controller(robot, root=root)
    simulation = Simulation(robot)
    simulation.state_arrays.friction = friction
    ticks, force = [], ExternalForce.allocate()
    force.load[:] = load
    for direction in (0.0, 90.0, 180.0, 250.0):
        state = simulation.reset(pushes=[push(robot, specific, direction)])
        targets = Targets.standing(robot, state)
        qp.reset(state)
        for k in range(100):
            if any(load):
                bear_load(force, simulation.arrays, simulation.state_arrays)
            failures = qp.failures
            torques = qp.torques(state, targets)
            if k % every == 3:
                ticks.append(
                    Tick(
                        state.copy(), targets, qp.parameters, list(qp.tasks.values()),
                        qp.workspace.cop_vel.copy(), torques, qp.vdot,
                        qp.wrenches, qp.root_wrench, qp.failures == failures,
                    )
                )  # fmt: skip
            state = simulation.step(torques, 2)
    return tuple(ticks)
