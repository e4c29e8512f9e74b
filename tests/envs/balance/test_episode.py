"""Falls, quiet time, effort and the reward of one policy step."""

import mujoco
import numpy as np
import pytest

from poise.envs.balance.episode import (
    EpisodeArrays,
    Judge,
    Metrics,
    begin_episode,
    judge_step,
    record_tick,
)
from poise.envs.balance.mdp.observation import scales
from poise.envs.balance.mdp.reward import REWARD_TERMS, RewardView, RewardWeights, rewards
from poise.envs.balance.mdp.termination import FallLimits, episode_limits, has_fallen
from poise.envs.physics.simulation import Simulation
from tests.support.shared import generic_state, robot


def new_episode(actions, nc=2):
    """An empty record."""
    sizes = {"na": actions, "no": 1, "terms": len(REWARD_TERMS), "nc": nc, "past": 0}
    return EpisodeArrays.allocate(sizes | {"nu": robot().model.nu}, metrics=Metrics.allocate())


def play(simulation, limits=None, weights=None, tau=None, q_ref=None, time=0.5, actions=3, e=None,
         velocity_error=(0.0, 0.0, 0.0)):  # fmt: skip
    """One judged step; returns reward and episode."""
    r = simulation.robot
    if e is None:
        e = new_episode(actions, len(r.soles))
        begin_episode(simulation.state_arrays, e)
        e.action[:], e.last_action[:] = [0.5, -0.25, 0.0], [0.1, 0.1, -0.1]
    simulation.views.ctrl[:] = 0.0 if tau is None else tau
    simulation.clock.steps = round(time / simulation.arrays.timestep)
    bounds = episode_limits(limits or FallLimits(), r.height_com, 100, 50)
    view = RewardView(
        robot=simulation.arrays,
        state=simulation.state_arrays,
        scales=scales(simulation.arrays, Simulation(r).state.support_polygon),
        limits=bounds,
        q_ref=r.standing_qpos[7:].copy() if q_ref is None else q_ref,
        views=simulation.views,
        action=e.action,
        last_action=e.last_action,
        velocity_error=np.array(velocity_error),
        command=np.zeros(3),
    )
    judge_step(
        Judge(
            robot=simulation.arrays,
            views=simulation.views,
            state=simulation.state_arrays,
            clock=simulation.clock,
            limits=bounds,
            rewards=rewards(weights or RewardWeights(), view),
            episode=e,
        )
    )
    return float(e.reward), e


def test_each_reward_term_is_its_formula():
    """At a generic state every term equals its definition times its weight."""
    simulation = generic_state()
    state, r = simulation.state, robot()
    assert not fallen(simulation)
    tau = np.random.default_rng(0).uniform(-1.0, 1.0, r.model.nu) * r.torque_limit
    reward, e = play(simulation, tau=tau)
    terms = dict(zip(REWARD_TERMS, e.reward_terms, strict=True))

    cos, sin = state.heading
    polygon = Simulation(r).state.support_polygon
    half = np.ptp(polygon, axis=0) / 2

    def squared(point):
        x, y = point[:2] - state.origin[:2]
        return np.sum((np.array([cos * x + sin * y, cos * y - sin * x]) / half) ** 2)

    tilt = state.root_axes[2] @ simulation.arrays.root_standing[2]
    speed = np.linalg.norm(state.com_vel)
    expected = {
        "alive": 1.0,
        "com": np.exp(-4 * squared(state.com)),
        "capture": np.exp(-2 * squared(state.capture_point)),
        "upright": tilt**4,
        "quiet": np.exp(-((speed / 0.1) ** 2) / 4),
        "posture": np.exp(-np.sum((state.q - r.standing_qpos[7:]) ** 2)),
        "effort": -np.mean((tau / r.torque_limit) ** 2),
        "action": -(0.5**2 + 0.25**2) / 3,
        "action_rate": -(0.4**2 + 0.35**2 + 0.1**2) / 3 / 4,
        "fall": 0.0,
    }
    for name, value in expected.items():
        weight = getattr(RewardWeights(), name)
        assert terms[name] == pytest.approx(weight * value, rel=1e-9, abs=1e-15), name
    assert reward == pytest.approx(sum(terms.values()), rel=1e-12)


