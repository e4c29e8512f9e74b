"""Wrenches of the soles: their sum is the ground's, each is inside its cone."""

import numpy as np
import pytest

from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.feasibility.split import (
    joint_motor_torques,
    split_wrench,
    world_cones,
    wrench_sums,
)
from poise.baselines.motion.feasibility.trajectory import PlantedRobot, joints_of, sample_trajectory
from tests.support.physics import robot_named
from tests.support.robot_clips import com_clip


@pytest.mark.parametrize("name", ["humanoid", "compact"])
def test_wrenches_add_up_inside_their_cones(name: str) -> None:
    robot = robot_named(name)
    clip = com_clip(robot, lambda t: np.array([0.0, 0.04 * np.sin(2.0 * t), 0.0]), 3.2)
    motion = reference_from(clip, robot, "test")
    path = sample_trajectory(PlantedRobot(robot), joints_of(motion), np.linspace(0.2, 3.0, 12))
    wrenches, unit = split_wrench(robot, path), robot.units.force
    total = np.einsum("kij,kj->ki", wrench_sums(path), wrenches)
    np.testing.assert_allclose(total, path.wrench, atol=1e-3 * unit)
    rows = np.einsum("kij,kj->ki", world_cones(robot, path), wrenches)
    assert rows.max() < 1e-9 * unit
    assert np.ptp(wrenches[:, 2]) > 0.2 * unit  # the load goes from sole to sole


def test_torques_are_those_of_inverse_dynamics() -> None:
    """A humanoid that stands still: the torques and wrenches hold it, M v̇ + h = Sᵀτ + Jᵀw."""
    robot = robot_named("humanoid")
    planted, still = PlantedRobot(robot), np.zeros(len(robot.joint_names))
    q = robot.standing_qpos[7:]
    path = sample_trajectory(planted, lambda _: (q, still, still), np.zeros(1))
    forces = planted.state.h - path.jacobians[0].T @ split_wrench(robot, path)[0]
    assert np.abs(forces[:6]).max() < 0.2  # [N, N·m] on a root that nothing else holds
    np.testing.assert_allclose(
        joint_motor_torques(robot, path)[0], forces[robot.motor_dofs], atol=1e-9
    )
    left, right = (robot.motor_names.index(f"{side}_knee") for side in ("left", "right"))
    torques = joint_motor_torques(robot, path)[0]
    assert torques[left] == pytest.approx(torques[right], abs=1.0) and abs(torques[left]) > 1.0


def test_a_load_on_one_side_is_borne_by_that_sole() -> None:
    """A ZMP at the edge of one sole leaves next to nothing to the other."""
    robot = robot_named("humanoid")
    planted, still = PlantedRobot(robot), np.zeros(len(robot.joint_names))
    q = robot.standing_qpos[7:]
    path = sample_trajectory(planted, lambda _: (q, still, still), np.zeros(1))
    edge = path.support[:, 1].max() - 0.005
    moment = (edge - path.com[0, 1]) * robot.units.force
    pushed = path._replace(wrench=path.wrench + [[0.0, 0.0, 0.0, moment, 0.0, 0.0]])
    wrenches = split_wrench(robot, pushed)[0].reshape(2, 6)
    loads = wrenches[:, 2]
    cops = np.column_stack([-wrenches[:, 4], wrenches[:, 3]])  # times the loads
    for cop, load, sole in zip(cops, loads, robot.soles, strict=True):
        assert load > 0.0 and np.all(
            np.abs(cop) <= load * 0.5 * np.ptp(sole.polygon, axis=0) + 0.01
        )
    assert loads.min() < 0.08 * robot.units.force and loads.max() > 0.9 * robot.units.force
