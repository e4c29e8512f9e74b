"""What the soles press with, and points of the support polygon."""

import numpy as np
import pytest

from poise.baselines.balance.in_place.wrenches import MOMENT_LEVER, joint_torques, sole_wrenches
from poise.envs.compiled.maths.polygons import nearest_inside, shrunk
from poise.envs.compiled.maths.vectors import skew
from tests.support.shared import generic_state


def test_skew_is_the_cross_product():
    """skew(r) f = r × f."""
    r, f = np.array([0.3, -0.2, 0.9]), np.array([1.0, 2.0, -0.5])
    np.testing.assert_allclose(skew(r) @ f, np.cross(r, f), rtol=1e-14)


@pytest.mark.parametrize("name", ["humanoid", "tall"])
def test_wrenches_sum_to_what_is_asked(name):
    """Forces and moments about the CoM, in a generic state."""
    state = generic_state(name).state
    wrench = np.array([40.0, -30.0, 380.0, 5.0, -8.0, 2.0])
    w = sole_wrenches(state, wrench).reshape(-1, 6)
    np.testing.assert_allclose(w[:, :3].sum(axis=0), wrench[:3], rtol=1e-9)
    moment = sum(
        np.cross(r - state.com, f) + n
        for r, f, n in zip(state.sole_points, w[:, :3], w[:, 3:], strict=True)
    )
    np.testing.assert_allclose(moment, wrench[3:], atol=1e-9)


def test_wrenches_are_the_smallest():
    """Any other wrenches with the same sum cost more."""
    state, rng = generic_state().state, np.random.default_rng(0)
    wrench = np.array([10.0, 20.0, 400.0, 3.0, -2.0, 1.0])
    best = sole_wrenches(state, wrench)
    lever = MOMENT_LEVER * state.robot.height_com
    price = np.tile(np.r_[np.ones(3), np.full(3, 1.0 / lever**2)], 2)
    for _ in range(20):
        change = rng.normal(size=12)
        other = best + change
        sums = [
            sum(
                np.r_[f, np.cross(r - state.com, f) + n]
                for r, f, n in zip(
                    state.sole_points, w.reshape(2, 6)[:, :3], w.reshape(2, 6)[:, 3:], strict=True
                )
            )
            for w in (best, other)
        ]
        other = other + sole_wrenches(state, sums[0] - sums[1])  # back to the same sum
        assert price @ other**2 > price @ best**2


@pytest.mark.parametrize("name", ["humanoid", "tall"])
def test_holding_torques_hold(name):
    """With w of the wrench that v̇ = 0 needs, all rows of h = Sᵀτ + Jᵀw are met, the root's too."""
    state = generic_state(name).state
    w = sole_wrenches(state, state.A_bias)
    tau = joint_torques(state, w)
    forces = state.J.T @ w
    forces[6:] += tau
    np.testing.assert_allclose(forces, state.h, atol=1e-8)


def test_nearest_point_of_a_polygon():
    """Against a fine sampling of the boundary; a point inside stays."""
    polygon = np.array([[0.0, 0.0], [0.3, 0.05], [0.35, 0.3], [0.1, 0.4], [-0.1, 0.2]])
    share = np.linspace(0.0, 1.0, 4001)[:, None]
    rim = np.vstack(
        [a + share * (b - a) for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True)]
    )
    rng = np.random.default_rng(1)
    outside = 0
    for point in rng.uniform(-0.2, 0.5, (60, 2)):
        found = nearest_inside(polygon, point)
        edges = np.roll(polygon, -1, axis=0) - polygon
        away = point - polygon
        inside = np.all(edges[:, 0] * away[:, 1] - edges[:, 1] * away[:, 0] >= 0.0)
        if inside:
            np.testing.assert_array_equal(found, point)
        else:
            outside += 1
            distance = np.linalg.norm(rim - point, axis=1).min()
            assert np.linalg.norm(found - point) == pytest.approx(distance, abs=1e-6)
            assert np.linalg.norm(rim - found, axis=1).min() < 1e-3
    assert 20 < outside < 60


def test_shrunk_polygon():
    """Half the size has a quarter of the area, about the same middle."""
    polygon = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    np.testing.assert_allclose(
        shrunk(polygon, 0.5), [[0.5, 0.25], [1.5, 0.25], [1.5, 0.75], [0.5, 0.75]]
    )