def test_little_angular_momentum_is_rewarded():
    """exp(−(|L| / 0.1 m h² ω)²), if it has a weight."""
    simulation = generic_state()
    r = robot()
    unit = 0.1 * r.mass * r.height_com**2 * np.sqrt(9.81 / r.height_com)
    simulation.state_arrays.momentum[3:] = 0.3 * unit, -0.5 * unit, 0.2 * unit
    _, e = play(simulation, weights=RewardWeights(angular_momentum=2.0))
    expected = 2.0 * np.exp(-(0.3**2) - 0.5**2 - 0.2**2)
    assert e.reward_terms[REWARD_TERMS.index("angular_momentum")] == pytest.approx(expected)


def test_terms_of_the_velocity_tasks():
    """Slow, not turning, away from joint limits, without slipping; if they have weights."""
    simulation, r = generic_state(), robot()
    s, omega = simulation.state_arrays, np.sqrt(9.81 / robot().height_com)
    unit = 0.2 * omega * r.height_com
    s.com_vel[:] = 0.3 * unit, -0.4 * unit, 5.0
    s.qvel[3:6] = 0.1 * omega, -0.2 * omega, 0.3 * omega
    low, high = r.joint_range.T
    s.qpos[7:] = 0.5 * (low + high)
    s.qpos[7], s.qpos[8], s.qpos[9] = high[0] - 0.02 * (high - low)[0], low[1] - 1.0, low[2]
    s.qpos[9] += 0.051 * (high - low)[2]
    s.contacts[:] = 1.0, 0.0
    s.J_v[:3], s.J_v[6:8] = (0.6 * unit, 0.2 * unit, 9.0), (unit, unit)
    weights = {"velocity": 2.0, "turning": 3.0, "joint_limits": 4.0, "slip": 5.0}
    _, e = play(simulation, weights=RewardWeights(**weights))
    terms = dict(zip(REWARD_TERMS, e.reward_terms, strict=True))
    assert terms["velocity"] == pytest.approx(2.0 * np.exp(-0.25))
    assert terms["turning"] == pytest.approx(3.0 * np.exp(-0.14 / 0.25))
    assert terms["joint_limits"] == pytest.approx(-4.0 * (0.6 + 1.0) / len(low))
    assert terms["slip"] == pytest.approx(-5.0 * 0.4 / 2)
    s.J_v[:2] = 2.0 * unit  # counts as 1
    _, e = play(simulation, weights=RewardWeights(slip=5.0))
    assert e.reward_terms[REWARD_TERMS.index("slip")] == pytest.approx(-2.5)


def test_tracking_a_command():
    """exp(−(|Δv| / 0.02 ω h)² − (Δψ̇ / 0.05 ω)²), if it has a weight."""
    simulation, r = generic_state(), robot()
    omega = np.sqrt(9.81 / r.height_com)
    way = 0.02 * omega * r.height_com
    error = (0.3 * way, -0.4 * way, 0.6 * 0.05 * omega)
    _, e = play(simulation, weights=RewardWeights(tracking=2.0), velocity_error=error)
    expected = 2.0 * np.exp(-0.25 - 0.36)
    assert e.reward_terms[REWARD_TERMS.index("tracking")] == pytest.approx(expected)


def test_pace_tells_from_afar_how_far_a_walk_is_from_its_command():
    """exp(−(|Δv| / 0.06 ω h)²), where tracking is zero, and whatever the turn."""
    simulation, r = generic_state(), robot()
    way = 0.06 * np.sqrt(9.81 / r.height_com) * r.height_com
    weights = RewardWeights(tracking=2.0, pace=3.0)
    _, e = play(simulation, weights=weights, velocity_error=(0.6 * way, -0.8 * way, 9.0))
    assert e.reward_terms[REWARD_TERMS.index("pace")] == pytest.approx(3.0 * np.exp(-1.0))
    assert e.reward_terms[REWARD_TERMS.index("tracking")] < 1e-3


def test_a_fall_costs_its_weight_and_earns_nothing():
    """In the step of the fall the positive terms are zero."""
    simulation = generic_state()
    simulation.state_arrays.other_contacts = 1.0
    reward, e = play(simulation)
    terms = dict(zip(REWARD_TERMS, e.reward_terms, strict=True))
    assert e.metrics.fallen == 1.0 and terms["fall"] == -RewardWeights().fall
    assert all(terms[name] == 0.0 for name in ("alive", "com", "capture", "quiet", "posture"))
    assert terms["action"] < 0.0
    assert reward == pytest.approx(sum(terms.values()))


