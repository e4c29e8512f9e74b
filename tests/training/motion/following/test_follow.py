"""Motions are performed: errors are small where the robot stands, and falls are counted."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.library import find_bvh
from poise.baselines.motion.retargeting.retarget import retarget
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import on_terrain
from poise.envs.terrain.terrain import make_terrain
from poise.training.benchmarking.trials.push_limits import load_limits
from poise.training.motion.following.fastest import fastest
from poise.training.motion.following.follow import follow
from tests.performance.motions_in_field import row_of
from tests.support.captures import make
from tests.support.physics import robot_named
from tests.support.refused import refused


def test_a_packaged_clip_is_followed() -> None:
    """Both arms overhead: no fall, joints to 3°, bodies to 2 cm."""
    robot = robot_named("humanoid")
    clip = read_bvh(find_bvh("humanoid_reach_up")).clip
    motion = reference_from(retarget(clip, robot).clip, robot, "test")
    (trial,) = follow(motion, robot=robot, starts=1)
    assert not trial.fallen and trial.solver_failures == 0
    assert 0.0 < np.degrees(trial.joint_rms) < 3.0
    assert 0.0 < trial.body_error < 0.02 and trial.body_error_root < 0.02


def test_a_motion_in_field_is_off_by_what_sensors_are_off_and_does_not_fall() -> None:
    """Its errors are the true robot's: centimetres, where an exact state leaves millimetres."""
    robot = robot_named("humanoid")
    ideal, field = (
        follow("bow", robot=robot, starts=3, seed=25, realism=level) for level in (None, "field")
    )
    assert not any(trial.fallen for trial in [*ideal, *field])
    assert max(trial.body_error for trial in ideal) < 6e-3
    assert 1e-2 < np.mean([trial.body_error for trial in field]) < 6e-2


def test_a_motion_is_followed_in_another_engine() -> None:
    """Nearly as well as in MuJoCo, but not the same; a walk on what it does not hold is refused."""
    pytest.importorskip("pydrake", reason="Drake is not installed: pip install --no-deps drake")
    robot = robot_named("humanoid")
    (own,), (other,) = (
        follow("bow", robot=robot, starts=1, seed=25, physics=engine)
        for engine in ("mujoco", "drake")
    )
    assert not own.fallen and not other.fallen
    assert other.body_error < 6e-3 and other.body_error != own.body_error
    assert own == follow("bow", robot=robot, starts=1, seed=25)[0]
    uneven = on_terrain(robot, make_terrain("stairs", "test"))
    with pytest.raises(ConfigError, match=r"drake does not hold terrain \(stairs\)"):
        follow("bow", robot=uneven, starts=1, physics="drake")


def test_a_row_of_levels_has_falls_and_means_of_those_that_stay_up() -> None:
    figures = {"placement_error": np.nan, "interruptions": np.nan, "walked": np.nan}
    up, down = (  # Any: of `Followed` it has what is read
        cast(Any, SimpleNamespace)(fallen=fallen, body_error=error, sole_slide=2e-3, **figures)
        for fallen, error in ((False, 0.03), (True, 0.9))
    )
    assert row_of([up, down]) == ["1 of 2", "30.0", "2.0", "", ""]
    up.walked, up.placement_error = 0.97, 4e-3
    assert row_of([up, down]) == ["1 of 2", "", "", "", "97"]
    up.walked, up.interruptions = np.nan, 1.0
    assert row_of([up, down]) == ["1 of 2", "30.0", "4.0", "1.0", ""]
    assert row_of([down]) == ["1 of 1", "", "", "", ""]


def test_a_hard_push_is_a_fall_and_standing_is_none() -> None:
    robot = robot_named("humanoid")
    (fallen,) = follow("standing", robot=robot, starts=1, impulse=200.0)
    assert fallen.fallen and fallen.push is not None and fallen.push["impulse"] == 200.0
    (still,) = follow("standing", robot=robot, starts=1)
    assert not still.fallen


def test_standing_still_is_an_error_of_zero() -> None:
    (still,) = follow("standing", robot=robot_named("humanoid"), starts=1)
    assert still.body_error_last < 3e-3


def test_what_follows_no_motion_is_said() -> None:
    with pytest.raises(ConfigError, match="'zero' follows no motion"):
        follow("standing", "zero", robot=robot_named("humanoid"), starts=1)
    with refused("range", "starts", least=1):
        follow("standing", starts=0)
    with refused("range", "seed", least=0):
        follow("standing", seed=-1)
    with pytest.raises(ConfigError, match="share: give either an impulse or a share of J50"):
        follow("standing", impulse=1.0, share=0.5)
    with pytest.raises(ConfigError, match="share: no J50 of 'compact' was measured"):
        follow("standing", robot=robot_named("compact"), share=0.5)


def test_a_share_of_j50_is_that_of_the_direction() -> None:
    robot = robot_named("humanoid")
    table = load_limits(robot).table
    assert table is not None
    trials = follow("standing", robot=robot, starts=2, directions=2, share=0.3)
    assert [trial.push["impulse"] for trial in trials if trial.push] == pytest.approx(
        [0.3 * table(0.0), 0.3 * table(180.0)]
    )
    assert not any(trial.fallen for trial in trials)


def test_the_fastest_tempo_is_the_last_one_before_falls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bisection on steps of 0.05; between 1 and a tenth where the motion's own tempo falls."""
    for limit, wanted in ((1.32, 1.3), (1.0, 1.0), (9.0, 4.0), (0.43, 0.4), (0.01, 0.0)):
        asked = []

        def fake(*_, speed: float, limit: float = limit, asked: list = asked, **__) -> list:
            asked.append(speed)
            return [SimpleNamespace(fallen=speed > limit)]

        monkeypatch.setattr("poise.training.motion.following.fastest.follow", fake)
        assert fastest("squat") == pytest.approx(wanted)
        assert len(asked) < 12


def test_a_faster_motion_has_its_rates_and_the_impatient_stop_at_a_fall() -> None:
    robot = robot_named("humanoid")
    motion = load_motion("squat", robot)
    fast = motion.at_speed(2.0)
    assert fast.duration == pytest.approx(0.5 * motion.duration)
    own, twice = motion.sample(1.0), fast.sample(0.5)
    for name, factor in (("q_ref", 1), ("v_ref", 2), ("a_ref", 4), ("com_acc", 4), ("root_vel", 2)):
        np.testing.assert_allclose(getattr(twice, name), factor * getattr(own, name), atol=1e-9)
    trials = follow(motion, robot=robot, starts=2, impulse=200.0, speed=2.0, patient=False)
    assert len(trials) == 1 and trials[0].fallen
    with refused("range", "tempo", least=0.1, most=10, value="0"):
        follow(motion, robot=robot, speed=0.0)


def test_a_turn_is_performed() -> None:
    """Half a turn on the spot, without a fall and without the planner."""
    robot = robot_named("humanoid")
    motion = reference_from(retarget(make("turn-in-place")[0], robot).clip, robot, "turn")
    (trial,) = follow(motion, "motion-step", robot=robot, starts=1)
    assert not trial.fallen and not trial.interruptions
    assert trial.placement_error < 0.03
