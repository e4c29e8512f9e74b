"""The second-order pendulum: the flexion that frees the knee, and how it is followed."""

import numpy as np
import pytest
from scipy.linalg import solve_continuous_are

from poise.baselines.walking.config import GaitConfig
from poise.baselines.walking.models.double import Double, follow_flexion, free_flexion
from poise.baselines.walking.models.reference import RowWeights
from poise.configs.schema import build
from tests.support.refused import invalid

from .test_rigid import answered

THIGH, SHANK = 0.38, 0.33


@pytest.mark.parametrize("x, cop", [(0.05, 0.09), (-0.1, 0.02), (0.12, 0.13)])
def test_with_the_free_flexion_the_force_passes_through_the_knee(x, cop):
    """From the CoP to the hip is the line of the force: the knee of the leg lies on it.

    The hip's height is that of the leg with that flexion, so that it is found by iterating.
    """
    z = 0.7
    for _ in range(200):
        beta = free_flexion(THIGH, SHANK, x, z, cop)
        phi = np.arctan2(x - cop, z)
        z = SHANK * np.cos(beta + phi) + THIGH * np.cos(phi)
    knee = np.array([SHANK * np.sin(beta + phi), SHANK * np.cos(beta + phi)])
    assert knee + THIGH * np.array([np.sin(phi), np.cos(phi)]) == pytest.approx([x, z])
    force = np.array([x - cop, z])
    moment = (knee[0] - cop) * force[1] - knee[1] * force[0]
    on_line = np.array([x, z]) - knee
    assert np.cross(np.append(on_line, 0.0), np.append(force, 0.0))[2] == pytest.approx(0, abs=1e-9)
    assert abs(moment) / np.linalg.norm(force) < abs(cop) + 1e-9


def test_the_law_is_the_linear_quadratic_one():
    """β̈ of the law is that of the Riccati equation of ∫ (β − β*)² + w β̈² dt."""
    rate = 17.0
    weight = rate**-4
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    S = solve_continuous_are(A, B, np.diag([1.0, 0.0]), np.array([[weight]]))
    gains = (B.T @ S / weight).ravel()
    now = np.array([0.3, -1.2, 0.0])
    follow_flexion(now, 0.1, rate, 0.0)
    assert now[2] == pytest.approx(-gains @ [0.3 - 0.1, -1.2], rel=1e-9)


def test_following_is_exact_for_any_step():
    """Ten short steps end where a long one does, and rates are those of the path."""
    long, short = np.array([0.3, -1.2, 0.0]), np.array([0.3, -1.2, 0.0])
    follow_flexion(long, 0.1, 17.0, 0.1)
    for _ in range(10):
        follow_flexion(short, 0.1, 17.0, 0.01)
    np.testing.assert_allclose(short, long, atol=1e-12)
    beside = [np.array([0.3, -1.2, 0.0]) for _ in range(2)]
    for now, t in zip(beside, (0.1 - 1e-5, 0.1 + 1e-5), strict=True):
        follow_flexion(now, 0.1, 17.0, t)
    for k in (1, 2):
        slope = (beside[1][k - 1] - beside[0][k - 1]) / 2e-5
        assert slope == pytest.approx(long[k], rel=1e-5)


def test_flexion_stays_within_its_limits():
    """In the first tick it begins at the measured flexion, within the limits."""
    r = answered(
        Double(least_flexion=60.0, most_flexion=61.0, rows=RowWeights(knee=2.0)), (0, 1.0, np.inf)
    )
    to_hip = r.legs.hip[0] - r.legs.ankle[0]
    to_hip[2] += r.height[0]
    shortest, longest = (
        np.sqrt(r.legs.thigh**2 + r.legs.shank**2
                + 2 * r.legs.thigh * r.legs.shank * np.cos(np.radians(b))) for b in (61.0, 60.0)
    )  # fmt: skip
    assert shortest - 1e-9 <= np.linalg.norm(to_hip) <= longest + 1e-9
    assert r.knee[0, 1] > 0.0 and r.knee[1, 1] == 0.0


def test_a_model_is_chosen_by_its_kind():
    config = build(GaitConfig, {"model": {"kind": "double", "least_flexion": 4.0}}, "walk")
    assert config.model == Double(least_flexion=4.0)
    with invalid("model.kind", "'triple'", "double", "lip"):
        build(GaitConfig, {"model": {"kind": "triple"}}, "walk")
    with invalid("model", "30"):
        build(GaitConfig, {"model": {"kind": "double", "least_flexion": 30.0}}, "walk")
