"""The state machine that marks time."""

import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config, load_controller
from poise.baselines.walking.simbicon import Placement, Pose, Simbicon, SimbiconConfig
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from tests.support.refused import invalid
from tests.support.shared import generic_state, robot


def first_tick(config=None):
    """A controller that has seen a moving, turned state, that state, and the torques."""
    simulation = generic_state()
    controller = Simbicon(robot(), config)
    controller.reset(simulation.state)
    targets = Targets.standing(robot(), simulation.state)
    return controller, simulation.state, controller.torques(simulation.state, targets)


def test_feet_go_where_the_centre_of_mass_goes():
    """θ_d = θ_d0 + c_d d + c_v v in both planes, in the heading of the start."""
    config = SimbiconConfig(sagittal=Placement(0.4, 0.7), frontal=Placement(0.3, 0.2), width=0.1)
    controller, state, _ = first_tick(config)
    h, omega = robot().height_com, controller.rate
    ahead, left = state.heading, np.array([-state.heading[1], state.heading[0]])
    ankle = state.sole_points[1] + state.sole_axes[1][:, :2] @ controller.ankles[1]
    d, v = state.com[:2] - ankle[:2], state.com_vel[:2]
    found = controller.placement(state, Pose(swing_hip=0.25))
    assert controller.foot == 0  # the left one, whose width counts to the left
    expected = 0.25 + 0.4 * (d @ ahead) / h + 0.7 * (v @ ahead) / (h * omega)
    assert found[0] == pytest.approx(expected)
    expected = 0.1 + 0.3 * (d @ left) / h + 0.2 * (v @ left) / (h * omega)
    assert found[1] == pytest.approx(expected)


def test_the_stance_hip_bears_what_the_trunk_needs():
    """Hips together turn the pelvis by the trunk's PD moment, whatever the swing hip does."""
    config = SimbiconConfig()
    controller, state, _ = first_tick(config)
    heading = np.eye(3)
    heading[:2, :2] = [[state.heading[0], -state.heading[1]], [state.heading[1], state.heading[0]]]
    moments = []
    for hip in (0.0, 0.5):
        tau = np.zeros(len(state.q))
        controller._hips(state, Pose(swing_hip=hip), heading, tau)
        on_pelvis = np.zeros(3)
        for i, leg in enumerate(controller.legs):
            on_pelvis -= state.J[6 * i + 3 : 6 * i + 6, 6 + leg.hip] @ tau[leg.hip]
        moments.append(on_pelvis)
    np.testing.assert_allclose(moments[0], moments[1], atol=1e-9)
    tilt = 0.5 * np.cross(heading @ state.robot.root_standing, state.root_axes, axis=0).sum(axis=1)
    spin = state.root_axes @ state.qvel[3:6]
    stiffness = controller.moment * config.trunk.stiffness
    expected = -stiffness * (tilt + config.trunk.damping / controller.rate * spin)
    np.testing.assert_allclose(moments[0], expected, atol=1e-9)


def test_the_pendulums_force_passes_through_ankle_and_centre_of_mass():
    """No moment about either; its vertical part is the weight."""
    controller, state, _ = first_tick()
    for sole in range(2):
        w = controller._pendulum_force(state, sole)
        force, moment = w[6 * sole : 6 * sole + 3], w[6 * sole + 3 : 6 * sole + 6]
        arm = state.sole_points[sole] - state.com
        np.testing.assert_allclose(np.cross(arm, force) + moment, 0.0, atol=1e-9)
        assert force[2] == pytest.approx(state.mass * state.robot.gravity)
        assert np.count_nonzero(w) == 6


def test_states_follow_each_other_by_time_and_by_touchdown():
    """Lift ends after its time; lowering with contact of the swing foot, and not before."""
    simulation = Simulation(robot())
    controller = Simbicon(robot(), SimbiconConfig(lift_time=0.5, first=1.0))
    targets = Targets.standing(robot(), simulation.state)
    contacts = simulation.state_arrays.contacts
    stages = []
    for k in range(120):
        contacts[:] = 1.0 if k > 60 else [0.0, 1.0]
        controller.torques(simulation.state, targets)
        stages.append(controller.stage)
    lift = int(0.5 / controller.rate / controller.period)
    assert stages[lift - 1] == 0 and stages[lift + 1] == 1
    assert stages[60] == 1 and stages[61] == 2
    assert stages[61 + lift - 2] == 2 and stages[61 + lift + 2] in (3, 0)
    assert controller.steps >= 1


