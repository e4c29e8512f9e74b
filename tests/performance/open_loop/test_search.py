"""Both searches: better than nothing, within their budget, the same for a seed."""

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.robots.robot import load_robot
from tests.performance.open_loop.plant import Plant
from tests.performance.open_loop.search import replay, samcon, search_whole
from tests.performance.open_loop.test_plant import short_plant

BUDGET = 7.0  # [s], ten times the motion


@pytest.fixture(scope="module")
def plant() -> Plant:
    return short_plant(load_robot())


def test_samcon_is_better_than_no_offsets_and_its_offsets_replay(plant: Plant) -> None:
    """At the same simulated time it is better than a search of the whole, too."""
    still = replay(plant, np.zeros((plant.windows, plant.size)))
    found = samcon(plant, BUDGET)
    assert found.error < 0.8 * still.error and found.upright == pytest.approx(0.7)
    assert replay(plant, found.offsets)[1:3] == found[1:3]
    assert found.simulated == pytest.approx(BUDGET)
    whole = search_whole(plant, BUDGET)
    assert found.error < whole.error <= still.error
    assert BUDGET <= whole.simulated <= BUDGET + 0.7 + 1e-9
    assert replay(plant, whole.offsets)[1:3] == whole[1:3]


def test_the_first_window_is_the_best_of_its_samples(plant: Plant) -> None:
    """One window alone: the saved path is that of the least error of what was drawn."""
    one = short_plant(plant.robot)
    one.windows = 1
    found, rng, errors = samcon(one, 2.0, seed=3), np.random.default_rng(3), []
    for k in range(20):
        offset = 0.06 * rng.normal(size=one.size) if k else np.zeros(one.size)
        errors.append(one.play(one.start(), 0, offset).error)
    assert found.error == min(errors)


def test_a_seed_gives_the_same_bits(plant: Plant) -> None:
    for search in (samcon, search_whole):
        first, again, other = (search(plant, 3.0, seed) for seed in (1, 1, 2))
        assert np.array_equal(first.offsets, again.offsets) and first[1:3] == again[1:3]
        assert search is search_whole or not np.array_equal(first.offsets, other.offsets)


@pytest.mark.parametrize(("search", "budget"), [(samcon, 0.0), (samcon, 1.3), (search_whole, -1.0)])
def test_budgets_that_pay_for_nothing_are_errors(plant: Plant, search, budget) -> None:
    with pytest.raises(ConfigError, match="budget"):
        search(plant, budget)
