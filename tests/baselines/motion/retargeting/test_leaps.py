"""Jumps: when a clip leaves the ground, what a robot plans of it, and that it flies as planned."""

from __future__ import annotations

import functools
import re
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.footing import root_turns, sole_poses
from poise.baselines.balance.references.footwork import perform_plan
from poise.baselines.balance.references.robot_clip import RATE, About, RobotClip, reference_from
from poise.baselines.motion.retargeting.leaps import Leap, find_leaps, plan_leaps, tempo_of
from poise.baselines.motion.retargeting.limbs import find_limbs
from poise.baselines.motion.retargeting.retarget import SMOOTH
from poise.baselines.motion.retargeting.solve_tracks import solve_tracks
from poise.baselines.motion.retargeting.tracks import find_tracks
from poise.baselines.motion.space_time.retarget_clip import RetargetedClip, retarget_clip
from poise.configs.errors import ConfigError
from poise.envs.balance.base import BalanceEnv
from poise.training.benchmarking.trials.trial import Trial
from poise.training.motion.following.follow import follow
from tests.support.captures import make
from tests.support.physics import robot_named

HUMANOID = "humanoid"


@functools.cache
def jump(name: str) -> RetargetedClip:
    return retarget_clip(make(name)[0], robot_named(HUMANOID), kinematic=False)


def test_jumps_are_found_and_runs_are_told_apart() -> None:
    clip = make("jump")[0]
    assert find_leaps(clip) == [pytest.approx((1.0, 1.45), abs=0.04)]
    assert find_leaps(make("walk")[0]) == []
    with pytest.raises(ConfigError, match=r"runs: it is off the ground for 0\.\d\d s at 0\.\d\d s"):
        find_leaps(make("run")[0])
    late = replace(clip, root=clip.root[60:], rotations=clip.rotations[60:])
    with pytest.raises(ConfigError, match="begins or ends in flight"):
        find_leaps(late)
    with pytest.raises(ConfigError, match=r"for 1\.\d\d s at 2\.\d\d s no foot of it is found"):
        find_leaps(clip.at_speed(0.4))


def test_jumps_too_soon_after_each_other_are_slower() -> None:
    leaps = [Leap(1.0, 1.3), Leap(1.5, 1.8)]
    assert tempo_of(leaps, 0.2) == pytest.approx(0.5 / 0.7)
    assert tempo_of(leaps[:1], 0.2) == 1.0


def test_a_robot_that_leans_jumps_higher() -> None:
    """0.3 s and more of the clip's 0.45; upright, ankles end the crouch at a jump of 0.2 s."""
    made = jump("jump")
    assert made.clip.planted is not None and made.stride == made.tempo == 1.0
    assert (~made.clip.planted.any(axis=1)).sum() * made.clip.dt > 0.29
    tilts = np.degrees(np.linalg.norm(root_turns(robot_named(HUMANOID), made.clip.qpos), axis=1))
    assert 15.0 < tilts.max() < 25.0 and tilts[[0, -1]] == pytest.approx(0.0, abs=0.1)


def test_feet_that_turn_in_the_air_stay_apart() -> None:
    """At a share of the turn, too, which as a share of their places they would not."""
    robot, made = robot_named(HUMANOID), jump("jump-turn")
    _, places, turns = sole_poses(robot, made.clip.qpos)
    assert 0.1 < made.stride < 1.0 and turns[-1, 0, 2] > 0.1
    apart = np.linalg.norm(places[:, 0, :2] - places[:, 1, :2], axis=1)
    assert apart == pytest.approx(apart[0], abs=0.01)


def test_a_jump_that_is_too_far_is_refused_with_what_bounds_it() -> None:
    made = retarget_clip(make("jump-turn")[0], robot_named(HUMANOID))
    assert made.clip.commands is None
    assert re.match(r"(a leap|the legs|joint|the limbs).*; with 0\.\d\d of its way at 1\.00 of its "
                    r"tempo it can be done \(--steps\)", made.clip.about.unperformed)  # fmt: skip
    assert jump("jump-turn").bound in made.clip.about.unperformed
    assert not jump("jump").bound


