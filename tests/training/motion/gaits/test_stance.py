"""training/motion/gaits/stance.py: which rows are a stance, and what is kept of it."""

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.training.motion.gaits.stance import Row, StanceRecord
from tests.support.shared import robot


def recorded(down, knees, force=None, height=None):
    """The stances of rows every 20 ms, after 0.1 s."""
    record = StanceRecord(robot())
    for k, each in enumerate(down):
        record._rows.append(
            Row(0.02 * k, np.array(each, dtype=bool), np.array(knees[k]),
                1.0 if force is None else force[k], 0.8 if height is None else height[k])
        )  # fmt: skip
    return record.stances(0.1)


def test_a_stance_is_from_touchdown_to_lift_off():
    """Whole ones alone: not the one that began before, nor the one that has not ended."""
    down = (
        [(1, 1)] * 10 + [(1, 0)] * 10 + [(1, 1)] * 5 + [(0, 1)] * 10 + [(1, 1)] * 5 + [(1, 0)] * 3
    )
    knees = [(0.0, 0.1 * k) for k in range(len(down))]
    height = [0.8 + 0.01 * (k % 2) for k in range(len(down))]
    force = [1.0 + 0.01 * k for k in range(len(down))]
    found = recorded(down, knees, force, height)
    assert found.knees.shape == (1, 51)  # the right foot's, rows 20 to 39
    assert found.knees[0, [0, -1]] == pytest.approx([2.0, 3.9])
    assert found.knees[0, 25] == pytest.approx(2.95)
    assert found.peaks == pytest.approx([1.39])
    assert found.height_amplitude == pytest.approx(0.005)


def test_a_touch_is_no_stance():
    down = [(1, 0)] * 10 + [(1, 1)] * 2 + [(1, 0)] * 10
    found = recorded(down, [(0.0, 1.0)] * len(down))
    assert found.knees.shape == (0, 51) and found.height_amplitude is None


def test_standing_with_bent_knees_extends_them():
    """The sign: a knee that bears a robot with bent knees is extended by its torque."""
    env = ResidualBalanceEnv(controller="momentum-qp", pushes=None, duration=1.0)
    env.reset(seed=0)
    record = StanceRecord(env.robot)
    for _ in range(20):
        env.step(np.zeros(len(env.action_names)))
        record(env)
    assert np.all(record._rows[-1].knees > 0.3)
    assert record._rows[-1].force == pytest.approx(1.0, abs=0.1)
