"""training/step_limits.py, and where it is drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.capturability import drifted
from poise.baselines.step_plan import StepLimits
from poise.envs.pushes import duration_factor
from poise.training.limits import PushLimits
from poise.training.report import _step_limits
from poise.training.step_limits import NStepLimit

from .shared import robot
from .test_evaluation_folder import OUTCOME


@pytest.fixture(scope="module")
def limit() -> NStepLimit:
    return NStepLimit(PushLimits(robot()))


def test_a_push_at_the_limit_is_stopped_by_that_many_steps(limit: NStepLimit) -> None:
    """The capture point after the push, step after step, ends at the edge of the last foot's
    reach: the recursion that d_N solves."""
    omega, mass, time = limit.limits.omega, robot().mass, limit.steps.time_min / limit.limits.omega
    for direction in (0.0, 70.0, 180.0):
        r, length = limit.reach(direction), limit.length(direction)
        for count in (0, 1, 3):
            J = limit(direction, 1e-9, count)  # a kick
            xi, foot = J / mass / omega, 0.0
            for _ in range(count):
                xi = float(drifted(np.array([xi]), np.array([foot + r]), omega, time)[0])
                foot += length
            assert xi - foot == pytest.approx(r, abs=1e-6)
        longer = duration_factor(omega, 0.1)
        assert limit(direction, 0.1, 1) == pytest.approx(limit(direction, 1e-9, 1) * longer)


def test_reach_is_that_of_the_ankles_not_of_the_soles(limit: NStepLimit) -> None:
    """Forward 20 N·m of each ankle hold less than the toes allow; more steps stop more."""
    assert 0.05 < limit.reach(0.0) < limit.limits.margin(0.0)
    assert limit.reach(90.0) > limit.reach(0.0)  # the feet stand apart
    for direction in range(0, 360, 45):
        stopped = [limit(direction, 0.1, count) for count in range(4)]
        assert np.all(np.diff(stopped) > 0.0)


def test_length_is_within_the_box_and_the_speeds(limit: NStepLimit) -> None:
    """A box alone, or a speed alone, gives its own bound."""
    h = robot().height_com
    wide = StepLimits(speed=99.0, side_speed=99.0, ahead=0.5, behind=0.3, width_max=0.4)
    box = NStepLimit(limit.limits, wide)
    found = [box.length(angle) / h for angle in (0.0, 180.0, 90.0)]
    assert found == pytest.approx([0.5, 0.3, 0.4])
    slow = StepLimits(speed=0.2, side_speed=0.1, time_min=1.0)
    assert NStepLimit(limit.limits, slow).length(0.0) / h == pytest.approx(0.2)
    assert NStepLimit(limit.limits, slow).length(90.0) / h == pytest.approx(0.1)


def test_only_controllers_that_step_bring_the_limits_into_the_plot(limit: NStepLimit) -> None:
    """One step in twenty recoveries is none; one in two is."""
    fine = np.array([0.0, 90.0])
    for stepping, names in ((1, set()), (10, {"one-step limit", "two-step limit"})):
        results = [replace(OUTCOME, steps=int(k < stepping)) for k in range(20)]
        assert set(_step_limits({"a": results}, limit.limits, fine, 0.1)) == names