def test_soles_in_the_air_go_as_far_as_motors_lead_them() -> None:
    """A straddle: 0.2 m to either side in the air ask for more than hips have, for moments. The
    QP's answer is then the most that they do, and not none, after which legs hang."""
    robot, clip = robot_named(HUMANOID), make("jump")[0]
    limbs, leaps = find_limbs(robot), find_leaps(clip)
    tracks = find_tracks(clip, robot, limbs, SMOOTH)
    soles, landed = tracks.soles.copy(), round(leaps[0].land / RATE)
    soles[landed:, :, 1] += 0.2 * np.sign(soles[landed:, :, 1])
    tracks = tracks._replace(soles=soles)
    qpos = solve_tracks(robot, limbs, tracks, SMOOTH).qpos
    plan, _ = plan_leaps(leaps, tracks, qpos, robot, 30, 0.23, 1.0)
    qpos = perform_plan(robot, plan, "straddle")
    about = About(robot.name, robot.fingerprint, "straddle", "straddle", "")
    made = RobotClip(about, plan.dt, qpos, plan.planted)
    ends: list[np.ndarray] = []

    def watched(trial: Trial):
        return lambda env: ends.append(env.simulation.state.sole_points[:, 1].copy())

    (trial,) = follow(reference_from(made, robot, "straddle"), "motion-step", starts=1,
                      watch=watched)  # fmt: skip
    assert not trial.fallen and not trial.interruptions and not trial.solver_failures
    assert abs(ends[-1][0] - ends[-1][1]) > 0.55  # of 0.58; legs that hang land nearer together


@pytest.mark.parametrize("name", ["jump", "jump-turn"])
def test_the_centre_of_mass_falls_while_a_robot_is_in_the_air(name: str) -> None:
    robot, made = robot_named(HUMANOID), jump(name)
    clip = made.clip
    assert clip.planted is not None and 0.2 < made.flight < 1.0
    air = np.flatnonzero(~clip.planted.any(axis=1))
    com, places, turns = sole_poses(robot, clip.qpos)
    accelerations = np.diff(com[air, 2], 2) / clip.dt**2
    assert accelerations == pytest.approx(-robot.units.gravity, rel=0.05)
    assert places[air, :, 2].max() > 0.03 and places[:, :, 2].min() > -1e-3
    truth = make(name)[1]
    middle = np.flatnonzero(~truth.any(axis=1)).mean() * make(name)[0].dt
    assert air.mean() * clip.dt - made.begins == pytest.approx(middle, abs=0.05)
    asked = 1.6 * made.stride if name == "jump-turn" else 0.0
    assert turns[-1, :, 2] == pytest.approx(asked, abs=0.1)


def test_a_jump_leaves_the_ground_as_planned_and_lands_without_a_fall() -> None:
    made = jump("jump")
    reference = reference_from(made.clip, robot_named(HUMANOID), "jump")
    assert made.clip.planted is not None
    planned = float((~made.clip.planted.any(axis=1)).sum() * made.clip.dt)
    air: list[float] = []
    heights: list[float] = []

    def watched(trial: Trial):
        air.append(0.0)

        def watch(env: BalanceEnv) -> None:
            state = env.simulation.state
            if env.simulation.time > 1.5:  # the disturbed start has landed
                air[-1] += env.config.policy_period * bool(state.contacts.sum() == 0)
                heights.append(float(state.sole_points[:, 2].min()))

        return watch

    trials = follow(reference, "motion-step", starts=3, watch=watched)
    assert not any(trial.fallen or trial.interruptions for trial in trials)
    assert air == pytest.approx([planned] * 3, abs=0.05)
    assert max(heights) > 0.03
