"""Tuning: what a candidate is worth."""

import numpy as np
import pytest

from poise.baselines.registry import controller_config
from poise.baselines.residual_balance import ResidualBalanceEnv
from poise.envs.push_schedule import push_bodies
from poise.envs.pushes import Push
from poise.training import tuning

from .shared import robot


@pytest.fixture(scope="module")
def env():
    return ResidualBalanceEnv(robot(), duration=3.0, pushes=None)


def rows(*impulses):
    """One direction."""
    return [[Push("torso", 0.5, 0.1, impulse, 0.0) for impulse in impulses]]


def test_a_fall_is_worth_less_than_standing(env):
    """Both pushes recovered: the ladder's 10 and two steps of 2; a fall counts for part of one."""
    config = controller_config("momentum-qp")
    _, reached = tuning.score(env, config, rows(5.0, 8.0), seed=0)
    assert reached == [14.0]
    _, reached = tuning.score(env, config, rows(5.0, 40.0), seed=0)
    assert 12.0 < reached[0] < 12.6


def test_a_dragged_foot_is_no_recovery(env, monkeypatch):
    """Balance that moves the feet counts like one that does not come to rest."""
    monkeypatch.setattr(tuning, "STEP_LENGTH", 1e-6)
    _, reached = tuning.score(env, controller_config("momentum-qp"), rows(5.0), seed=0)
    assert reached == [10.0 + 0.6 * 2.0]


def test_pushes_fit_the_robot():
    """The ladder is the humanoid's own, but for the jitter; another robot's by m √(g h)."""
    pushes = tuning.TuningPushes()
    size, drawn = {}, {}
    for name in ("humanoid", "toddler"):
        r = robot(name)
        rows = pushes.draw(0, r)
        assert {push.body for row in rows for push in row} == {push_bodies(r)[0]}
        size[name] = r.mass * np.sqrt(-r.model.opt.gravity[2] * r.height_com)
        drawn[name] = np.array([[push.impulse for push in row] for row in rows])
    gap = pushes.impulses[1] - pushes.impulses[0]
    assert np.all(np.abs(drawn["humanoid"] - pushes.impulses) <= 0.51 * gap)
    ratio = size["toddler"] / size["humanoid"]
    assert np.allclose(drawn["toddler"], ratio * drawn["humanoid"], rtol=1e-12)


def test_the_candidates_offset_counts(env):
    """Tuning changes the controller of an environment that is already made."""
    config = controller_config("momentum-qp")
    gains = [gain for gain in tuning.GAINS if gain.path == "com.offset"]
    moved = tuning.set_gains(config, gains, [1.0])
    tuning.score(env, moved, rows(1.0), seed=0)
    forward = float(env.targets.com[0])
    tuning.score(env, config, rows(1.0), seed=0)
    expected = (gains[0].high - config.com.offset) * robot().height_com
    assert forward - float(env.targets.com[0]) == pytest.approx(expected, abs=5e-3)
