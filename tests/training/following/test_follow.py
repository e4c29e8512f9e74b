"""Motions are performed: errors are small where the robot stands, and falls are counted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.clips.bvh import read_bvh
from poise.baselines.clips.library import find_bvh
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.motions.motion import load_motion
from poise.baselines.motions.robot_clip import reference_from
from poise.baselines.retargeting.retarget import retarget
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot
from poise.training.following.follow import follow, lies
from poise.training.following.reference import ReferenceBodies, Stance
from poise.training.trials.push_limits import load_limits
from tests.support.physics import robot_named


def test_a_captured_clip_is_followed() -> None:
    """Both arms overhead: no fall, joints to 3°, bodies to 2 cm."""
    robot = robot_named("humanoid")
    clip = read_bvh(find_bvh("cmu02_reach_up")).clip
    motion = reference_from(retarget(clip, robot).clip, robot, "test")
    (trial,) = follow(motion, robot=robot, starts=1)
    assert not trial.fallen and trial.solver_failures == 0
    assert 0.0 < np.degrees(trial.joint_rms) < 3.0
    assert 0.0 < trial.body_error < 0.02 and trial.body_error_root < 0.02


def test_a_hard_push_is_a_fall_and_standing_is_none() -> None:
    robot = robot_named("humanoid")
    (fallen,) = follow("standing", robot=robot, starts=1, impulse=200.0)
    assert fallen.fallen and fallen.push is not None and fallen.push["impulse"] == 200.0
    (still,) = follow("standing", robot=robot, starts=1)
    assert not still.fallen


def test_standing_still_is_an_error_of_zero() -> None:
    (still,) = follow("standing", robot=robot_named("humanoid"), starts=1)
    assert still.body_error_last < 3e-3


def test_soles_elsewhere_move_the_legs_and_leave_the_rest() -> None:
    """A stance turned by 40°, moved, and with one sole 3 cm ahead: the CoM and the arms turn with
    it, the soles are where they are said to be."""
    robot = robot_named("humanoid")
    bodies, standing = ReferenceBodies(load_motion("standing", robot), robot), _standing(robot)
    turn = Rotation.from_euler("z", 40.0, degrees=True)
    moved = standing.points + [[0.03, 0.0, 0.0], [-0.03, 0.0, 0.0]]
    stance = Stance(turn.apply(moved) + [1.0, 2.0, 0.0], turn.as_matrix() @ standing.axes,
                    turn.apply([1.0, 0.0, 0.0])[:2])  # fmt: skip
    places, before = bodies.at(0.0, stance)[1], bodies.at(0.0, standing)[1]
    back = turn.inv().apply(places - [1.0, 2.0, 0.0])
    names = [robot.model.body(body).name for body in bodies.bodies]
    feet = [names.index(robot.model.body(sole.body_id).name) for sole in robot.soles]
    assert back[feet] == pytest.approx(before[feet] + moved - standing.points, abs=1e-4)
    arms = [i for i, name in enumerate(names) if "arm" in name]
    assert len(arms) == 4 and np.ptp(back[arms] - before[arms], axis=0).max() < 1e-4


def test_a_fall_is_relative_to_the_motion() -> None:
    """At half of the standing height a robot lies where the motion stands, not where it squats."""
    robot = robot_named("humanoid")
    env = ResidualBalanceEnv(robot, pushes=None)
    env.reset(seed=0, options={"noise": 0.0})
    state = env.simulation.state_arrays
    state.com[2] = state.origin[2] + 0.5 * robot.height_com
    standing = load_motion("standing", robot)
    low = replace(standing, coeffs=standing.coeffs.copy())
    low.coeffs[:, 0, -4] = 0.6 * robot.height_com
    assert lies(env, ReferenceBodies(standing, robot))
    assert not lies(env, ReferenceBodies(low, robot))
    state.com[2] = state.origin[2] + robot.height_com
    bowed = replace(standing, coeffs=standing.coeffs.copy())
    bowed.coeffs[:, 0, -2] = np.radians(100.0)
    assert lies(env, ReferenceBodies(bowed, robot))  # it does not bow
    assert not lies(env, ReferenceBodies(standing, robot))


def test_the_reference_s_bodies_are_those_of_standing() -> None:
    robot = robot_named("humanoid")
    simulation = Simulation(robot)
    state, data = simulation.reset(robot.standing_qpos), simulation.data
    bodies = ReferenceBodies(load_motion("standing", robot), robot)
    joints, places = bodies.at(0.3, Stance.of(state))
    assert joints == pytest.approx(robot.standing_qpos[7:], abs=1e-9)
    assert np.abs(places - data.xpos[bodies.bodies]).max() < 1e-6


def _standing(robot: Robot) -> Stance:
    simulation = Simulation(robot)
    return Stance.of(simulation.reset(robot.standing_qpos))


def test_what_follows_no_motion_is_said() -> None:
    with pytest.raises(ConfigError, match="'zero' follows no motion"):
        follow("standing", "zero", robot=robot_named("humanoid"), starts=1)
    with pytest.raises(ConfigError, match="starts: must be at least 1"):
        follow("standing", starts=0)
    with pytest.raises(ConfigError, match="seed: must be at least 0"):
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
