"""training/benchmarking/suites/lasting.py and metrics/lasting.py: pushes that last, and gusts."""

import numpy as np
import pytest

from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import LimitTable
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.metrics.lasting import (
    gust_figures,
    survived,
    sustained_figures,
)
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.trial import Outcome, Trial


@pytest.fixture(scope="module")
def limits() -> PushLimits:
    return PushLimits(load_robot(), LimitTable((0.0,), (16.0,)))


def trials_of(name: str, limits: PushLimits, count: int) -> list[Trial]:
    return TrialPlan(load_suite(name).resized(count), limits, 5, ["a"]).first


def test_sustained_pushes_are_as_described(limits: PushLimits) -> None:
    """Of 0.8 to 4 s, of both profiles, in all directions, on torso, pelvis and both hands."""
    trials = trials_of("sustained", limits, 400)
    pushes = [trial.pushes[0] for trial in trials]
    assert all(len(trial.pushes) == 1 and not trial.commands for trial in trials)
    duration = np.array([push.duration for push in pushes])
    force = np.array([push.peak_force for push in pushes]) / limits.robot.mass
    assert 0.8 <= duration.min() < 0.85 and 3.95 < duration.max() <= 4.0
    assert 0.8 <= force.min() < 0.82 and 1.98 < force.max() <= 2.0
    assert {push.body for push in pushes} == {
        "torso", "pelvis", "left_lower_arm", "right_lower_arm"
    }  # fmt: skip
    assert np.histogram([p.direction for p in pushes], 4, (0, 360))[0].min() > 70
    assert {trial.level for trial in trials} == {"step", "half-sine"}
    for trial, push in zip(trials, pushes, strict=True):
        assert (trial.level == "step") == (push.profile == "square")
        assert push.start + push.duration < load_suite("sustained").duration - 2.0


def test_a_robot_without_known_arms_is_pushed_without_hands(limits: PushLimits) -> None:
    """The bodies are those of its description then."""
    other = PushLimits(load_robot("compact"))
    bodies = {trial.pushes[0].body for trial in trials_of("sustained", other, 60)}
    assert set(other.robot.description.push_bodies[:2]) <= bodies


def test_gusts_come_eight_at_a_time_from_one_side(limits: PushLimits) -> None:
    """0.1 s, 3.5 s apart, 0.75 to 1.3 of J50, within 20° of the trial's side."""
    for trial in trials_of("gusts", limits, 20):
        assert len(trial.pushes) == 8
        starts = [push.start for push in trial.pushes]
        np.testing.assert_allclose(np.diff(starts), 3.5)
        assert all(0.75 * 16 <= push.impulse <= 1.3 * 16 for push in trial.pushes)
        angles = np.radians([push.direction for push in trial.pushes])
        spread = np.degrees(np.abs(np.angle(np.exp(1j * (angles - angles[0])))))
        assert spread.max() <= 40.0
        assert load_suite("gusts").duration - starts[-1] > 4.0


def test_side_wind_is_for_controllers_that_walk(limits: PushLimits) -> None:
    """The suite walks; its pushes come from either side."""
    suite = load_suite("walk-wind")
    assert suite.walks and not load_suite("sustained").walks and not load_suite("gusts").walks
    trials = TrialPlan(suite, limits, 5, ["a"]).first
    directions = np.array([trial.pushes[0].direction for trial in trials])
    assert all(trial.commands for trial in trials)
    turned = np.abs((directions + 180.0) % 360.0 - 180.0)
    assert np.all((turned > 39.0) & (turned < 141.0))
    assert 0.3 < np.mean((directions % 360.0) < 180.0) < 0.7


def test_f50_is_the_force_that_half_of_the_trials_hold() -> None:
    """Of a controller that holds what is below 50 N, by both profiles."""
    played = []
    for k, force in enumerate(np.linspace(30.0, 70.0, 41)):
        push = Push("torso", 0.5, 2.0, 2.0 * float(force), 0.0)
        outcome = Outcome(recovered=bool(force < 45.0), fallen=bool(force > 50.0))
        level = "step" if k % 2 else "half-sine"
        played.append((Trial(k, k, (push,), level=level), outcome))
    every, *profiles = sustained_figures(played, 40.0)
    assert every["profile"] == "all" and {p["profile"] for p in profiles} == {"step", "half-sine"}
    for figures in (every, *profiles):
        assert figures["f50"] == pytest.approx(50.5, abs=1.1)
        low, high = figures["f50_ci95"]
        assert low is not None and high is not None and low <= figures["f50"] <= high
        assert figures["f50_per_mass"] == pytest.approx(figures["f50"] / 40.0)
        assert figures["f50_bound"] is None
    assert every["never_fell_rate"] == pytest.approx(21 / 41)
    assert every["recovered"] == 15


def test_pushes_survived_end_with_the_one_that_fells_the_robot() -> None:
    """A fall between the third and the fourth push is by the third."""
    pushes = tuple(Push("torso", 0.5 + 3.5 * k, 0.1, 10.0, 0.0) for k in range(4))
    trial = Trial(0, 0, pushes)
    assert survived(trial, Outcome(recovered=True, fallen=False)) == 4
    for time, count in ((0.9, 0), (4.1, 1), (8.0, 2), (12.0, 3)):
        assert survived(trial, Outcome(recovered=False, fallen=True, fall_time=time)) == count
    error = Outcome(recovered=False, fallen=False, error="ValueError: x")
    assert survived(trial, error) == 0
    fell = Outcome(recovered=False, fallen=True, fall_time=8.0)
    figures = gust_figures([(trial, fell), (trial, Outcome(recovered=True, fallen=False))])
    assert figures["survived_mean"] == 3.0 and figures["pushes"] == 4
    assert figures["first_survived"] == 2 and figures["never_fell_rate"] == 0.5
