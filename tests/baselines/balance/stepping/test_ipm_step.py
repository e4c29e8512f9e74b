"""Footholds by the energy of an inverted pendulum."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from poise.baselines.balance.stepping.ipm_step import IPMStep, energy_foothold, rest_distance
from poise.baselines.balance.stepping.planning.config import (
    FootholdChoice,
    IPMStepConfig,
    SignalGains,
    StepFeedback,
    StepLimits,
)
from poise.baselines.controller import Targets
from poise.baselines.registry import controller_config, load_controller
from poise.envs.compiled.maths.pendulum import pendulum
from poise.envs.compiled.maths.polygons import nearest_inside
from tests.baselines.balance.stepping.test_capture_step import trial
from tests.support import planned
from tests.support.shared import generic_state, robot
from tests.support.stepping_reference import drifted

HEIGHT, GRAVITY = 0.8, 9.81
OMEGA = float(np.sqrt(GRAVITY / HEIGHT))


def moved(c, velocity, p, omega, t):
    """`pendulum` along both axes."""
    return np.array([pendulum(*axis, omega, t) for axis in zip(c, velocity, p, strict=True)]).T


@pytest.mark.parametrize("speed", [0.1, 0.6, 1.5])
def test_a_linear_pendulum_has_no_energy_left(speed):
    """½ ẋ² − ½ ω² x² = 0, and it needs for ever to stand still over the foot."""
    x = rest_distance(speed, OMEGA, HEIGHT, 0.0)
    assert 0.5 * speed**2 - 0.5 * OMEGA**2 * x**2 == pytest.approx(0.0, abs=1e-12)
    c, velocity = pendulum(0.0, speed, x, OMEGA, 3.0)
    assert abs(c - x) < 1e-3 and abs(velocity) < 1e-3


@pytest.mark.parametrize("speed", [0.1, 0.6, 1.5])
def test_a_rigid_leg_just_stands_up(speed):
    """A pendulum of constant length comes upright with speed 0: kinetic energy is height gained."""
    x = rest_distance(speed, OMEGA, HEIGHT, 1.0)
    length = np.hypot(x, HEIGHT)
    assert 0.5 * speed**2 == pytest.approx(GRAVITY * (length - HEIGHT))
    assert x > rest_distance(speed, OMEGA, HEIGHT, 0.0)


def test_the_pendulum_moves_by_its_equation():
    """c̈ = ω² (c − p), integrated numerically; the capture point is where it is `drifted` to."""
    c, v, p, t = np.array([0.02, -0.01]), np.array([0.4, 0.1]), np.array([0.05, 0.09]), 0.3
    end = solve_ivp(
        lambda _, y: np.concatenate([y[2:], OMEGA**2 * (y[:2] - p)]),
        (0.0, t), np.concatenate([c, v]), rtol=1e-10, atol=1e-12,
    ).y[:, -1]  # fmt: skip
    position, velocity = moved(c, v, p, OMEGA, t)
    np.testing.assert_allclose(np.concatenate([position, velocity]), end, atol=1e-8)
    xi = drifted(c + v / OMEGA, p, OMEGA, t)
    np.testing.assert_allclose(position + velocity / OMEGA, xi, atol=1e-12)


def planner(arc, lateral_offset=0.0, feedback=None, **limits):
    """A planner with wide limits."""
    wide = {"ahead": 9.0, "behind": 9.0, "width_min": 1e-3, "width_max": 9.0, "speed": 99.0}
    return planned.Planner(
        robot(), StepLimits(**{**wide, "side_speed": 99.0, **limits}),
        FootholdChoice(lateral_offset=lateral_offset), feedback, rule=energy_foothold, arc=arc,
    )  # fmt: skip


@pytest.mark.parametrize("foot", [0, 1])
def test_a_policy_and_the_configuration_move_footholds(foot):
    """`lateral_offset` and feedback [h] to the foot's own side, the policy's offset as it is."""
    state = generic_state().state.copy()
    times, yaw, start = np.array([0.3]), state.heading_yaw, state.sole_points[foot, :2]
    feedback = StepFeedback(ahead=SignalGains(0.03), outward=SignalGains(0.04))
    plain, moved = planner(0.5), planner(0.5, lateral_offset=0.05, feedback=feedback)
    moved.offsets.foothold[:] = 0.02, -0.01
    (before,), _ = planned.footholds(plain, state, foot, yaw, times, start)
    (after,), _ = planned.footholds(moved, state, foot, yaw, times, start)
    side = 1.0 if foot == 0 else -1.0  # the left foot is the first
    cos, sin = state.heading
    local = np.array([[cos, sin], [-sin, cos]]) @ (after - before)
    h = robot().height_com
    np.testing.assert_allclose(local, [0.03 * h + 0.02, side * 0.09 * h - 0.01], atol=1e-12)


def test_another_configuration_is_refused():
    """The planner needs its `arc`."""
    with pytest.raises(TypeError, match="must be an IPMStepConfig"):
        IPMStep(robot(), controller_config("capture-step"))


def test_without_limits_a_linear_pendulum_steps_onto_the_capture_point():
    """The middle of the sole's reach comes under ξ(T); a rigid leg steps further."""
    state = generic_state().state.copy()
    state.arrays.com_vel[:2] = 0.5 * state.heading + 0.2 * np.array([-1, 1]) * state.heading[::-1]
    state.arrays.capture_point[:] = state.com[:2] + state.com_vel[:2] / state.omega
    times, yaw, start = np.array([0.25, 0.35]), state.heading_yaw, state.sole_points[0, :2]
    found = {}
    for arc in (0.0, 1.0):
        plan = planner(arc)
        footholds, cut = planned.footholds(plan, state, 0, yaw, times, start)
        cos, sin = state.heading
        found[arc] = footholds + np.array([[cos, -sin], [sin, cos]]) @ plan.region.middle[0]
        np.testing.assert_allclose(cut, 0.0, atol=1e-12)
    under = planned.alone(plan.region, 1, state.sole_points[1], yaw)
    p = nearest_inside(under, state.capture_point)
    for k, t in enumerate(times):
        xi = drifted(state.capture_point, p, state.omega, t)
        np.testing.assert_allclose(found[0.0][k], xi, atol=1e-9)
        c, _ = moved(state.com[:2], state.com_vel[:2], p, state.omega, t)
        assert np.linalg.norm(found[1.0][k] - c) > np.linalg.norm(xi - c)


