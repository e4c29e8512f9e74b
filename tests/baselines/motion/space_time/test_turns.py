"""baselines/motion/space_time/turns.py: steps around one that turns too far turn more."""

import numpy as np
import pytest

from poise.baselines.motion.space_time.turns import spread_rates, spread_turns

MOST = np.full(6, 0.45)


def test_steps_within_the_limit_turn_as_they_did() -> None:
    each = [(0.5 * k, 0.5 * k + 0.5, 0.5) for k in range(6)]
    rates, going = 2.0 * np.array([0.1, -0.4, 0.45, 0.0, 0.2, -0.45]), np.full(6, 2.0)
    np.testing.assert_array_equal(spread_rates(each, rates, going, 2.78), rates)


def test_a_step_that_turns_too_far_leaves_it_to_those_around() -> None:
    """Within what bends allow; the whole turn is the same to 3°. Alone it keeps its turn."""
    each = [(0.5 * k, 0.5 * k + 0.5, 0.5) for k in range(6)]
    rates, going = 2.0 * np.array([0.0, 0.0, 0.8, 0.0, 0.0, 0.0]), np.full(6, 0.8)
    spread = spread_rates(each, rates, going, 2.78)
    assert 0.5 * np.abs(spread).max() <= 0.065 * 2.78 / (0.7 * 0.8) + 1e-9
    assert abs(0.5 * np.sum(spread - rates)) < np.radians(3.0)
    np.testing.assert_array_equal(spread_rates(each[2:3], rates[2:3], going[2:3], 2.78), rates[2:3])


@pytest.mark.parametrize("seed", range(3))
def test_headings_are_the_nearest_within_the_limit(seed: int) -> None:
    """The conditions of an optimum: its slope is zero, or leads beyond the limit."""
    angles = np.random.default_rng(seed).uniform(-0.7, 0.9, 6)
    angles *= min(1.0, 0.8 * MOST.sum() / abs(angles.sum()))
    angles[2] = 0.8 * np.sign(angles[2])
    most = MOST * np.linspace(0.8, 1.2, 6)
    spread = spread_turns(angles, most)
    assert spread is not None and (np.abs(spread) <= most + 1e-9).all()
    weights = np.array([1.0, 1.0, 1.0, 1.0, 1.0, 100.0])
    slope = np.cumsum((weights * np.cumsum(spread - angles))[::-1])[::-1]
    inner = np.abs(spread) < most - 1e-6
    np.testing.assert_allclose(slope[inner], 0.0, atol=1e-6)
    assert not inner.all() and (slope[~inner] * np.sign(spread[~inner]) <= 1e-6).all()


def test_a_turn_beyond_all_steps_is_none() -> None:
    assert spread_turns(np.full(6, 0.6), MOST) is None
