"""Targets of a motion: rates are derivatives, frames are those of the feet, residuals add up."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.targets import motion_arrays, no_offsets, update_targets
from poise.baselines.controller import Targets
from poise.envs.physics.simulation import Simulation
from tests.support.physics import robot_named

MOTIONS = ("squat", "bow", "arm_swing", "weight_shift")


RESIDUALS = 9  # entries of a residual, of which this file sets the first four


class Scene:
    """A standing robot turned by `yaw`, and the targets of a motion at any time."""

    def __init__(self, name, motion, yaw=0.0):
        self.robot = robot_named(name)
        self.motion = load_motion(motion, self.robot)
        self.simulation = Simulation(self.robot)
        qpos = self.robot.standing_qpos.copy()
        turn = Rotation.from_euler("z", yaw)
        qpos[:3] = turn.apply(qpos[:3]) + [0.7, -0.4, 0.0]
        root = turn * Rotation.from_quat(qpos[3:7], scalar_first=True)
        qpos[3:7] = root.as_quat(scalar_first=True)
        self.state = self.simulation.reset(qpos)

    def at(self, time, offset=0.0, **residual) -> Targets:
        """The targets with residuals by name: com=(x, y), cop=(x, y)."""
        targets = Targets.standing(self.robot, self.state)
        offsets = no_offsets()
        offsets.com[:] = residual.get("com", (0.0, 0.0))
        offsets.cop[:] = residual.get("cop", (0.0, 0.0))
        m = self.motion
        update_targets(
            self.simulation.arrays, self.simulation.state_arrays,
            motion_arrays(m), time, offset, offsets, targets.arrays(),
        )  # fmt: skip
        return targets


@pytest.mark.parametrize("motion", MOTIONS)
def test_rates_are_derivatives(motion):
    """v_ref, a_ref, ċ_ref, c̈_ref and the root's velocity and acceleration by differences."""
    scene, h = Scene("humanoid", motion, yaw=0.8), 1e-4
    fastest = 0.0
    for t in np.random.default_rng(0).uniform(0.05, 0.95 * scene.motion.duration, 12):
        before, now, after = (scene.at(t + dt) for dt in (-h, 0.0, h))
        for value, rate, tol in (
            ("q_ref", "v_ref", 1e-5), ("v_ref", "a_ref", 1e-2), ("com", "com_vel", 1e-5),
            ("com_vel", "com_acc", 1e-2), ("root_vel", "root_acc", 1e-2),
        ):  # fmt: skip
            change = (getattr(after, value) - getattr(before, value)) / (2 * h)
            np.testing.assert_allclose(change, getattr(now, rate), atol=tol)
        turn = Rotation.from_matrix(before.root_axes.T @ after.root_axes).as_rotvec() / (2 * h)
        np.testing.assert_allclose(turn, now.root_vel, atol=1e-4)  # its axis may turn
        fastest = max(fastest, np.abs(now.v_ref).max())
    assert fastest > 0.05


def test_a_bow_turns_the_root():
    """The root's reference leans forward, about the robot's own left axis, and comes back."""
    scene = Scene("humanoid", "bow", yaw=1.1)
    start, middle, end = (scene.at(t) for t in (0.0, 1.9, 3.8))
    np.testing.assert_allclose(start.root_axes, scene.state.root_axes, atol=1e-6)
    np.testing.assert_allclose(end.root_axes, start.root_axes, atol=1e-9)
    lean = Rotation.from_matrix(middle.root_axes @ start.root_axes.T).as_rotvec()
    left = np.array([-np.sin(1.1), np.cos(1.1), 0.0])
    assert np.degrees(lean @ left) > 15.0
    np.testing.assert_allclose(lean, (lean @ left) * left, atol=1e-3)


@pytest.mark.parametrize("name", ["humanoid", "tall"])
def test_standing_targets_are_the_constant_motion(name):
    """`Targets.standing` and the motion called standing ask for the same."""
    scene = Scene(name, "standing", yaw=-2.0)
    moving, standing = scene.at(3.3), Targets.standing(scene.robot, scene.state)
    for ours, theirs in zip(moving.arrays().members(), standing.arrays().members(), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-6)


def test_targets_are_in_the_heading_frame():
    """A turned robot has turned targets: c_ref and p_ref relative to its feet, to its left."""
    straight, turned = Scene("humanoid", "weight_shift"), Scene("humanoid", "weight_shift", 0.9)
    a, b = straight.at(1.3), turned.at(1.3)
    rotation = Rotation.from_euler("z", 0.9)
    for name in ("com", "cop"):
        x = getattr(a, name) - straight.state.origin[: len(getattr(a, name))]
        y = getattr(b, name) - turned.state.origin[: len(getattr(b, name))]
        x, y = np.append(x, 0.0)[:3], np.append(y, 0.0)[:3]
        np.testing.assert_allclose(rotation.apply(x), y, atol=1e-9)
        assert x[1] > 0.02
    np.testing.assert_allclose(rotation.apply(a.com_acc), b.com_acc, atol=1e-9)
    np.testing.assert_allclose(a.q_ref, b.q_ref)


def test_residual_and_offset_move_the_targets():
    """Δc_ref moves c_ref alone, Δp_ref moves p_ref alone, the offset moves both forward."""
    scene = Scene("humanoid", "standing", yaw=0.5)
    plain = scene.at(0.0)
    forward, left = np.array([np.cos(0.5), np.sin(0.5)]), np.array([-np.sin(0.5), np.cos(0.5)])
    moved = scene.at(0.0, com=(0.1, 0.02))
    np.testing.assert_allclose((moved.com - plain.com)[:2], 0.1 * forward + 0.02 * left, atol=1e-9)
    np.testing.assert_array_equal(moved.cop, plain.cop)
    moved = scene.at(0.0, cop=(-0.03, 0.05))
    np.testing.assert_allclose(moved.cop - plain.cop, -0.03 * forward + 0.05 * left, atol=1e-9)
    np.testing.assert_array_equal(moved.com, plain.com)
    moved = scene.at(0.0, offset=0.04)
    np.testing.assert_allclose(moved.cop - plain.cop, 0.04 * forward, atol=1e-9)
    np.testing.assert_allclose((moved.com - plain.com)[:2], 0.04 * forward, atol=1e-9)


def test_targets_follow_feet_that_moved():
    """Where a foot has slid, the middle of the soles is elsewhere, and so are the targets."""
    scene = Scene("humanoid", "standing")
    before = scene.at(0.0)
    qpos = scene.state.qpos.copy()
    qpos[7 + scene.robot.joint_names.index("left_hip_x")] += 0.1
    scene.state = scene.simulation.reset(qpos)
    after = scene.at(0.0)
    shift = after.com - before.com
    np.testing.assert_allclose(after.cop, scene.state.origin[:2], atol=1e-6)
    assert np.linalg.norm(shift[:2]) > 0.01