def test_weights_scale_the_terms():
    """A weight of zero removes a term; another weight multiplies it."""
    simulation = generic_state()
    _, e = play(simulation, weights=RewardWeights(alive=0.0, action=7.0))
    assert e.reward_terms[REWARD_TERMS.index("alive")] == 0.0
    assert e.reward_terms[REWARD_TERMS.index("action")] == pytest.approx(-7.0 * 0.3125 / 3)


def test_a_diverged_simulation_costs_the_fall_alone():
    """What numbers that are none would give is not computed."""
    simulation = Simulation(robot())
    simulation.state_arrays.com[:] = np.nan
    simulation.views.warnings[2 * int(mujoco.mjtWarning.mjWARN_BADQACC)] = 1
    reward, e = play(simulation)
    assert reward == -RewardWeights().fall and np.count_nonzero(e.reward_terms) == 1


def test_terms_without_weight_give_nothing():
    """All of them off: the reward is 0."""
    simulation = generic_state()
    off = dict.fromkeys(REWARD_TERMS, 0.0)
    reward, e = play(simulation, weights=RewardWeights(**off))
    assert reward == 0.0 and not e.reward_terms.any()


def fallen(simulation, **limits):
    return has_fallen(
        simulation.arrays, simulation.state_arrays,
        episode_limits(FallLimits(**limits), simulation.robot.height_com, 100, 50),
    )  # fmt: skip


def test_what_a_fall_is():
    """Too low, too tilted, a hand on the ground, or numbers that are none."""
    simulation = Simulation(robot())
    s = simulation.state_arrays
    assert not fallen(simulation) and not fallen(simulation, height=0.99)
    s.com[2] = 0.59 * robot().height_com
    assert fallen(simulation)
    simulation.reset()
    s.other_contacts = 1.0
    assert fallen(simulation) and not fallen(simulation, ground_contact=False)
    simulation.reset()
    s.com_vel[2] = np.nan
    assert fallen(simulation)


def tilted(degrees, axis):
    """A simulation whose root is turned about a horizontal axis, nothing but feet touching."""
    simulation = Simulation(robot())
    qpos = robot().standing_qpos.copy()
    half = np.radians(degrees) / 2
    q, c, s = qpos[3:7].copy(), np.cos(half), np.sin(half)
    other = [-q[1], q[0], -q[3], q[2]] if axis == 0 else [-q[2], q[3], q[0], -q[1]]
    qpos[3:7] = c * q + s * np.array(other)
    simulation.reset(qpos)
    simulation.state_arrays.other_contacts = 0.0
    return simulation


@pytest.mark.parametrize("axis", [0, 1])
def test_the_tilt_limit_is_an_angle(axis):
    """50° about a horizontal axis falls with a limit of 49°, not with one of 51°."""
    simulation = tilted(50.0, axis)
    assert fallen(simulation, tilt=49.0, height=0.01)
    assert not fallen(simulation, tilt=51.0, height=0.01)


@pytest.mark.parametrize("axis", [0, 1])
def test_only_who_stands_upright_is_quiet(axis):
    """Tilted by 20° and at rest over the soles counts as quiet below a limit of 21°, not of 19°."""
    simulation = tilted(20.0, axis)
    s = simulation.state_arrays
    s.com[:2] = s.origin[:2]
    s.contacts[:] = 1.0  # tilted, one foot is in the air
    for limit, steps in ((21.0, 1.0), (19.0, 0.0)):
        _, e = play(simulation, time=0.02, limits=FallLimits(quiet_tilt=limit))
        assert e.metrics.fallen == 0.0
        assert e.metrics.quiet_steps == steps


def test_quiet_steps_count_and_start_again():
    """Quiet time grows while the CoM is slow and over the soles, and starts again if not."""
    simulation = Simulation(robot())
    s = simulation.state_arrays
    _, e = play(simulation, time=0.02)
    play(simulation, time=0.04, e=e)
    assert e.metrics.quiet_steps == 2.0 and e.metrics.last_moving == 0.0
    s.com_vel[0] = 0.11
    play(simulation, time=0.06, e=e)
    assert e.metrics.quiet_steps == 0.0 and e.metrics.last_moving == 0.06
    simulation.reset()
    s.com[0] += 0.5  # at rest, but not over the soles
    play(simulation, time=0.08, e=e)
    assert e.metrics.quiet_steps == 0.0 and e.metrics.last_moving == 0.08


