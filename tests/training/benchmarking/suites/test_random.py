"""Several pushes in a trial: benchmarking/suites/random.py and benchmarking/trials."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import LimitTable, PushSampler
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.diagnosis.record import swing_of
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.random import PushSequence
from poise.training.benchmarking.suites.suite import Suite, load_suite
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.play import TouchdownCounter, run_trial
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.table import read_trial, trial_row
from poise.training.benchmarking.trials.trial import Trial
from tests.support.evaluations import write_suite


@pytest.fixture(scope="module")
def limits() -> PushLimits:
    return PushLimits(load_robot(), LimitTable((0.0,), (16.0,)))


def drawn(suite: Suite, limits: PushLimits) -> list[Trial]:
    return TrialPlan(suite, limits, 3, ["a"]).first


def test_repeated_pushes_come_every_two_to_five_seconds_for_a_minute(limits: PushLimits) -> None:
    """All alike but for time and direction, which are random; none begins after a minute."""
    trials = drawn(load_suite("repeated").resized(20), limits)
    directions = []
    for trial in trials:
        pushes = trial.pushes
        starts = np.array([push.start for push in pushes])
        gaps = np.diff(starts) - pushes[0].duration
        assert gaps.min() >= 2.0 and gaps.max() <= 5.0
        assert starts[0] == 0.5 and starts[-1] < 60.0 < starts[-1] + 5.2
        assert {push.body for push in pushes} == {"torso"}
        specific = [push.impulse / limits.robot.mass for push in pushes]
        assert specific == pytest.approx([0.35] * len(pushes))
        directions += [push.direction for push in pushes]
    assert np.histogram(directions, 4, (0, 360))[0].min() > 60


def test_the_second_push_of_in_step_is_the_smaller_one(limits: PushLimits) -> None:
    """It begins 0.15 to 0.4 s after the end of the first, in a direction of its own."""
    trials = drawn(load_suite("in-step").resized(50), limits)
    shares = []
    for trial in trials:
        first, second = trial.pushes
        assert 0.15 <= second.start - first.start - first.duration <= 0.4
        assert trial.limit_fraction is None
        assert 16.0 <= first.impulse <= 1.4 * 16.0 and first.direction != second.direction
        shares.append(second.impulse / 16.0)
    assert 0.2 <= min(shares) < 0.5 and 0.6 < max(shares) <= 0.6 * 1.4


def test_a_share_of_a_controllers_own_limits(limits: PushLimits) -> None:
    """controller_fraction is one of the table given, which may be any controller's."""
    pushes = PushSampler(magnitude=(0.5, 0.5), unit="controller_fraction", count=(2, 2))
    trials = drawn(Suite(sequence=PushSequence(trials=2, pushes=pushes)), limits)
    assert [push.impulse for t in trials for push in t.pushes] == [8.0] * 4


def test_without_a_measured_j50_the_ankle_limit_counts(limits: PushLimits) -> None:
    """The pushes of a sequence are the same but for their size, a share of what ankles hold."""
    bare = PushLimits(limits.robot)
    for known, trial in zip(
        drawn(load_suite("in-step").resized(20), limits),
        drawn(load_suite("in-step").resized(20), bare),
        strict=True,
    ):
        first = trial.pushes[0]
        assert 1.0 <= bare.fraction(first) <= 1.4
        assert first.direction == known.pushes[0].direction
        assert bare.fraction(first) == pytest.approx(limits.fraction(known.pushes[0]))


def test_later_pushes_are_played(limits: PushLimits) -> None:
    """A huge second push makes a fall, after it."""
    agent = load_agent("momentum-qp", limits.robot, duration=2.0, pushes=None)
    push = Push("torso", 0.2, 0.1, 1.0, 0.0)
    alone = run_trial(agent, Trial(0, 1, (push,)))
    assert alone.recovered and alone.steps == 0
    then = run_trial(agent, Trial(0, 1, (push, Push("torso", 1.0, 0.1, 90.0, 0.0))))
    assert then.fallen and then.fall_time is not None and then.fall_time > 1.0


def test_a_line_of_trials_csv_holds_all_pushes(limits: PushLimits, tmp_path: Path) -> None:
    """What is read back for a replay is the trial, exactly."""
    trial = drawn(load_suite("repeated").resized(1), limits)[0]
    agent = load_agent("momentum-qp", limits.robot, duration=1.1, pushes=None)
    line = trial_row(trial, "momentum-qp", run_trial(agent, trial))
    assert len(json.loads(line["later"])) == len(trial.pushes) - 1
    text = {key: "" if value is None else str(value) for key, value in line.items()}
    assert read_trial(text, tmp_path) == trial
    for name in ("stage", "delay", "elevation", "profile"):  # a damaged file is another trial
        with pytest.raises(ConfigError, match=f"trial 0 does not parse: {name} is empty"):
            read_trial({**text, name: ""}, tmp_path)


def test_touchdowns_count_feet_that_were_in_the_air() -> None:
    """A foot that rocks for 60 ms has not stepped; one that is up for 80 ms has, when it lands."""
    touchdowns = TouchdownCounter(2, 0.02)
    for up in (3, 4, 10):
        for contacts in [[0.0, 1.0]] * up + [[1.0, 1.0]]:
            touchdowns.update(np.array(contacts))
    assert touchdowns.count == 2
    for _ in range(50):
        touchdowns.update(np.zeros(2))
    assert touchdowns.count == 2  # not landed
    touchdowns.update(np.ones(2))
    assert touchdowns.count == 4


def test_steps_are_those_that_were_planned() -> None:
    """Of a controller with a plan: the foot that it swung; a foot that is thrown up is none."""
    touchdowns = TouchdownCounter(2, 0.02)
    for swinging, count in ((-1, 0), (1, 0), (0, 1), (0, 2)):
        for _ in range(5):
            touchdowns.update(np.array([0.0, 1.0]), swinging)
        touchdowns.update(np.ones(2), -1)  # it has landed, and swings no more
        assert touchdowns.count == count


@pytest.mark.parametrize(
    ("name", "swings"), [("momentum-qp", -1), ("feedback-step", -1), ("zero", None)]
)
def test_whose_plan_is_seen(name: str, swings: int | None) -> None:
    """Feet that stay swing never, those of a planner when it says so; without one nobody knows."""
    env = load_agent(name, load_robot("humanoid"), duration=0.1, pushes=None).env
    env.reset(seed=0)
    assert swing_of(env) == swings


def test_feet_that_stay_take_no_step(limits: PushLimits) -> None:
    """However they tilt and lift while the robot falls."""
    agent = load_agent("momentum-qp", limits.robot, duration=2.5, pushes=None)
    push = Push("torso", 0.2, 0.1, 32.0, 180.0)
    outcome = run_trial(agent, Trial(0, 1, (push,)))
    assert outcome.fallen and outcome.steps == 0


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"pushes": {"magnitude": [1, 1], "unit": "impulse"}}, "at least two"),
        ({"pushes": {"magnitude": [1, 1], "unit": "delta_v", "count": [2, 2]}}, "forces"),
        ({"later": [0.5, 0.2]}, "later"),
        ({"trials": 0}, "trials.*at least 1"),
    ],
)
def test_a_wrong_sequence_is_refused(tmp_path: Path, fields: dict, message: str) -> None:
    """The text names the field."""
    path = write_suite(tmp_path, {"sequence": fields})
    with pytest.raises(ConfigError, match=message):
        load_suite(path)
    assert build(Suite, {"sequence": {}}, "") == Suite(sequence=PushSequence())
