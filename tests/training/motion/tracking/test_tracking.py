"""Where a motion has the bodies, for soles that stand somewhere; falls relative to it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.balance.references.motion import load_motion
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import Robot
from poise.training.motion.tracking.record import LANDING, LIFTED, FeetRecord, Tracking, lies
from poise.training.motion.tracking.reference import ReferenceBodies, SolePlaces
from tests.support.physics import robot_named


def test_soles_elsewhere_move_the_legs_and_leave_the_rest() -> None:
    """A stance turned by 40°, moved, and with one sole 3 cm ahead: the CoM and the arms turn with
    it, the soles are where they are said to be."""
    robot = robot_named("humanoid")
    bodies, standing = ReferenceBodies(load_motion("standing", robot), robot), _standing(robot)
    turn = Rotation.from_euler("z", 40.0, degrees=True)
    moved = standing.points + [[0.03, 0.0, 0.0], [-0.03, 0.0, 0.0]]
    stance = SolePlaces(turn.apply(moved) + [1.0, 2.0, 0.0], turn.as_matrix() @ standing.axes,
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
    assert lies(env)
    env.motion = low
    assert not lies(env)
    state.com[2] = state.origin[2] + robot.height_com
    bowed = replace(standing, coeffs=standing.coeffs.copy())
    bowed.coeffs[:, 0, -2] = np.radians(100.0)
    env.motion = bowed
    assert lies(env)  # it does not bow
    env.motion = standing
    assert not lies(env)


def test_the_reference_s_bodies_are_those_of_standing() -> None:
    robot = robot_named("humanoid")
    simulation = Simulation(robot)
    state, data = simulation.reset(robot.standing_qpos), simulation.data
    bodies = ReferenceBodies(load_motion("standing", robot), robot)
    joints, places = bodies.at(0.3, SolePlaces.of(state))
    assert joints == pytest.approx(robot.standing_qpos[7:], abs=1e-9)
    assert np.abs(places - data.xpos[bodies.bodies]).max() < 1e-6


def _standing(robot: Robot) -> SolePlaces:
    simulation = Simulation(robot)
    return SolePlaces.of(simulation.reset(robot.standing_qpos))


def test_the_record_ends_after_the_motion_and_after_the_push() -> None:
    """3 s after a motion of 1 s; 6 s after a push; at a fall."""
    env = ResidualBalanceEnv(robot_named("humanoid"), pushes=None, duration=60.0)
    env.reset(seed=0)
    alone, pushed = Tracking(env), Tracking(env, [2.0])
    env.simulation.clock.steps = round(3.98 / env.arrays.timestep)
    assert not alone.ended and not pushed.ended
    env.simulation.clock.steps = round(4.0 / env.arrays.timestep)
    assert alone.ended and not pushed.ended
    env.simulation.clock.steps = round(8.0 / env.arrays.timestep)
    assert pushed.ended
    assert np.isnan(alone.figures().body_error)  # no step was taken


@pytest.mark.parametrize(("off", "slide"), [(LIFTED, 0.01), (LIFTED - 1, 0.3)])
def test_a_slide_is_measured_from_the_last_landing(
    off: int, slide: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A step of 0.3 m is no slide, what the sole then creeps is; a sole that loses contact for less
    than 0.1 s has not stepped."""
    monkeypatch.setattr(SolePlaces, "of", lambda state: None)
    both, points = np.ones(2), np.zeros((2, 3))
    state = cast(Any, SimpleNamespace(contacts=both, sole_points=points))
    footing = FeetRecord(state)
    for _ in range(LANDING):
        footing.update(state)
    state.contacts = np.array([0.0, 1.0])
    for k in range(off):
        points[0, 0] = 0.3 * (k + 1) / off
        footing.update(state)
    state.contacts = both
    footing.update(state)
    if off >= LIFTED:
        assert footing.slide == 0.0
        points[0, 1] = 0.01
        footing.update(state)
    assert footing.slide == pytest.approx(slide)
