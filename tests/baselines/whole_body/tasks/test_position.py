"""The task of a point's place."""

import numpy as np
import pytest

from poise.baselines import MomentumQP, Targets
from poise.baselines.registry import controller_config
from poise.baselines.whole_body.parts.part import bind_parts
from poise.baselines.whole_body.tasks.position import Position
from poise.envs.physics.body_points import point_motion
from poise.envs.physics.simulation import Simulation
from tests.support.physics import robot_named
from tests.support.shared import generic_state
from tests.support.tasks import filled

ROBOT = robot_named("humanoid")
HAND = {"body": "right_lower_arm", "point": (0.18, 0.18, 0.18)}


def bound(**gains):
    """The task of the right hand."""
    return bind_parts({"hand": Position(**HAND, **gains)}, ROBOT, "tasks")["hand"]


@pytest.mark.parametrize("frame", ["heading", "com"])
def test_standing_is_what_it_wants(frame):
    """At rest in the standing posture nothing is asked for; the soles stand 1e-9 m below z = 0."""
    rows = filled(bound(frame=frame), Simulation(ROBOT).state)
    np.testing.assert_allclose(rows.b, 0.0, atol=1e-6)


@pytest.mark.parametrize("frame", ["heading", "world", "com"])
def test_the_reference_is_of_its_frame(frame):
    """k times the way to a place, d times the velocity, and the acceleration, all turned alike."""
    state, height, ω = generic_state().state, ROBOT.height_com, ROBOT.omega
    task = bound(frame=frame, place=(0.3, -0.2, 1.1), stiffness=9.0, damping_ratio=0.5)
    task.block.reference[1:] = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    cos, sin = state.heading if frame != "world" else (1.0, 0.0)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    origin = {"heading": state.origin, "world": np.zeros(3), "com": state.com}[frame]
    still = float(frame == "com")  # the frame moves with the CoM
    motion, k, d = point_motion(state, task.block.point), 9.0 * ω**2, 3.0 * ω
    speed = motion.J_v[:3] - still * state.com_vel
    wanted = turn @ [4.0, 5.0, 6.0] + d * (turn @ [1.0, 2.0, 3.0] - speed)
    wanted += k * (origin + height * turn @ [0.3, -0.2, 1.1] - motion.position)
    rows = filled(task, state)
    bias = motion.Jdot_v[:3] - still * state.Adot_v[:3] / state.mass
    np.testing.assert_allclose(rows.b, wanted - bias, atol=1e-9 * k)
    np.testing.assert_allclose(rows.weights, 1.0 / ROBOT.units.gravity**2)


def test_a_hand_goes_where_its_task_wants_it():
    """Two seconds of standing: the hand is within 2 cm of a place 0.3 m off, the robot stands."""
    task = {"kind": "position", **{k: list(v) if k == "point" else v for k, v in HAND.items()}}
    config = controller_config(
        {"base": "momentum-qp", "tasks": {"hand": {**task, "weight": 100.0}}}
    )
    controller, simulation = MomentumQP(ROBOT, config), Simulation(ROBOT)
    state, block = simulation.state, controller.tasks["hand"].block
    targets = Targets.standing(ROBOT, state)
    block.reference[0] += [0.15, -0.1, 0.24]
    controller.reset(state)
    for _ in range(500):
        state = simulation.step(controller.torques(state, targets), 2)
    away = np.linalg.norm(point_motion(state, block.point).position - block.reference[0])
    assert away < 0.02 and controller.failures == 0
    assert np.linalg.norm(state.com_vel) < 0.01 and state.support_distance(state.com) > 0.02