def test_a_robot_that_skates_is_not_quiet():
    """A sole that has moved by more than 1 cm lets the count begin again, and only the count."""
    simulation = Simulation(robot())
    s = simulation.state_arrays
    _, e = play(simulation)
    counts = []
    for _ in range(4):
        s.sole_point[1, 1] += 0.006
        play(simulation, e=e)
        counts.append(e.metrics.quiet_steps)
    assert counts == [2.0, 0.0, 1.0, 0.0] and e.metrics.last_moving == 0.0


def test_a_sole_may_creep():
    """What counts is the way in the last second: 0.15 mm a step is less than 1 cm in 50 steps."""
    simulation = Simulation(robot())
    _, e = play(simulation)
    for steps in range(2, 150):
        simulation.state_arrays.sole_point[0, 0] += 0.00015
        play(simulation, e=e)
        assert e.metrics.quiet_steps == steps


def test_largest_excursions_are_kept():
    """Maxima of CoM, capture point and slide, and the smallest CoP margin, do not come back."""
    simulation = Simulation(robot())
    s = simulation.state_arrays
    _, e = play(simulation)
    margin = simulation.state.support_distance(simulation.state.cop)
    assert e.metrics.min_cop_margin == pytest.approx(margin)
    s.com[:2] = s.origin[:2] + [0.03, 0.04]
    s.capture_point[:] = s.origin[:2] + [-0.06, 0.08]
    s.cop[:] = s.origin[:2] + [5.0, 0.0]
    s.sole_point[1, 0] += 0.02
    play(simulation, e=e)
    simulation.reset()
    play(simulation, e=e)
    assert e.metrics.max_com == pytest.approx(0.05)
    assert e.metrics.max_capture == pytest.approx(0.1)
    assert e.metrics.max_slide == pytest.approx(0.02)
    assert e.metrics.min_cop_margin < -4.0


def test_ticks_account_for_power_and_saturation():
    """Energy is Σ|τ q̇| dt, saturation the fraction of motors at their limit."""
    simulation = generic_state()
    r = robot()
    e = new_episode(1)
    tau = 0.5 * r.torque_limit
    tau[:3] = -r.torque_limit[:3]
    record_tick(simulation.arrays, simulation.state_arrays.qvel, tau, 0.004, e)
    power = tau * simulation.state.qvel[r.motor_dofs]
    assert e.metrics.energy == pytest.approx(0.004 * np.abs(power).sum())
    assert e.metrics.positive_work == pytest.approx(0.004 * power[power > 0.0].sum())
    assert e.metrics.saturated == pytest.approx(3 / r.model.nu)
    assert e.metrics.peak_torque == pytest.approx(1.0)
    assert e.metrics.ticks == 1.0
    assert e.metrics.torque_variation == 0.0  # there was no torque before it


def test_torque_variation_is_the_way_that_torques_go_over_their_limits():
    """Whatever the number of ticks in which they go it; one that hums goes a longer one."""
    simulation, r = generic_state(), robot()

    def variation(fractions):
        e = new_episode(1)
        for fraction in fractions:
            tau = fraction * r.torque_limit
            record_tick(simulation.arrays, simulation.state_arrays.qvel, tau, 0.004, e)
        assert e.metrics.torque_time == pytest.approx(0.004 * len(fractions))
        return e.metrics.torque_variation

    assert variation([-0.5, 0.5]) == pytest.approx(1.0)
    assert variation(np.linspace(-0.5, 0.5, 9)) == pytest.approx(1.0)
    assert variation([-0.5, 0.6, 0.4, 0.5]) == pytest.approx(1.1 + 0.2 + 0.1)


def test_a_new_episode_forgets_the_last():
    """Everything recorded is cleared, and the feet are where they should stay."""
    simulation = generic_state()
    e = new_episode(2)
    e.action[:], e.last_action[:], e.reward_terms[:] = 1.0, 1.0, 1.0
    for name in e.metrics.mutable:
        setattr(e.metrics, name, 1.0)
    begin_episode(simulation.state_arrays, e)
    assert not e.action.any() and not e.last_action.any() and not e.reward_terms.any()
    assert e.metrics.min_cop_margin == np.inf
    assert np.count_nonzero(list(e.metrics.mutable_values().values())) == 1
    np.testing.assert_array_equal(e.sole_start, simulation.state.sole_points[:, :2])
