"""envs/sensing/friction.py: what sliding soles tell of the ground."""

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.sensing.config import EstimatorConfig
from poise.envs.sensing.friction import sliding_sole
from tests.support.shared import robot

PUSH = {"impulse": 20.0, "direction": 20.0, "start": 0.1, "body": "torso"}
SLIPPERY = {"ground": {"friction": 0.4}}


def after_a_push(level, push=PUSH, seed=3, **estimator):
    """The environment of steps after 1.5 s, in which it was pushed."""
    env = ResidualBalanceEnv(
        robot(), controller="feedback-step", realism=level, duration=1.5, pushes=None,
        estimator=EstimatorConfig(**estimator),
    )  # fmt: skip
    env.reset(seed=seed, options={"push": push})
    while env.episode.running:
        env.advance()
    return env


def believed(env):
    return env.state_source.state.friction


def test_what_slides_tells_the_friction():
    """With an exact state it is the ground's, 0.4 of which the model has 0.8, to a quarter."""
    told = [believed(after_a_push(SLIPPERY, seed=seed)) for seed in range(7)]
    assert np.median(told) == pytest.approx(0.5, rel=0.25)
    slid = [ratio for ratio in told if ratio < 1.0]  # else nothing was fast enough to tell
    assert len(slid) >= 6 and max(slid) < 0.7
    known = [believed(after_a_push({"ground": {"friction": 0.8}}, seed=k)) for k in range(5)]
    assert np.median(known) > 0.85


def test_who_knows_of_it_stands():
    """Of the same pushes 13 are survived where friction is learned, and 2 where it is not."""
    fallen = [[after_a_push(SLIPPERY, seed=k, slide_speed=v).fallen for k in range(16)]
              for v in (0.4, 0.0)]  # fmt: skip
    assert sum(fallen[0]) < 6 < 11 < sum(fallen[1])


def test_nothing_is_learned_before_a_sole_slides():
    """Unpushed, on ice, in `field`; and every episode begins with what the model has."""
    slippery = {"base": "field", **SLIPPERY}
    assert believed(after_a_push(slippery, push=[])) == 1.0
    env = after_a_push(SLIPPERY)
    assert believed(env) < 0.9
    env.reset(seed=3, options={"push": []})
    assert believed(env) == 1.0
    assert believed(after_a_push(SLIPPERY, slide_speed=0.0)) == 1.0


def test_a_sole_that_rolls_over_an_edge_does_not_slide():
    """The velocity at the CoP of the only sole counts; of two soles both must slide."""
    s = Simulation(robot()).state_arrays
    s.contacts[:] = 1.0, 0.0
    s.sole_point[0] = 0.3, 0.2, 0.05
    s.cop[:] = 0.4, 0.15  # 0.1 m ahead of the point, 0.05 m to the right
    s.J_v[:] = 0.0
    s.J_v[:3], s.J_v[5] = (-0.1, -0.2, 0.3), 2.0  # turns about a point near the CoP
    np.testing.assert_allclose(s.J_v[0] - 2.0 * (0.15 - 0.2), 0.0, atol=1e-12)
    assert sliding_sole(s, 0.05) == -1
    s.J_v[5] = 0.0
    assert sliding_sole(s, 0.2) == 0 and sliding_sole(s, 0.25) == -1
    s.contacts[1] = 1.0
    assert sliding_sole(s, 0.2) == -1
    s.J_v[6] = 0.3
    assert sliding_sole(s, 0.2) == 1
    s.contacts[:] = 0.0
    assert sliding_sole(s, 0.0) == -1
