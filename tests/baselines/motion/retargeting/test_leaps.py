"""Jumps: when a clip leaves the ground, what a robot plans of it, and that it flies as planned."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.footing import sole_poses
from poise.baselines.balance.references.robot_clip import reference_from
from poise.baselines.motion.retargeting.leaps import Leap, find_leaps, tempo_of
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
    return retarget_clip(make(name)[0], robot_named(HUMANOID))


def test_jumps_are_found_and_runs_are_told_apart() -> None:
    clip = make("jump")[0]
    assert find_leaps(clip) == [pytest.approx((1.0, 1.45), abs=0.04)]
    assert find_leaps(make("walk")[0]) == []
    with pytest.raises(ConfigError, match=r"runs: it is off the ground for 0\.\d\d s at 0\.\d\d s"):
        find_leaps(make("run")[0])
    late = replace(clip, root=clip.root[60:], rotations=clip.rotations[60:])
    with pytest.raises(ConfigError, match="is in the air at its begin or end"):
        find_leaps(late)


def test_jumps_too_soon_after_each_other_are_slower() -> None:
    leaps = [Leap(1.0, 1.3), Leap(1.5, 1.8)]
    assert tempo_of(leaps, 0.2) == pytest.approx(0.5 / 0.64)
    assert tempo_of(leaps[:1], 0.2) == 1.0


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
