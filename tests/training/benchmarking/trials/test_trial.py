"""training/benchmarking/trials/trial.py, play.py and table.py."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.pushes.push import Push
from poise.envs.robots.robot import load_robot
from poise.training.benchmarking.trials.agents import Agent, load_agent
from poise.training.benchmarking.trials.play import run_trial, tilt_of
from poise.training.benchmarking.trials.table import COLUMNS, trial_row
from poise.training.benchmarking.trials.trial import Trial


@pytest.fixture(scope="module")
def agent() -> Agent:
    return load_agent("momentum-qp", load_robot(), duration=3.0, pushes=None)


def push(impulse: float) -> Push:
    return Push("torso", 0.2, 0.1, impulse, 90.0)


def test_a_small_push_is_recovered_and_a_huge_one_not(agent: Agent) -> None:
    """The outcome says what happened, and when."""
    moving: list[float] = []

    def watch(env: BalanceEnv) -> None:
        if np.linalg.norm(env.simulation.state.com_vel) >= 0.1:
            moving.append(env.simulation.time)

    small = run_trial(agent, Trial(0, 1, (push(11.0),)), watch)
    assert small.recovered and not small.fallen and small.fall_time is None
    assert small.recovery_time == pytest.approx(moving[-1] - 0.2)
    assert small.final_speed is not None and small.final_speed < 0.1
    assert small.mean_abs_action == 0.0 and small.com_drift is None and not small.foot_displaced
    huge = run_trial(agent, Trial(1, 1, (push(60.0),)))
    assert huge.fallen and not huge.recovered and huge.recovery_time is None
    assert huge.fall_time is not None and 0.2 < huge.fall_time < 3.0
    assert huge.max_com is not None and small.max_com is not None
    assert huge.max_com > small.max_com


def test_drift_counts_without_a_push(agent: Agent) -> None:
    """An unpushed robot stays, and its feet; drift is measured from the first second on."""
    quiet = run_trial(agent, Trial(0, 3))
    assert quiet.recovered and quiet.com_drift is not None and 0.0 < quiet.com_drift < 0.02
    assert quiet.foot_drift is not None and 0.0 < quiet.foot_drift < 0.002


def test_an_outcome_depends_on_the_trial_alone(agent: Agent) -> None:
    """What was played before leaves no trace, bit for bit; another seed is another start."""
    first = run_trial(agent, Trial(0, 5, (push(9.0),)))
    run_trial(agent, Trial(1, 6, (push(60.0),)))
    assert asdict(run_trial(agent, Trial(2, 5, (push(9.0),)))) == asdict(first)
    assert run_trial(agent, Trial(3, 7, (push(9.0),))) != first


def test_watch_sees_the_reset_and_every_step(agent: Agent) -> None:
    """A watcher is called once more than there are steps, with time moving on."""
    times: list[float] = []
    run_trial(agent, Trial(0, 5), lambda env: times.append(env.simulation.time))
    assert len(times) == agent.env.max_steps + 1
    assert times[0] == 0.0 and times[-1] == pytest.approx(3.0)


def test_the_row_has_all_columns_in_order(agent: Agent) -> None:
    """A line of trials.csv holds the push, and nothing in its place without one."""
    outcome = run_trial(agent, Trial(0, 1, (push(60.0),)))
    line = trial_row(Trial(4, 1, (push(60.0),), limit_fraction=2.5), "momentum-qp", outcome)
    assert tuple(line) == COLUMNS
    assert line["trial"] == 4 and line["impulse"] == 60.0 and line["limit_fraction"] == 2.5
    without = trial_row(Trial(4, 1), "momentum-qp", outcome)
    assert tuple(without) == COLUMNS and without["body"] is None and without["fallen"] is True


def test_lean_is_the_tilt_of_the_root_at_the_end(agent: Agent) -> None:
    """Next to none at rest; that of a root that is turned by 5° about a horizontal axis."""
    quiet = run_trial(agent, Trial(0, 3))
    assert quiet.final_lean is not None and 0.0 < quiet.final_lean < 1.0
    env = agent.env
    env.reset(seed=3)
    axes = env.simulation.state_arrays.root_axes
    tilted = Rotation.from_euler("zy", [40.0, 5.0], degrees=True).as_matrix()
    axes[:] = tilted @ env.simulation.arrays.root_standing
    assert tilt_of(env) == pytest.approx(5.0)
