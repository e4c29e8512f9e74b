"""training/benchmarking/trials/push_limits.py."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.configs.errors import ConfigError
from poise.envs.compiled.maths.pendulum import ankle_limit
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.pushes.sampler import LimitTable, push_bodies
from poise.envs.robots.robot import Robot, load_robot
from poise.training.benchmarking.trials import push_limits
from poise.training.benchmarking.trials.push_limits import PushLimits, load_limits, write_limits


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def test_the_ankle_limit_is_the_formula_of_the_standing_posture(robot: Robot) -> None:
    """J = m ω δ ωT/(1 − e^(−ωT)), with δ to the front larger than to the back."""
    limits = PushLimits(robot)
    expected = robot.mass * ankle_limit(robot.omega, limits.margin(0.0), 0.1)
    assert limits.ankle(0.0, 0.1) == expected
    assert limits.margin(90.0) == pytest.approx(limits.margin(270.0), abs=2e-3)
    assert limits.ankle(0.0, 0.3) > expected


def test_directions_around_the_robot_have_the_corners(robot: Robot) -> None:
    """Where the limit has its peaks; evenly spaced directions alone would cut them off."""
    limits = PushLimits(robot)
    around = limits.around(5.0)
    assert set(range(0, 360, 5)) <= set(around) and np.all(np.diff(around) > 0.0)
    assert around[0] >= 0.0 and around[-1] < 360.0
    peak = max(limits.margin(angle) for angle in np.arange(0.0, 360.0, 0.1))
    assert max(map(limits.margin, around)) >= peak
    assert max(map(limits.margin, np.arange(0.0, 360.0, 5.0))) < max(map(limits.margin, around))
    rays = limits.standing.support_polygon - limits.standing.com[:2]
    found = [limits.margin(angle) for angle in around]
    for length in np.linalg.norm(rays, axis=1):
        assert np.min(np.abs(np.array(found) - length)) < 1e-9


def test_fractions_are_of_the_ankle_limit_or_of_the_table(robot: Robot) -> None:
    """A push of exactly the limit has fraction 1, for any duration and profile."""
    ankle = PushLimits(robot)
    at_limit = Push("torso", 0.5, 0.25, ankle.ankle(30.0, 0.25), 30.0)
    assert ankle.fraction(at_limit) == pytest.approx(1.0)
    table = PushLimits(robot, LimitTable((0.0, 180.0), (10.0, 20.0)))
    assert table.fraction(Push("torso", 0.5, 0.1, 15.0, 90.0)) == pytest.approx(1.0)
    assert table.fraction(Push("torso", 0.5, 0.3, 15.0, 90.0)) < 1.0
    assert (ankle.scale, table.scale) == ("ankle limit", "baseline J50")
    assert PushLimits(robot, table.table, "momentum-qp").scale == "baseline J50"
    assert PushLimits(robot, table.table, "capture-step").scale == "J50 of capture-step"


def test_a_written_file_reads_back(robot: Robot, tmp_path: Path) -> None:
    """What write_limits writes, load_limits reads."""
    table = LimitTable((0.0, 90.0), (16.5, 14.25))
    write_limits(tmp_path / "limits.yaml", robot, "momentum-qp", table)
    assert load_limits(robot, tmp_path / "limits.yaml").table == table


def test_limits_of_another_robot_are_refused(robot: Robot, tmp_path: Path) -> None:
    """The fingerprint tells robots apart, not their names."""
    path = tmp_path / "limits.yaml"
    write_limits(path, replace(robot, fingerprint="0"), "momentum-qp", LimitTable((0.0,), (16.0,)))
    with pytest.raises(ConfigError, match="fingerprint"):
        load_limits(robot, path)


def test_a_robot_without_a_file_has_the_ankle_limit(robot: Robot) -> None:
    """Nothing needs to be measured before the first evaluation."""
    assert load_limits(replace(robot, name="unheard of")).table is None


def test_push_bodies_come_from_the_description(robot: Robot) -> None:
    """The described bodies, checked; the root where none are described."""
    assert push_bodies(robot)[0] == "torso" and len(push_bodies(robot)) == 4
    bare = replace(robot, description=replace(robot.description, push_bodies=()))
    assert push_bodies(bare) == ("torso",)
    wrong = replace(robot, description=replace(robot.description, push_bodies=("tail",)))
    with pytest.raises(ConfigError, match="tail.*choices: torso"):
        push_bodies(wrong)


def test_kernels_are_compiled_before_the_first_is_used(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Several at once, rather than by this process one after the other."""
    order: list[str] = []
    simulate = push_limits.Simulation
    monkeypatch.setattr(push_limits, "prepare", lambda: order.append("compiled"))
    monkeypatch.setattr(
        push_limits, "Simulation", lambda robot: (order.append("used"), simulate(robot))[1]
    )
    PushLimits(robot)
    assert order == ["compiled", "used"]
