"""The fastest swing of a robot's legs, and steps that they cannot do."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.balance.stepping.planning.config import CaptureStepConfig, StepLimits
from poise.baselines.balance.stepping.planning.swing_speed import possible_limits, swing_speed
from poise.baselines.controller import Targets
from poise.baselines.registry import controller_config, load_controller
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.envs.physics.arrays import dof_chain
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot
from tests.support.shared import robot

CLEARANCE = 0.03


def damped(factor: float) -> Robot:
    """The toddler with so many times the damping in its joints, and without springs."""
    changed = copy.deepcopy(robot("toddler"))
    changed.model.dof_damping[6:] *= factor
    return changed


def config(name: str = "capture-step") -> CaptureStepConfig:
    found = controller_config(name)
    assert isinstance(found, CaptureStepConfig)
    return found


def possible(body: Robot, c: CaptureStepConfig) -> StepLimits | None:
    return possible_limits(body, c.limits, c.swing, c.step_qp.torque.share)


def test_speeds_go_with_the_damping() -> None:
    """Twice the damping, half the speed; without damping nothing bounds it."""
    once, twice = swing_speed(damped(1.0), CLEARANCE), swing_speed(damped(2.0), CLEARANCE)
    np.testing.assert_allclose(twice, np.array(once) / 2.0, rtol=1e-9)
    assert swing_speed(damped(0.0), CLEARANCE) == (np.inf, np.inf, np.inf)


def test_speeds_are_those_of_the_lifted_leg() -> None:
    """The higher the foot, the more the knee is bent, and the shorter is its lever ahead."""
    body = robot("humanoid")
    ahead = [swing_speed(body, share * body.height_com).ahead for share in (0.001, 0.1, 0.2)]
    assert ahead[0] > 1.2 * ahead[1] > 1.4 * ahead[2]


def test_no_joint_moves_faster_than_its_motor_can_drive_it() -> None:
    """The foot is no faster than joints at the bound |q̇| D = τ_max would all together move it."""
    r = damped(1.0)
    data = mujoco.MjData(r.model)
    data.qpos[:] = r.standing_qpos
    mujoco.mj_forward(r.model, data)
    limit = np.zeros(r.model.nv)
    limit[r.motor_dofs] = r.torque_limit
    sole, rows = r.soles[0], np.zeros((3, r.model.nv))
    dofs = [dof for dof in dof_chain(r.model, sole.body_id) if dof >= 6]
    mujoco.mj_jacBody(r.model, data, rows, None, sole.body_id)
    most = np.abs(rows[:, dofs]) @ (limit / r.model.dof_damping.clip(1e-9))[dofs] / (15.0 / 8.0)
    speed = swing_speed(r, CLEARANCE)
    assert 0.1 * most[0] < speed.ahead < most[0] and 0.1 * most[1] < speed.sideways < most[1]


@pytest.mark.parametrize("name", ["capture-step", "feedback-step", "ipm-step"])
@pytest.mark.parametrize("body", ["humanoid", "toddler"])
def test_limits_that_do_not_bind_are_those_of_the_file(name: str, body: str) -> None:
    """To the bit: nothing changes for robots that are fast enough."""
    assert possible(robot(body), config(name)) == config(name).limits


def test_slow_legs_step_less_far_and_take_longer() -> None:
    """The limits of speed fall with the damping, and the least time of a step rises."""
    limits, given = possible(damped(8.0), config()), config().limits
    assert limits is not None
    assert limits.speed < given.speed and limits.side_speed < given.side_speed
    assert given.time_min < limits.time_min <= limits.time_max == given.time_max
    assert CaptureStep(damped(8.0), config()).step_limits == limits


def test_legs_that_would_land_too_late_never_step() -> None:
    """A fall then has the torques of feet in place, bit for bit."""
    slow = damped(30.0)
    assert possible(slow, config()) is None
    stepping, in_place = CaptureStep(slow, config()), MomentumQP(slow, config().qp)
    assert stepping.step_limits is None
    simulation, falling = Simulation(slow), np.zeros(slow.model.nv)
    falling[0] = 1.0  # [m/s], far beyond what feet in place hold
    state = simulation.reset(qvel=falling)
    targets = Targets.standing(slow, state)
    for _ in range(60):
        torques = in_place.torques(state, targets)
        np.testing.assert_array_equal(stepping.torques(state, targets), torques)
        state = simulation.step(torques, 2)
    assert stepping.steps == 0
    assert state.com[0] - state.origin[0] > 0.05


def test_a_controller_that_steps_is_made_for_every_body() -> None:
    """`load_controller` refuses none for its slow legs."""
    assert isinstance(load_controller("ipm-step", damped(30.0)), CaptureStep)
