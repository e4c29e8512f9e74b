"""Accelerations that leave the soles where they are, from random Jacobians."""

import numpy as np
import pytest

from poise.baselines.solvers.null_space import allocate_null_space, short_legs, solve_resting
from poise.envs.physics.arrays import robot_arrays, sole_chains
from tests.support.physics import robot_named


def solved(J, rhs, space):
    """v̇₀ (nv,) and the null space (nv, nz) that the kernel finds."""
    nv = J.shape[1]
    vdot0, V = np.full(nv, np.nan), np.full((nv, nv), np.nan)
    solve_resting(J, rhs, space, vdot0, V)
    nz = nv - len(space.beta) + space.spare
    assert not V[:, nz:].any()
    return vdot0, V[:, :nz]


def random_jacobian(rng, space):
    """(12, 27), zero for the joints that move no sole."""
    J = np.zeros((12, len(space.held) + len(space.free)))
    J[:, space.held] = rng.normal(size=(12, len(space.held)))
    return J


def scratch(name: str, soles: int = 2):
    """Scratch for a robot, with these of its soles alone."""
    arrays = robot_arrays(robot_named(name))
    return allocate_null_space(len(arrays.q_standing) + 6, sole_chains(arrays)[:soles])


def test_least_solution_and_orthonormal_null_space():
    """J v̇₀ = rhs, J V = 0, VᵀV = 1, and v̇₀ is the least of all solutions."""
    space = scratch("humanoid")
    rng = np.random.default_rng(0)
    for _ in range(20):
        J, rhs = random_jacobian(rng, space), rng.normal(size=12)
        vdot0, V = solved(J, rhs, space)
        np.testing.assert_allclose(J @ vdot0, rhs, atol=1e-10)
        np.testing.assert_allclose(J @ V, 0.0, atol=1e-12)
        np.testing.assert_allclose(V.T @ V, np.eye(V.shape[1]), atol=1e-12)
        np.testing.assert_allclose(vdot0, np.linalg.lstsq(J, rhs, rcond=None)[0], atol=1e-9)


def test_rows_that_follow_from_others_are_dropped():
    """A row that is another's multiple asks for nothing more: the others are met, V stays in J's
    null space."""
    space = scratch("humanoid")
    rng = np.random.default_rng(1)
    for _ in range(20):
        J, rhs = random_jacobian(rng, space), rng.normal(size=12)
        J[7], rhs[7] = -0.5 * J[2], -0.5 * rhs[2]
        vdot0, V = solved(J, rhs, space)
        np.testing.assert_allclose(J @ vdot0, rhs, atol=1e-9)
        np.testing.assert_allclose(J @ V, 0.0, atol=1e-12)


def test_joints_that_move_no_sole_are_free():
    """An arm's acceleration is one column of V by itself, and no part of v̇₀."""
    space = scratch("humanoid")
    rng = np.random.default_rng(2)
    vdot0, V = solved(random_jacobian(rng, space), rng.normal(size=12), space)
    nf = len(space.free)
    assert (
        nf == 6 and not vdot0[space.free].any()
    )  # the trunk of this robot lies in the legs' chain
    np.testing.assert_array_equal(V[space.free, -nf:], np.eye(nf))
    assert not V[space.free, :-nf].any() and not V[space.held, -nf:].any()


def test_a_robot_of_one_sole_has_more_null_vectors_than_rows():
    """The scratch is wide enough for both; the same equations hold."""
    space = scratch("humanoid", soles=1)
    rng = np.random.default_rng(3)
    J, rhs = random_jacobian(rng, space)[:6].copy(), rng.normal(size=6)
    vdot0, V = solved(J, rhs, space)
    assert space.basis.shape[1] > space.rows.shape[1]
    assert len(space.product) >= space.basis.shape[1]
    np.testing.assert_allclose(J @ vdot0, rhs, atol=1e-10)
    np.testing.assert_allclose(J @ V, 0.0, atol=1e-12)


def test_on_short_legs_the_weakest_row_is_left_out():
    """Five joints a leg: v̇₀ and V keep all rows but one, which the first column alone moves; with
    that of `weakest` it is met too, and the solution is the whole one."""
    space = scratch("toddler")
    rng = np.random.default_rng(4)
    for _ in range(20):
        J, rhs = random_jacobian(rng, space), rng.normal(size=12)
        vdot0, V = solved(J, rhs, space)
        others, weak = space.pivot[:-1], space.pivot[-1]
        np.testing.assert_allclose(J[others] @ vdot0, rhs[others], atol=1e-10)
        np.testing.assert_allclose(J[others] @ V, 0.0, atol=1e-12)
        np.testing.assert_allclose(J[weak] @ V[:, 1:], 0.0, atol=1e-12)
        np.testing.assert_allclose(V.T @ V, np.eye(V.shape[1]), atol=1e-12)
        pivot, rest = space.weakest
        np.testing.assert_allclose(J @ (vdot0 + V[:, 0] * rest / pivot), rhs, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "short"), [("humanoid", False), ("tall", False), ("compact", False), ("toddler", True)]
)
def test_short_legs(name, short):
    """Only the toddler's ankles have one axis; one leg alone is no closed chain."""
    arrays = robot_arrays(robot_named(name))
    chains = sole_chains(arrays)
    assert short_legs(chains) == short
    assert not short_legs(chains[:1])
