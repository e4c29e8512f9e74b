"""Terrain: where its surfaces are, as configuration says, as Python and as compiled code find."""

import numpy as np
import pytest

from poise.configs.schema import to_dict
from poise.envs.balance.config import EnvConfig, env_config
from poise.envs.terrain.arrays import ground_height, surface_arrays
from poise.envs.terrain.bumps import Bumps
from poise.envs.terrain.flat import Flat
from poise.envs.terrain.slope import Slope
from poise.envs.terrain.stairs import Stairs
from poise.envs.terrain.stones import Stones
from poise.envs.terrain.terrain import make_terrain, seeded
from tests.support.refused import invalid


def test_stairs_rise_by_one_step_at_every_edge():
    stairs = Stairs(count=3, rise=0.1, tread=0.3, start=0.5)
    for x, height in ((0.49, 0.0), (0.51, 0.1), (0.79, 0.1), (0.81, 0.2), (1.11, 0.3), (3.0, 0.3)):
        assert stairs.height(x, 0.0) == pytest.approx(height)
    assert stairs.floor() == 0.0


def test_stairs_down_lead_to_a_floor_below_the_start():
    stairs = Stairs(count=3, rise=0.1, tread=0.3, down=True)
    assert stairs.height(0.0, 0.0) == 0.0
    assert stairs.floor() == stairs.height(2.0, 0.0) == pytest.approx(-0.3)
    assert stairs.height(0.6, 5.0) == stairs.floor()  # beside them


def test_a_slope_rises_by_the_tangent_of_its_angle():
    slope = Slope(angle=-8.0, length=2.0, start=0.5)
    drop = np.tan(np.radians(8.0))
    assert slope.height(0.4, 0.0) == 0.0
    assert slope.height(1.5, 0.0) == pytest.approx(-drop)
    assert slope.height(3.0, 0.0) == slope.floor() == pytest.approx(-2.0 * drop)


def test_between_stones_is_the_floor():
    stones = Stones(count=4, length=0.3, gap=0.1, depth=0.2, start=0.5)
    assert stones.height(0.55, 0.0) == stones.floor() == pytest.approx(-0.2)
    assert stones.height(0.75, 0.0) == 0.0
    assert stones.height(0.95, 0.0) == stones.floor()


def test_errors_are_bounded_known_to_nobody_and_drawn_by_the_seed():
    stairs = Stairs(error=0.02, seed=5)
    true, known = stairs.surfaces(), stairs.assumed()
    errors = np.array([a.height - b.height for a, b in zip(true, known, strict=True)])
    assert known == Stairs().surfaces()
    assert errors[0] == 0.0 and 0.01 < np.abs(errors).max() <= 0.02
    assert stairs.surfaces() == true != seeded(stairs, 6).surfaces()
    assert Slope(unseen=True).assumed() == [] != Slope().assumed()


def test_bumps_lie_around_a_clear_start_and_nobody_knows_of_them():
    bumps = Bumps(count=50, side=0.1, radius=1.0, clear=0.4, lowest=0.005, highest=0.01, seed=2)
    rest = bumps.surfaces()[1:]
    assert len(rest) == 50 and bumps.assumed() == [] and bumps.floor() == 0.0
    assert all(0.005 <= s.height <= 0.01 and s.x_max - s.x_min == pytest.approx(0.1) for s in rest)
    nearest = [np.hypot(*(min(max(0.0, low), high) for low, high in
                          ((s.x_min, s.x_max), (s.y_min, s.y_max)))) for s in rest]  # fmt: skip
    assert min(nearest) >= 0.4
    assert rest != seeded(bumps, 3).surfaces()[1:]


@pytest.mark.parametrize(
    "terrain",
    [Stairs(down=True), Slope(), Stones(gap=0.05, spread=0.05), Bumps(seed=3), Flat()],
    ids=str,
)
def test_compiled_code_finds_the_same_heights(terrain):
    rows, floor = surface_arrays(terrain.surfaces()), terrain.floor()
    for x, y in np.random.default_rng(0).uniform([-3, -2], [8, 2], (200, 2)):
        assert ground_height(rows, floor, x, y) == pytest.approx(terrain.height(x, y), abs=1e-12)


def test_the_configuration_of_an_environment_takes_a_kind_or_a_mapping():
    assert env_config(None).terrain == Flat()
    assert env_config(None, terrain="stairs").terrain == Stairs()
    config = env_config({"terrain": {"kind": "slope", "angle": 5}})
    assert config.terrain == Slope(angle=5.0) == make_terrain({"kind": "slope", "angle": 5})
    assert "terrain" not in to_dict(EnvConfig())  # or fingerprints of policies would change
    assert env_config(to_dict(config)) == config


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("hills", ("terrain.kind", "'hills'", "stairs")),
        ({"kind": "stairs", "rise": -0.1}, ("terrain.rise", "above 0")),
        ({"kind": "stairs", "height": 0.1}, ("terrain.height", "rise")),
        (3, ("terrain", "3")),
    ],
)
def test_what_is_no_terrain_is_told_in_a_line(value, says):
    for take in (make_terrain, lambda terrain: env_config(None, terrain=terrain)):
        with invalid(*says):
            take(value)
