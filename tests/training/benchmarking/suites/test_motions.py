"""Motions of a suite: which trials there are, and what each of them depends on."""

from dataclasses import replace

import pytest

from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.physics.pushes.sampler import LimitTable
from poise.training.benchmarking.suites.draw import Draw
from poise.training.benchmarking.suites.motions import PART, STANDING, MotionTrials
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import Suite, load_suite
from poise.training.benchmarking.trials.push_limits import PushLimits, load_limits
from poise.training.benchmarking.trials.trial import Outcome, Trial
from tests.support.physics import robot_named

DURATIONS = {STANDING: 1.0, "bow": 4.0, "squat": 8.0}
PARTS = MotionTrials(("bow", "squat"), directions=3, shares=(0.0, 0.5, 1.0), trials=2)


@pytest.fixture(scope="module")
def limits() -> PushLimits:
    return load_limits(robot_named("humanoid"))


def cell(trial: Trial) -> tuple[object, ...]:
    """What is the same for all shares and controllers."""
    assert trial.push is not None
    return trial.motion, trial.push.direction, trial.push.start, trial.seed


def test_every_motion_meets_every_share_from_every_direction(limits: PushLimits) -> None:
    draw = Draw(Suite(motions=PARTS), limits, 4, DURATIONS)
    first = PARTS.first(draw, 0)
    assert {trial.part for trial in first} == {trial.motion for trial in first} == {STANDING}
    assert len(first) == 3 * 16
    number = len(first)
    recovered = {"pd": [trial.pushes[0].impulse < 10.0 for trial in first]}
    trials = PARTS.second(draw, number, first, recovered)["pd"]
    assert len(trials) == PARTS.second_count(1) == 2 * 3 * 3 * 2
    assert [trial.number for trial in trials] == list(range(number, number + len(trials)))
    still = [trial for trial in trials if trial.share == 0.0]
    assert all(not trial.pushes for trial in still) and len(still) == 12
    half, whole = ([t for t in trials if t.share == share] for share in (0.5, 1.0))
    assert [cell(trial) for trial in half] == [cell(trial) for trial in whole]
    assert len({cell(trial) for trial in half}) == 12
    for one, two in zip(half, whole, strict=True):
        assert one.push and two.push and 2.0 * one.push.impulse == pytest.approx(two.push.impulse)
        assert 7.0 < two.push.impulse < 13.0  # what it stood: 10 N·s
        assert 0.1 <= one.push.start / DURATIONS[str(one.motion)] <= 0.9


def test_the_measured_j50_is_that_of_its_controller_alone(limits: PushLimits) -> None:
    """Others have their own, from the first stage; with the same starts and times."""
    draw = Draw(Suite(motions=PARTS), limits, 4, DURATIONS)
    first = PARTS.first(draw, 0)
    won = [trial.pushes[0].impulse < 5.0 for trial in first]
    trials = PARTS.second(draw, len(first), first, {"momentum-qp": won, "pd": won})
    table = limits.j50()
    for own, other in zip(trials["momentum-qp"], trials["pd"], strict=True):
        assert (own.number, own.seed, own.motion) == (other.number, other.seed, other.motion)
        if own.push is not None and other.push is not None:
            assert own.push.impulse == pytest.approx(own.share * table(own.push.direction))
            assert other.push.impulse < 0.6 * own.push.impulse
            assert replace(own.push, impulse=0.0) == replace(other.push, impulse=0.0)


def test_shares_of_the_limits_are_the_same_pushes_for_all(limits: PushLimits) -> None:
    suite = Suite(motions=replace(PARTS, of="limits"))
    plan = TrialPlan(suite, limits, 4, ("pd", "momentum-qp"), DURATIONS)
    assert plan.count == 2 * len(plan.first) and {t.part for t in plan.first} == {PART}
    outcome = Outcome(recovered=True, fallen=False)
    finished = {(name, t.number): outcome for name in plan.names for t in plan.first}
    trials = plan.trials(finished)
    assert trials["pd"] == trials["momentum-qp"] == plan.first
    unmeasured = PushLimits(robot_named("compact"))
    with pytest.raises(ConfigError, match="share: no J50 of 'compact' was measured"):
        TrialPlan(suite, unmeasured, 4, ("pd",), DURATIONS)


def test_the_table_of_limits_is_read_with_its_controller(limits: PushLimits) -> None:
    assert limits.controller == "momentum-qp" and isinstance(limits.j50(), LimitTable)


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"names": []}, "names: must not be empty"),
        ({"shares": [0.5, 0.5]}, "shares: 0.5 comes twice"),
        ({"names": ["a/x.npz", "b/x.npz"]}, "names: x comes twice"),
        ({"names": ["standing"]}, "names: standing is always included"),
        ({"of": "mine"}, "of"),
    ],
)
def test_what_is_no_part_is_said(fields: dict[str, object], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        build(Suite, {"motions": fields}, "suite")


def test_motions_are_alone_and_others_perform_none() -> None:
    with pytest.raises(ConfigError, match="motions: must be the only part"):
        build(Suite, {"motions": {}, "quiet": {}}, "suite")
    with pytest.raises(ConfigError, match="motions: this suite performs no motions"):
        load_suite("quiet").performing(["squat"])
    assert load_suite("follow").performing(["squat"]).motions == replace(
        load_suite("follow").motions or PARTS, names=("squat",)
    )
