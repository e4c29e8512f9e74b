"""Principal components of postures: what they explain, what they cost."""

import numpy as np
import pytest

from poise.baselines.motion.retargeting.inverse_kinematics.prior import PosePrior
from poise.configs.errors import ConfigError

RNG = np.random.default_rng(0)


def sample(count: int = 4000) -> tuple[np.ndarray, np.ndarray]:
    """Postures of 6 joints with standard deviations 2, 1, 0.1 along three directions."""
    axes = np.linalg.qr(RNG.normal(size=(6, 6)))[0][:3]
    return RNG.normal(size=(count, 3)) * [2.0, 1.0, 0.1] @ axes + 3.0, axes


def test_components_are_those_that_made_the_postures() -> None:
    postures, axes = sample()
    prior = PosePrior.fit(postures, 0.999)
    assert np.abs(prior.components @ axes.T) == pytest.approx(np.eye(3), abs=0.05)
    assert prior.deviations == pytest.approx([2.0, 1.0, 0.1], rel=0.05)
    assert prior.mean == pytest.approx(postures.mean(axis=0))


def test_the_fewest_components_with_the_share_are_kept() -> None:
    """4/5.01 are 80 %, with the second 99.8 %."""
    postures, _ = sample()
    for share, count in ((0.5, 1), (0.9, 2), (0.9999, 3), (1.0, 3)):
        prior = PosePrior.fit(postures, share)
        assert len(prior.deviations) == count
        assert prior.explained >= share - 1e-9
        left = postures - prior.projected(postures)
        lost = (left**2).sum() / ((postures - prior.mean) ** 2).sum()
        assert lost == pytest.approx(1.0 - prior.explained, abs=1e-9)


def test_cost_is_the_squared_distance_in_deviations() -> None:
    postures, _ = sample()
    prior = PosePrior.fit(postures, rest=False)
    k = len(prior.deviations)
    assert prior.cost(prior.mean) == pytest.approx(0.0)
    steps = prior.mean + 3.0 * prior.deviations[:, None] * prior.components
    assert prior.cost(steps) == pytest.approx([9.0] * k)
    assert prior.cost(postures).mean() == pytest.approx(k, rel=1e-3)
    whitened = (postures - prior.mean) @ prior.whitening.T
    assert np.cov(whitened.T) == pytest.approx(np.eye(k), abs=1e-9)
    across = np.linalg.svd(prior.components)[2][k:]
    assert prior.cost(prior.mean + across) == pytest.approx(0.0, abs=1e-18)


def test_the_rest_costs_as_much_as_it_is_rare() -> None:
    """The whole is the normal distribution with the variance left shared by all that is left."""
    postures, _ = sample()
    postures = postures + 0.05 * RNG.normal(size=postures.shape)
    prior = PosePrior.fit(postures)
    k = len(prior.deviations)
    left = postures - prior.projected(postures)
    assert k == 2 and (left**2).sum(axis=1).mean() / 4 == pytest.approx(prior.rest**2, rel=1e-3)
    assert prior.cost(postures).mean() == pytest.approx(6.0, rel=1e-3)
    covariance = prior.components.T * prior.deviations**2 @ prior.components
    covariance += prior.rest**2 * (np.eye(6) - prior.components.T @ prior.components)
    posture = postures[0] - prior.mean
    assert prior.cost(postures[0]) == pytest.approx(posture @ np.linalg.solve(covariance, posture))


def test_fewer_postures_than_joints_are_enough() -> None:
    prior = PosePrior.fit(RNG.normal(size=(3, 20)), 1.0)
    assert len(prior.deviations) == 2 and prior.explained == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("postures", "variance", "field"),
    [
        (np.ones((1, 4)), 0.95, "postures"),
        (np.ones((5, 4)), 0.95, "postures"),
        (np.ones(4), 0.95, "postures"),
        (np.full((5, 4), np.inf), 0.95, "postures"),
        ("poses", 0.95, "postures"),
        (np.eye(4), 0.0, "variance"),
        (np.eye(4), 1.5, "variance"),
    ],
)
def test_errors_name_what_is_wrong(postures, variance, field) -> None:
    with pytest.raises(ConfigError) as caught:
        PosePrior.fit(postures, variance)
    assert caught.value.field == field
