"""The planner of steps against its readable form, at generic points."""

import numpy as np
import pytest

from poise.baselines.balance.stepping.planning.config import (
    FallFeedback,
    FootholdChoice,
    SignalGains,
    StepFeedback,
    StepLimits,
    SwingTask,
)
from poise.baselines.balance.stepping.planning.swing import swing_at
from tests.support import planned
from tests.support.shared import generic_state, robot
from tests.support.stepping_reference import ReadablePlanner

FEEDBACK = StepFeedback(
    ahead=SignalGains(-0.03, 0.02, -0.01, -0.06, -0.2, 0.1, -0.05, 0.3, 0.2),
    outward=SignalGains(0.02, -0.01, 0.03, 0.05, 0.04, -0.06, 0.07, -0.2, 0.1),
    time=SignalGains(-0.05, 0.04, -0.1, 0.06, -0.08, 0.3, 0.2, 0.9, 0.5),
)
FALLS = {
    "back": FallFeedback(angle=150.0, ahead=SignalGains(0.1, lean_ahead=0.3)),
    "ahead": FallFeedback(angle=20.0, outward=SignalGains(-0.1, momentum_ahead=0.4)),
    "side": FallFeedback(angle=80.0, time=SignalGains(0.3, phase=0.2, capture_outward=-0.3)),
}
CHOICE = FootholdChoice(sagittal_offset=0.07, lateral_offset=0.05, margin=0.03, time_price=0.02)


def planner(feedback=None, falls=None, **limits):
    """A planner whose step times cost something."""
    return planned.Planner(robot(), StepLimits(**limits), CHOICE, feedback, falls)


def falling(seed):
    """A generic state, its capture point up to 0.4 m away; and a heading near its own."""
    state, rng = generic_state(seed=seed).state.copy(), np.random.default_rng(seed)
    state.arrays.capture_point[:] = state.origin[:2] + rng.uniform(-0.4, 0.4, 2)
    state.arrays.omega = rng.uniform(3.0, 4.0)
    return state, state.heading_yaw + rng.uniform(-0.2, 0.2), rng


def agree(plan, expected):
    """All of two plans, to 1e-9."""
    assert plan.foot == expected.foot
    np.testing.assert_allclose(plan.foothold, expected.foothold, atol=1e-9)
    numbers = [[p.time, p.cost, p.time_offset] for p in (plan, expected)]
    np.testing.assert_allclose(*numbers, atol=1e-9)


@pytest.mark.parametrize("falls", [None, FALLS])
@pytest.mark.parametrize("feedback", [None, FEEDBACK])
@pytest.mark.parametrize("offset", [0.0, 0.06])
def test_plan_is_that_of_the_readable_planner(offset, feedback, falls):
    """Foot, foothold, time and cost, also where feedback and a policy move both."""
    plans, feet = planner(feedback, falls), set()
    plans.offsets.foothold[:] = [0.3 * offset, -0.5 * offset]
    plans.offsets.time = offset
    readable = ReadablePlanner(plans)
    for seed in range(12):
        state, yaw, _ = falling(seed)
        plans.feedback.signals.later_step = seed % 3 == 0  # the law of first steps is another one
        plan = planned.plan(plans, state, yaw)
        agree(plan, readable.plan(state, yaw))
        feet.add(plan.foot)
    assert feet == {0, 1}


@pytest.mark.parametrize("feedback", [None, FEEDBACK])
@pytest.mark.parametrize("offset", [0.0, -0.05])
def test_a_running_step_is_planned_as_by_the_readable_planner(offset, feedback):
    """From where the foot is in its swing, with the time that is left."""
    plans = planner(feedback)
    plans.offsets.time = offset
    readable = ReadablePlanner(plans)
    for seed in range(8):
        state, yaw, rng = falling(seed)
        foot = seed % 2
        swing = swing_at(state.sole_points[foot], 0.35, SwingTask(), robot().units)
        swing.time_offset = offset
        planned.aim(swing, state.sole_points[foot, :2] + rng.uniform(-0.2, 0.2, 2))
        for _ in range(rng.integers(1, 60)):
            planned.advance(swing, 0.004)
        agree(
            planned.replan(plans, state, foot, yaw, swing), readable.replan(state, foot, yaw, swing)
        )


def test_footholds_are_those_of_the_readable_planner_at_all_limits():
    """With limits that bind and limits that do not."""
    times = np.array([0.2, 0.3, 0.45])
    for limits in ({}, {"speed": 0.2}, {"ahead": 0.05, "behind": 0.05, "width_max": 0.2}):
        plans = planner(**limits)
        readable = ReadablePlanner(plans)
        for seed in range(4):
            state, yaw, _ = falling(seed)
            foot, start = seed % 2, state.sole_points[seed % 2, :2]
            footholds, left = planned.footholds(plans, state, foot, yaw, times, start)
            for k, time in enumerate(times):
                foothold, outside = readable.foothold(state, foot, yaw, time, start)
                np.testing.assert_allclose(footholds[k], foothold, atol=1e-9)
                assert left[k] == pytest.approx(outside, abs=1e-9)
