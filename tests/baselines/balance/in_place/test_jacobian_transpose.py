"""A virtual wrench on the CoM, mapped to torques."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.balance.in_place.jacobian_transpose import JacobianTranspose
from poise.baselines.balance.in_place.wrenches import joint_torques, sole_wrenches
from poise.baselines.controller import Targets
from poise.envs.compiled.maths.vectors import rotation_vector
from tests.support.shared import generic_state, robot


@pytest.mark.parametrize("angle", [0.0, 1e-10, 0.4, 2.5, 3.1])
def test_rotation_vector(angle):
    """Against SciPy."""
    phi = angle * np.array([0.48, -0.6, 0.64])
    np.testing.assert_allclose(
        rotation_vector(Rotation.from_rotvec(phi).as_matrix()), phi, atol=1e-9
    )


def test_virtual_work():
    """For every motion that leaves the soles at rest, the joints' work is the virtual wrench's.

    With J v = 0: −(J_jᵀ w)·q̇ = F·ċ' + N·ω, where ċ' = v_root + ω × (c − r_root) is the velocity
    of the CoM's place on the root.
    """
    state = generic_state().state
    wrench = np.array([30.0, -20.0, 400.0, 4.0, -6.0, 2.0])
    w = sole_wrenches(state, wrench)
    torques = joint_torques(state, w) - state.h[6:]
    _, values, Vt = np.linalg.svd(state.J)
    null = Vt[np.sum(values > 1e-9) :]
    assert len(null) == len(state.qvel) - 12
    for v in null:
        omega = state.root_axes @ v[3:6]
        place = v[:3] + np.cross(omega, state.com - state.qpos[:3])
        work = wrench[:3] @ place + wrench[3:] @ omega
        assert torques @ v[6:] == pytest.approx(work, abs=1e-8)


def test_the_force_is_a_spring_and_a_damper():
    """At the references the virtual wrench is the weight; away from them it leads back."""
    controller, simulation = JacobianTranspose(robot()), generic_state()
    state, targets = simulation.state, Targets.standing(robot(), simulation.state)
    targets.com[:], targets.com_vel[:] = state.com, state.com_vel
    targets.root_axes[:], targets.root_vel[:] = state.root_axes, state.qvel[3:6]
    weight = np.r_[0.0, 0.0, robot().mass * controller.arrays.gravity, np.zeros(3)]
    np.testing.assert_allclose(controller.virtual_wrench(state, targets), weight, atol=1e-9)
    targets.com[0] += 0.01
    force = controller.virtual_wrench(state, targets) - weight
    omega2 = controller.arrays.gravity / robot().height_com
    assert force[0] == pytest.approx(0.01 * robot().mass * 4.0 * omega2, rel=1e-9)
    targets.com[0] -= 0.01
    turn = Rotation.from_rotvec([0.0, 0.1, 0.0]).as_matrix()
    targets.root_axes[:] = turn @ state.root_axes
    moment = controller.virtual_wrench(state, targets)[3:]
    assert moment[1] > 1.0 and np.abs(moment[[0, 2]]).max() < 0.5 * moment[1]