def test_both_feet_do_the_same():
    """A step is the other's mirror image, but for a spring that one knee of the model has."""
    simulation = Simulation(robot())
    state, targets = simulation.state, Targets.standing(robot(), simulation.state)
    controller = Simbicon(robot())
    torques = []
    for stage in (0, 2):
        controller.reset(state)
        controller.stage = stage
        torques.append(controller.torques(state, targets))
    names = [robot().joint_names[dof - 6] for dof in robot().motor_dofs]
    for name in ("hip_x", "hip_y", "hip_z", "knee", "ankle_y", "ankle_x"):
        left, right = names.index(f"left_{name}"), names.index(f"right_{name}")
        assert torques[0][left] == pytest.approx(torques[1][right], abs=1.0)
        assert torques[0][right] == pytest.approx(torques[1][left], abs=1.0)


def test_it_marks_time():
    """Three seconds: up, feet lifted in turn, 2 to 5 steps a second, still near its place."""
    env = ResidualBalanceEnv(robot(), controller="simbicon", pushes=None, duration=3.0)
    env.reset(seed=3)
    state = env.simulation.state
    heights = np.zeros(2)
    start = state.com[:2].copy()
    for _ in range(env.max_steps):
        _, fallen, _ = env.step_without_info(np.zeros(4))
        assert not fallen
        heights = np.maximum(heights, state.sole_points[:, 2])
    assert 6 <= env.controller.steps <= 15
    assert heights.min() > 0.03
    assert np.linalg.norm(state.com[:2] - start) < 0.3


def played(command, seconds, seed=1):
    """The environment after a walk by a command, and the CoM (n, 2) at its policy steps."""
    env = ResidualBalanceEnv(robot(), controller="simbicon", pushes=None, duration=seconds)
    env.reset(seed=seed, options={"command": command})
    places = []
    for _ in range(env.max_steps):
        env.step_without_info(np.zeros(4))
        places.append(env.simulation.state.com[:2].copy())
    return env, np.array(places)


@pytest.mark.parametrize("ahead", [0.2, 0.5, -0.15])
def test_it_walks_at_a_commanded_velocity(ahead):
    """Reached within 0.05 m/s after 6 s, straight ahead; the law has v − v_d in the place of v."""
    env, places = played({"ahead": ahead}, 9.0)
    assert not env.fallen and env.controller.command.ahead == ahead
    velocity = (places[-1] - places[-151]) / 3.0
    assert velocity[0] == pytest.approx(ahead, abs=0.05) and abs(velocity[1]) < 0.05


def test_it_turns():
    """The planes of its law turn with the command."""
    env, _ = played({"ahead": 0.2, "turn": 0.2}, 6.0)
    assert not env.fallen
    assert env.simulation.state.heading_yaw == pytest.approx(0.2 * 6.0, abs=0.25)


def test_what_it_does_not_follow_is_refused():
    """Step parameters are those of `walk`; the error says what it follows."""
    env = ResidualBalanceEnv(robot(), controller="simbicon", pushes=None, duration=1.0)
    with invalid("command.width"):
        env.reset(seed=0, options={"command": {"ahead": 0.2, "width": 0.2}})


def test_nothing_is_left_after_a_reset():
    """The state machine starts anew, heading included."""
    controller, state, first = first_tick()
    for _ in range(100):
        controller.torques(state, Targets.standing(robot(), state))
    controller.reset(state)
    assert controller.stage == controller.steps == 0
    again = controller.torques(state, Targets.standing(robot(), state))
    np.testing.assert_array_equal(first, again)


def test_packaged_configuration_and_wrong_fields():
    """`simbicon` is packaged; an unknown field of a pose is named."""
    assert isinstance(controller_config("simbicon"), SimbiconConfig)
    with pytest.raises(ConfigError, match="swing_hop"):
        load_controller({"kind": "simbicon", "lift": {"swing_hop": 1.0}}, robot())