def test_limits_hold_and_say_what_they_cost():
    """A foothold stays in its box; the cost is how far that is from the one wanted."""
    state = generic_state().state.copy()
    narrow = planner(0.0, ahead=0.1, behind=0.1, width_min=0.19, width_max=0.2)
    far = planner(0.0)
    times, yaw, start = np.array([0.3]), state.heading_yaw, state.sole_points[0, :2]
    for velocity in (1.5, -1.5):
        state.arrays.com_vel[:2] = velocity * state.heading
        state.arrays.capture_point[:] = state.com[:2] + state.com_vel[:2] / state.omega
        held, cost = planned.footholds(narrow, state, 0, yaw, times, start)
        free, _ = planned.footholds(far, state, 0, yaw, times, start)
        cos, sin = state.heading
        local = (held[0] - state.sole_points[1, :2]) @ np.array([[cos, -sin], [sin, cos]])
        assert abs(local[0]) <= 0.1 * narrow.units.height + 1e-9
        assert 0.19 * narrow.units.height - 1e-9 <= local[1] <= 0.2 * narrow.units.height + 1e-9
        if velocity > 0.0:
            assert cost[0] == pytest.approx(np.linalg.norm(held[0] - free[0]))


def test_a_step_recovers_what_feet_in_place_do_not():
    """Half above the baseline's limit, forward: it steps and comes to rest."""
    fallen, env = trial("ipm-step", 23.0, 0.0, duration=6.0)
    assert not fallen and env.recovered and env.controller.steps >= 1


def test_packaged_configuration():
    """`ipm-step` has the gains of `capture-step`, its own planner and one step time."""
    config = controller_config("ipm-step")
    assert type(config) is IPMStepConfig
    assert config.qp == controller_config("capture-step").qp
    assert config.limits.time_min == config.limits.time_max
    controller = load_controller(config, robot())
    assert isinstance(controller, IPMStep)
    state, targets = generic_state().state, Targets.standing(robot(), generic_state().state)
    search = controller.tick(state, targets).search
    assert search.foothold_rule.kernel is energy_foothold and search.arc == config.arc
