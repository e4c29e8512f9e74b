"""Clips that walk and turn, performed by the planner of steps: what it is told, what it does."""

from __future__ import annotations

import functools
import re
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.balance.references.reference_motion import command_options
from poise.baselines.balance.references.robot_clip import (
    RobotClip,
    read_robot_clip,
    reference_from,
    write_robot_clip,
)
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.walking import ResidualWalkEnv
from poise.baselines.motion.clips.contacts import measure_contacts
from poise.baselines.motion.clips.skeleton import SIDES
from poise.baselines.motion.retargeting.retarget import retarget_freely
from poise.baselines.motion.space_time.own_steps import limits_of_walk
from poise.baselines.motion.space_time.retarget_clip import retarget_clip
from poise.baselines.motion.space_time.walked import find_commands, walked_clip
from poise.baselines.registry import load_controller
from poise.baselines.walking.planner.command import GaitCommand
from poise.baselines.walking.walk import Walk
from poise.configs.errors import ConfigError
from poise.training.cli.entry import main
from poise.training.motion.following.follow import follow
from tests.support.captures import CAPTURES, make
from tests.support.physics import robot_named
from tests.support.weekly import daily

HUMANOID = "humanoid"
STARTS = pytest.mark.parametrize("starts", [1, pytest.param(3, marks=pytest.mark.weekly)])
#: metres a second ahead and left, and radians a second, of the made clips that walk
SPEEDS = {"walk": (1.2, 0, 0), "walk-curve": (0.9, 0, 0.6), "circle": (0.7, 0, 0.95),
          "turn-in-place": (0, 0, 0.8), "backwards": (-0.6, 0.1, 0)}  # fmt: skip


@functools.cache
def walking(name: str) -> RobotClip:
    """A made clip as the planner is to walk it, though `motion-step` could step it."""
    clip, robot = make(name)[0], robot_named(HUMANOID)
    free = retarget_freely(clip, robot)
    return replace(free.clip, commands=find_commands(clip, robot, free.scale).commands)


@pytest.mark.parametrize("name", SPEEDS)
def test_the_planner_is_told_the_clip_s_speed_turn_and_steps(name: str) -> None:
    scale, robot = 0.9, robot_named(HUMANOID)
    commands, tempo, _, _, way, *_ = find_commands(make(name)[0], robot, scale)
    ahead, left, turn = SPEEDS[name]
    told = np.median(commands[:, 1:4], axis=0)
    assert told == pytest.approx([way * scale * ahead, way * scale * left, turn], abs=0.06)
    assert tempo == 1.0 and 0.7 <= way <= 1.0 and (way < 1.0) == (name == "walk")
    lands = np.sort(np.concatenate(CAPTURES[name].stances)[:, 0])
    period = np.median(np.diff(lands))
    assert (commands[:, 4] < period).all()
    if name in ("walk", "turn-in-place", "backwards"):
        assert commands[:, 4] + 0.037 == pytest.approx(period, abs=0.045)  # with both feet down


def test_steps_are_the_clip_s_where_legs_can() -> None:
    """Shorter ones, that last as long, and begin with the clip's."""
    clip, robot = make("walk")[0], robot_named(HUMANOID)
    free = retarget_freely(clip, robot)
    found = find_commands(clip, robot, free.scale)
    lasts = np.diff(found.commands[1:, 0])
    assert found.commands[1:-1, 4] + 0.037 - 0.005 == pytest.approx(lasts, abs=0.002)
    length = found.commands[1:-1, 1] * lasts
    assert length.max() == pytest.approx(0.6 * robot.height_com, rel=0.03)
    walks = walked_clip(free.clip, found, robot)
    trials = follow(reference_from(walks, robot, "walk"), found.walker, starts=3)
    assert not any(trial.fallen or abs(trial.footstep_delay) > 0.02 for trial in trials)
    assert np.mean([trial.footsteps_kept for trial in trials]) >= 0.9
    for trial in trials:  # none of the clip's is missing; one of the planner's may follow
        assert trial.footsteps_kept * max(trial.footsteps, 1.0) == pytest.approx(1.0)


