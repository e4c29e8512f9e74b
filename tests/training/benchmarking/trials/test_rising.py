"""Getting up: training/benchmarking/trials/rising.py and suites/getting_up.py."""

import csv
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from poise.envs.balance.position import PositionBalanceEnv
from poise.envs.balance.start import FALLEN_POSTURES
from poise.envs.physics.pushes.push import Push
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.metrics.evaluated import rising
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import load_suite
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.rising import Rising
from poise.training.benchmarking.trials.table import read_trial, trial_row
from poise.training.benchmarking.trials.trial import Trial

DOWN = Push("torso", 0.5, 0.1, 60.0, 0.0)


def agent(name: str, duration: float, **fall: object) -> Agent:
    return load_agent(name, load_robot(), duration=duration, pushes=None, fall=fall)


def test_up_is_a_second_without_a_break():
    """A robot put on its feet after a second on the ground was down for that second."""
    env = PositionBalanceEnv(pushes=None, fall={"terminates": False}, duration=10.0)
    env.reset(seed=0, options={"noise": 0.0})
    rising_, standing, period = Rising(env), env.robot.standing_qpos, env.config.policy_period
    lying = standing.copy()
    lying[2], lying[3:7] = 0.3, [np.cos(0.8), np.sin(0.8), 0.0, 0.0]

    def place(qpos: np.ndarray, seconds: float) -> None:
        for _ in range(round(seconds / period)):
            clock = env.simulation.clock.steps
            env.simulation.reset(qpos)
            env.simulation.clock.steps = clock + round(period / env.arrays.timestep)
            rising_.update()

    place(lying, 1.0)
    place(standing, 0.6)
    place(lying, 0.2)
    assert not rising_.held and rising_.outcome().up_time is None
    place(standing, 1.1)
    assert rising_.held
    assert rising_.outcome().up_time == pytest.approx(1.8 + period)
    place(lying, 0.1)
    assert not rising_.outcome().up_again  # it fell again
    assert rising_.outcome().up_time == pytest.approx(1.8 + period)


def test_a_fall_that_is_watched_is_the_same_fall():
    """What a trial says of the fall does not depend on the time that it is given to get up."""
    short, watched = agent("momentum-qp", 6.0), agent("momentum-qp", 8.0, terminates=False)
    trial = Trial(0, 1, (DOWN,))
    alone = run_trial(short, trial)
    again = run_trial(watched, replace(trial, until=6.0, get_up=2.0))
    assert alone.fallen and alone.up_again is None and again.up_again is False
    nothing = {"up_again": None, "up_time": None}
    assert {**asdict(again), **nothing} == {**asdict(alone), **nothing}
    stood = replace(trial, pushes=(), until=2.0, get_up=2.0)
    assert run_trial(watched, stood).up_again is None  # it never fell


def test_trials_start_on_the_ground():
    """Each from a posture of its own that no training has; who stays down has not recovered."""
    plan = TrialPlan(load_suite("get-up").resized(5), PushLimits(load_robot()), 3, ["a"])
    starts = [trial.start or 0 for trial in plan.first]
    assert len(set(starts)) == 5 and min(starts) >= FALLEN_POSTURES
    lying = run_trial(agent("zero", 1.5, terminates=False), plan.first[0])
    assert lying.up_again is False and not lying.recovered and lying.loss == "down"
    assert lying.fallen and lying.up_time is None


def test_get_up_gives_every_trial_time():
    """A fall of the suite is followed by so many seconds; the trial ends when it did otherwise."""
    suite = replace(load_suite("strong").resized(2), get_up_time=10.0)
    plan = TrialPlan(suite, PushLimits(load_robot()), 3, ["a"])
    assert all(t.get_up == 10.0 and t.until == suite.duration for t in plan.first)
    before = TrialPlan(load_suite("strong").resized(2), PushLimits(load_robot()), 3, ["a"])
    assert [t.pushes for t in plan.first] == [t.pushes for t in before.first]


def test_a_trial_reads_back(tmp_path):
    """Start and time to get up are columns of trials.csv."""
    trial = Trial(4, 9, start=600, get_up=None)
    watched = replace(trial, start=None, pushes=(DOWN,), until=6.0, get_up=10.0)
    outcome = run_trial(agent("zero", 1.1, terminates=False), trial)
    path = Path(tmp_path) / "trials.csv"
    with path.open("w", newline="") as file:
        rows = [trial_row(each, "a", outcome) for each in (trial, watched)]
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    with path.open(newline="") as file:
        read = [read_trial(line, path) for line in csv.DictReader(file)]
    assert (read[0].start, read[1].start) == (600, None)
    assert (read[1].until, read[1].get_up) == (6.0, 10.0)


def test_figures_are_of_those_that_were_down():
    """Two of three were up again, after 1 and 3 s; who never fell does not count."""
    nothing = run_trial(agent("zero", 1.1, terminates=False), Trial(0, 0, start=600))
    up = [replace(nothing, up_again=True, up_time=t) for t in (1.0, 3.0)]
    stood = replace(nothing, up_again=None)
    figures = rising([*up, nothing, stood])
    assert figures["downs"] == 3 and figures["up_again_rate"] == pytest.approx(2 / 3)
    assert figures["up_time_median"] == 2.0
    assert rising([stood]) == {}
