"""training/benchmarking/suites/walking.py: walks over terrain, and what becomes of them."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from poise.baselines.walking.schedule import TimedCommand
from poise.configs.errors import ConfigError
from poise.configs.schema import build
from poise.envs.physics.pushes.sampler import LimitTable
from poise.envs.robots.robot import load_robot
from poise.envs.terrain.stairs import Stairs
from poise.envs.terrain.stones import Stones
from poise.training.benchmarking.metrics.walking import walk_levels
from poise.training.benchmarking.suites.plan import TrialPlan
from poise.training.benchmarking.suites.suite import Suite, load_suite
from poise.training.benchmarking.trials.agents import load_agent
from poise.training.benchmarking.trials.play import run_trial
from poise.training.benchmarking.trials.push_limits import PushLimits
from poise.training.benchmarking.trials.table import COLUMNS, read_trial, trial_row
from poise.training.benchmarking.trials.trial import Outcome, Trial
from poise.training.benchmarking.trials.variants import AgentVariants


def test_every_terrain_is_met_with_errors_of_its_own() -> None:
    limits = PushLimits(load_robot(), LimitTable((0.0,), (16.0,)))
    found = TrialPlan(load_suite("stairs"), limits, 7, ["walk"]).first
    levels = {trial.level for trial in found}
    assert {"up 0.10", "down 0.10", "up 0.15", "slope -8° unseen"} <= levels
    assert all(sum(trial.level == level for trial in found) == 20 for level in levels)
    tiles = [trial.terrain for trial in found if trial.level == "tiles ± 0.02 unseen"]
    assert all(isinstance(each, Stones) and each.error == 0.02 and each.unseen for each in tiles)
    assert len({each.surfaces()[1].height for each in tiles if each is not None}) == 20
    assert len({trial.seed for trial in found}) == len(found)


def test_a_suite_without_terrains_is_told() -> None:
    with pytest.raises(ConfigError, match="terrains: must not be empty"):
        build(Suite, {"terrains": {"terrains": {}}}, "suite")


def test_a_trial_on_a_terrain_is_read_as_it_was_written() -> None:
    trial = Trial(3, 5, part="terrains", level="up", commands=(TimedCommand(0.5),),
                  terrain=Stairs(rise=0.15, down=True, error=0.01, seed=4))  # fmt: skip
    row = trial_row(trial, "walk", Outcome(True, False, edge_contacts=2, surfaces_passed=9))
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS)
    writer.writeheader()
    writer.writerow({key: "" if row[key] is None else row[key] for key in COLUMNS})
    (line,) = csv.DictReader(io.StringIO(text.getvalue()))
    assert read_trial(line, Path("trials.csv")) == trial
    assert line["edge_contacts"] == "2" and line["surfaces_passed"] == "9"


def test_a_walk_over_stairs_counts_what_it_passes() -> None:
    """Beyond the last edge, or not; on its own terrain, and then on level ground again."""
    variants = AgentVariants(load_agent("walk", load_robot(), duration=4.0, pushes=None))
    commands, outcomes, trials = (TimedCommand(0.5),), [], []
    for terrain in (Stairs(count=2), Stairs(count=9), None):
        trial = Trial(0, 0, part="terrains", level="up", commands=commands, terrain=terrain)
        agent = variants.under(trial.conditions, trial.terrain)
        outcomes.append(run_trial(agent, trial))
        trials.append(trial)
    short, long, level = outcomes
    assert short.recovered and short.surfaces_passed == 2 and short.edge_contacts == 0
    assert not long.recovered and not long.fallen and long.surfaces_passed in (2, 3, 4, 5)
    assert level.surfaces_passed is None
    (figures,) = walk_levels(list(zip(trials[:2], outcomes[:2], strict=True)), 4.0)
    assert figures["recovered_rate"] == 0.5 and figures["edge_contacts"] == 0.0
    assert figures["surfaces_passed"] == (2 + long.surfaces_passed) / 2
