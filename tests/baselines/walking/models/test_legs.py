"""Hips, ankles and knees of robots, against their joints' anchors in MuJoCo."""

import mujoco
import numpy as np
import pytest

from poise.baselines.walking.models.legs import leg_arrays, measure_legs
from poise.baselines.walking.models.two_rods import length_at
from poise.envs.physics.legs import find_legs
from poise.envs.physics.simulation import Simulation
from poise.envs.robots.robot import load_robot
from tests.support.refused import invalid
from tests.support.shared import generic_state, robot
from tests.support.small_biped import LEG, write_biped


@pytest.mark.parametrize("name", ["humanoid", "toddler", "tall"])
def test_places_and_flexions(name):
    """The hip is so far from the ankle as the rods and the flexion say, at any posture."""
    one = load_robot(name)
    simulation = generic_state() if name == "humanoid" else Simulation(one)
    legs, state = leg_arrays(one), simulation.state
    measure_legs(state.arrays, legs)
    data, model = simulation.data, one.model
    for i, leg in enumerate(find_legs(one)):
        hip, ankle = (data.xanchor[model.joint(joint).id] for joint in (leg.hip, leg.ankle))
        np.testing.assert_allclose(legs.hip[i], hip, atol=1e-12)
        np.testing.assert_allclose(legs.ankle[i], ankle, atol=1e-12)
        distance = np.linalg.norm(hip - ankle)
        assert length_at(legs.thigh, legs.shank, legs.flexion[i]) == pytest.approx(
            distance, abs=2e-3
        )
        assert legs.flexion[i] > 0.0
        rate = legs.knee_sign[i] * data.qvel[model.joint(leg.knee).dofadr[0]]
        assert legs.flexion_rate[i] == pytest.approx(rate)


def test_a_hip_that_turns_forward_turns_the_thigh_forward():
    """The sign of the hip: a little more of its angle brings the knee ahead."""
    legs, model = leg_arrays(robot()), robot().model
    simulation = Simulation(robot())
    for i, leg in enumerate(find_legs(robot())):
        before = simulation.data.xanchor[model.joint(leg.knee).id].copy()
        joint = model.joint(leg.hip)
        turned = Simulation(robot())
        turned.data.qpos[joint.qposadr[0]] += 0.1 * legs.hip_sign[i]
        mujoco.mj_kinematics(model, turned.data)
        assert turned.data.xanchor[model.joint(leg.knee).id][0] > before[0] + 0.01


def test_a_leg_without_a_knee_is_refused(tmp_path):
    stiff = LEG.replace('<joint name="{side}_knee" axis="0 1 0" range="5 150"/>', "")
    path = write_biped(tmp_path, leg=stiff, extra="", torque_limits={"*": 50}, posture={})
    with invalid("gait.model"):
        leg_arrays(load_robot(path))