def test_footsteps_are_the_clip_s_though_soles_turn_on_the_ground() -> None:
    """A robot's soles that turn do not rest: they would have landed later, or twice."""
    clip, robot = make("walk")[0], robot_named(HUMANOID)
    free = retarget_freely(clip, robot)
    assert free.clip.planted is not None
    turning = replace(free.clip, planted=np.zeros_like(free.clip.planted))
    found = find_commands(clip, robot, free.scale)
    walks = walked_clip(turning, found, robot)
    assert walks.planted is not None
    held = len(walks.qpos) - len(free.clip.qpos)
    lands = np.sort(np.argwhere(np.diff(walks.planted[held:].astype(int), axis=0) > 0)[:, 0])
    contacts = measure_contacts(clip).planted
    wanted = np.sort(np.argwhere(np.diff(contacts.astype(int), axis=0) > 0)[:, 0]) * clip.dt
    assert lands * walks.dt * found.tempo == pytest.approx(wanted, abs=0.03)


def test_steps_to_a_side_are_within_the_planner_s_reach(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is imported can be followed: a capture of others went 0.48 m to the side in a step."""
    capture = CAPTURES["walk"]._replace(
        path=lambda t: np.column_stack([0.1 * t, 0.9 * t, np.zeros(len(t))])
    )
    monkeypatch.setitem(CAPTURES, "aside", capture)
    robot = robot_named(HUMANOID)
    walker = load_controller("walk", robot)
    found = find_commands(make("aside")[0], robot, 0.9)
    for option in command_options(found.commands):
        walker.check_command(GaitCommand(**{k: v for k, v in option.items() if k != "start"}))


@pytest.mark.parametrize("name", ["circle", "run-curve"])
def test_a_curve_is_told_as_one_from_begin_to_end(name: str) -> None:
    """A course that goes on straight beyond its ends leads aside there, and chords are short."""
    robot = robot_named(HUMANOID)
    ahead, turn = {"circle": (0.7, 0.95), "run-curve": (2.4, 0.8)}[name]
    commands, tempo, _, asked, *_ = find_commands(make(name)[0], robot, 0.9)
    assert commands[:, 1] == pytest.approx(asked * tempo * 0.9 * ahead, rel=0.01)
    assert commands[:, 2] == pytest.approx(0.0, abs=0.01)
    assert commands[:, 3] == pytest.approx(tempo * turn, rel=0.01)


def test_what_goes_up_is_refused_for_that() -> None:
    clip = make("walk")[0].at_speed(0.7)
    stairs = replace(clip, root=clip.root + 0.25 * clip.root[:, :1] * [0.0, 0.0, 1.0])
    made = retarget_clip(stairs, robot_named(HUMANOID))
    assert re.match(r"its feet go up or down by 1\.\d\d m", made.clip.about.unperformed)


def test_what_kneels_is_refused_for_that() -> None:
    """On one frame of `sit`: shanks back, and hips as much lower."""
    clip = make("sit")[0]
    late, knees = clip.times > 2.5, [clip.skeleton.joint(f"knee_{side}") for side in SIDES]
    rotations, root = (
        np.repeat(clip.rotations[:1], len(clip), 0),
        np.repeat(clip.root[:1], len(clip), 0),
    )
    half = np.arctan2(*rotations[0, knees[0], [2, 0]]) + np.radians(50.0)
    for knee in knees:
        rotations[late, knee] = [np.cos(half), 0.0, np.sin(half), 0.0]
    root[late, 2] -= clip.places()[0, knees[0], 2]
    made = retarget_clip(replace(clip, rotations=rotations, root=root), robot_named(HUMANOID))
    assert made.clip.about.unperformed.startswith("its left knee is on the ground at 2.5")


def test_the_way_of_a_clip_that_is_walked_is_what_the_planner_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Though feet are led less far where the clip is only shown."""
    free = retarget_freely(make("circle")[0], robot_named(HUMANOID))._replace(stride=0.5)
    where = "poise.baselines.motion.space_time.retarget_clip.retarget_freely"
    monkeypatch.setattr(where, lambda *_, **__: free)
    made = retarget_clip(make("circle")[0], robot_named(HUMANOID))
    assert made.walker == "walk" and made.stride == 1.0


def test_what_is_too_fast_is_slower_and_says_so() -> None:
    """By the controller that reaches it; the policy is told more than it reaches."""
    robot, h_omega = robot_named(HUMANOID), 2.779
    commands, tempo, walker, asked, *_ = find_commands(make("walk")[0].at_speed(1.9), robot, 0.9)
    assert 0.7 < tempo < 0.9 and walker == "residual-walk-fast" and 1.05 < asked <= 1.06
    assert commands[:, 1] == pytest.approx(asked * tempo * 1.9 * 1.2 * 0.9, abs=0.06)
    assert commands[:, 1].max() <= 1.06 * 0.585 * h_omega + 1e-3
    assert commands[-1, 0] + commands[1, 0] == pytest.approx(4.0 / 1.9 / tempo, rel=0.3)
    with pytest.raises(ConfigError, match=r"at 1\.6\d m/s at most, 0\.\d\d of it") as refused:
        find_commands(make("walk")[0].at_speed(1.9), robot, 0.9, least=tempo + 0.01)
    assert refused.value.field == "speed"
    brisk = find_commands(make("walk")[0].at_speed(1.18), robot, 0.9, least=0.9)
    assert brisk.tempo == 1.0 and brisk.walker == "walk-fast"
    assert (brisk.commands[:, 4] + 0.037 < 0.35).all()  # brisk walks have quick steps
    assert find_commands(make("walk")[0], robot, 0.9).walker == "walk"
    other = find_commands(make("walk")[0].at_speed(1.9), robot_named("compact"), 0.9)
    assert other.walker == "walk" and other.tempo < 0.7  # whose gains are of no fast walk


@pytest.mark.parametrize("name", ["unitree_g1", "unitree_h1", "booster_t1"])
def test_robots_that_walk_less_are_asked_for_less(name: str) -> None:
    """In speed and in the time of a swing, so that they do not fall."""
    robot, clip = robot_named(name), make("walk")[0].at_speed(0.8)
    h_omega, most = robot.height_com * robot.omega, limits_of_walk(robot)
    commands, tempo, walker, *_ = find_commands(clip, robot, 1.0)
    assert walker == "walk" and 0.5 < tempo < 1.0
    assert np.hypot(commands[:, 1], commands[:, 2]).max() <= most.speed * h_omega + 1e-9
    assert commands[:-1, 4].max() <= most.swing / robot.omega + 1e-9
    assert most.speed < limits_of_walk(robot_named(HUMANOID)).speed


def test_fast_curves_are_walked_by_the_policy_that_holds_them() -> None:
    """At the steps of its own gait; other robots are slower instead."""
    robot, clip = robot_named(HUMANOID), make("run-curve")[0]
    commands, tempo, walker, asked, *_ = find_commands(clip, robot, 0.9)
    assert walker == "residual-walk-fast" and 0.7 <= tempo < 0.75
    assert (commands[:, 4] == 0.0).all() and 1.5 < commands[:, 1].max() / asked < 1.6
    assert asked > 1.03 and (commands[:, 1] * commands[:, 3]).max() <= 0.0911 * 9.81
    other = find_commands(clip, robot_named("compact"), 0.9)
    assert other.walker == "walk" and other.tempo < tempo
    made = retarget_clip(clip, robot)
    assert made.walker == walker and made.clip.commands is not None
    (trial,) = follow(reference_from(made.clip, robot, "run-curve"), walker, starts=1)
    assert not trial.fallen and 0.8 < trial.walked < 1.1 and 0.9 < trial.turned < 1.2


def test_what_hops_or_changes_its_speed_too_soon_is_no_walk(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot, stances = robot_named(HUMANOID), [(0.9 * k, 0.9 * k + 0.75) for k in range(-1, 6)]
    hops = CAPTURES["backwards"]._replace(stances=(stances, stances))
    monkeypatch.setitem(CAPTURES, "hops", hops)
    with pytest.raises(ConfigError, match=r"hops \d times onto both feet, first for 0\.1\d s"):
        find_commands(make("hops")[0], robot, 0.9)
    back = CAPTURES["walk"]._replace(
        path=lambda t: np.column_stack([-1.2 * np.abs(t - 2.0), 0.0 * t, 0.0 * t])
    )
    monkeypatch.setitem(CAPTURES, "back", back)
    with pytest.raises(
        ConfigError, match=r"its speed changes by \d\.\d\d m/s at \d\.\d\d s"
    ) as told:
        find_commands(make("back")[0], robot, 0.9)
    assert told.value.field == "speed"


def test_jumps_are_no_walks_and_runs_are_told_as_such() -> None:
    robot = robot_named(HUMANOID)
    with pytest.raises(
        ConfigError, match=r"both feet are off the ground for 0\.\d\d s at 1\.0\d s"
    ):
        find_commands(make("jump")[0], robot, 0.9)
    run = make("run")[0]
    assert find_commands(run, robot, 0.9).tempo < 0.7
    made = retarget_clip(run, robot)
    assert made.clip.commands is None
    assert re.match(
        r"both feet are off the ground for 0\.\d\d s at 0\.\d\d s, so that it would be walked; it "
        r"goes at 2\.\d\d m/s, and the planner of walks at 1\.6\d m/s at most, 0\.\d\d of it",
        made.clip.about.unperformed,
    )


@STARTS
@pytest.mark.parametrize(
    ("speed", "walker"),
    daily([(0.6, "residual-walk-fast"), (0.48, "walk"), (0.495, "walk-fast")]),
)
def test_a_slow_run_is_walked_without_a_fall(speed: float, walker: str, starts: int) -> None:
    made = retarget_clip(make("run")[0].at_speed(speed), robot_named(HUMANOID))
    assert 0.7 < made.tempo <= 1.0 and made.clip.commands is not None
    assert made.walker == walker
    reference = reference_from(made.clip, robot_named(HUMANOID), "run")
    trials = follow(reference, walker, starts=starts)
    assert not any(trial.fallen for trial in trials)
    assert all(trial.walked > 0.8 for trial in trials)


@STARTS
@pytest.mark.parametrize("name", daily(["circle", "turn-in-place", "backwards"]))
def test_walks_and_turns_are_performed(name: str, starts: int, tmp_path: Path) -> None:
    """As far as the clip goes, and as far round, from disturbed starts without a fall."""
    clip = walking(name)
    write_robot_clip(clip, tmp_path / "clip.npz")
    again = read_robot_clip(tmp_path / "clip.npz")
    assert again.commands == pytest.approx(clip.commands)
    trials = follow(tmp_path / "clip.npz", "walk", starts=starts)
    assert not any(trial.fallen for trial in trials)
    shares = np.array([(trial.walked, trial.turned) for trial in trials])
    ahead, _, turn = SPEEDS[name]
    assert np.isfinite(shares[0]).tolist() == [ahead != 0, turn != 0]
    assert shares[np.isfinite(shares)] == pytest.approx(1.0, abs=0.2)


def test_trunk_and_arms_of_a_walk_are_the_clip_s(tmp_path: Path) -> None:
    """Where they are free to balance the robot they are 16° off; a policy has learned with that."""
    robot, errors = robot_named(HUMANOID), []
    reference = reference_from(walking("circle"), robot, "circle")
    for weight in (3.0, 0.001):
        config = tmp_path / f"{weight}.yaml"
        config.write_text(f"base: walk\ngait:\n  clip_weight: {weight}\n")
        (trial,) = follow(reference, str(config), starts=1)
        assert not trial.fallen
        errors.append(np.degrees(trial.joint_rms))
    assert errors[0] < 8.0 and errors[1] > 1.5 * errors[0]
    walker = cast(Walk, load_controller("walk", robot))
    free = walker.gait_sets.posture.weight.copy()
    ResidualWalkEnv(robot, controller=walker, motion=reference)
    np.testing.assert_array_equal(walker.gait_sets.posture.weight, free)
    env = ResidualBalanceEnv(robot, controller=walker, motion=reference)
    assert (walker.gait_sets.posture.weight > free).sum() == len(
        walker.gait_sets.posture.weight
    ) - 6 - 12 - 3
    env.motion = replace(reference, free_arms=True)
    np.testing.assert_array_equal(walker.gait_sets.posture.weight, free)
    env.motion = reference
    env.motion = load_motion("standing", robot)
    np.testing.assert_array_equal(walker.gait_sets.posture.weight, free)


def test_a_clip_that_turns_too_far_for_its_own_steps_is_walked() -> None:
    made = retarget_clip(make("circle")[0], robot_named(HUMANOID))
    assert made.clip.commands is not None and made.tempo == 1.0
    assert not made.clip.about.unperformed


def test_only_what_walks_is_told_to() -> None:
    reference = reference_from(walking("turn-in-place"), robot_named(HUMANOID), "turn")
    assert reference.commands is not None
    faster = reference.at_speed(2.0)
    assert faster.commands[1, 3] == pytest.approx(2.0 * reference.commands[1, 3])
    assert faster.commands[-1, 0] == pytest.approx(0.5 * reference.commands[-1, 0])
    with pytest.raises(ConfigError, match="does not walk"):
        follow(reference, "momentum-qp", starts=1)


def test_a_walk_by_a_planner_is_not_checked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its steps are not those of the file: that is told, with the command that performs it."""
    write_robot_clip(walking("walk"), tmp_path / "walk.npz")
    assert main(["motion", "check", str(tmp_path / "walk.npz")]) == 2
    assert "is walked by a planner" in capsys.readouterr().err
