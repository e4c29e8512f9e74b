"""Joint PD, explicit and implicit."""

import numpy as np
import pytest

from poise.baselines.balance.in_place.pd import (
    PD,
    PDConfig,
    PDGains,
    StablePD,
    StablePDConfig,
    joint_holding_torques,
)
from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.physics.simulation import Simulation
from tests.support.shared import generic_state, robot

STIFF = PDGains(damping=0.35)  # explicit PD diverges with these every 4 ms


def stands(controller, seconds=2.0):
    env = ResidualBalanceEnv(robot(), controller=controller, pushes=None, duration=seconds)
    env.reset(seed=3)
    done = False
    while not done:
        _, terminated, truncated = env.step_without_info(np.zeros(4))
        done = terminated or truncated
    return env.recovered


def test_torques_are_proportional_and_damped():
    """∂τ/∂q = −K and ∂τ/∂v = −D, where no limit is met."""
    gains = PDGains(leg=0.01, trunk=0.01, free=0.001, damping=0.2)
    pd = PD(robot(), PDConfig(gains=gains, feedforward=False))
    simulation = generic_state()
    targets = Targets.standing(robot(), simulation.state)
    before = pd.torques(simulation.state, targets)
    motors = pd.arrays.motor_dofs - 6
    assert np.all(np.abs(before) < pd.arrays.torque_limit)
    targets.q_ref += 0.01
    moved = pd.torques(simulation.state, targets)
    np.testing.assert_allclose(moved - before, 0.01 * pd.stiffness[motors], rtol=1e-9)
    targets.v_ref += 0.1
    np.testing.assert_allclose(
        pd.torques(simulation.state, targets) - moved, 0.1 * pd.damping[motors], rtol=1e-9
    )


def test_feedforward_is_added_within_the_limits():
    """At the reference and at rest what is left is what holds the body, clipped."""
    pd, simulation = PD(robot()), generic_state()
    state, targets = simulation.state, Targets.standing(robot(), simulation.state)
    targets.q_ref[:], targets.v_ref[:] = state.q, state.qvel[6:]
    limit = pd.arrays.torque_limit
    expected = np.clip(joint_holding_torques(state)[pd.arrays.motor_dofs - 6], -limit, limit)
    np.testing.assert_allclose(pd.torques(state, targets), expected, atol=1e-10)


ARMS = ("right_shoulder1", "right_shoulder2", "right_elbow", "left_elbow")


def standing_joints(alone=(), move=None, seconds=2.0):
    """Joints, what holds them and their references after standing; joints `alone` have PD without
    feed-forward, and one reference may move."""
    pd, plain = PD(robot()), PD(robot(), PDConfig(feedforward=False))
    motors = [list(pd.arrays.motor_dofs - 6).index(joint) for joint in alone]
    simulation = Simulation(robot())
    state = simulation.reset()
    targets = Targets.standing(robot(), state)
    start = targets.q_ref.copy()
    for step in range(round(seconds / 0.004)):
        if move is not None:
            joint, rate, told = move
            targets.q_ref[joint] = start[joint] + 0.004 * step * rate
            targets.v_ref[joint] = rate if told else 0.0
        torques = pd.torques(state, targets).copy()
        torques[motors] = plain.torques(state, targets)[motors]
        state = simulation.step(torques, 2)
    assert state.com[2] - state.origin[2] > 0.7  # it stands
    return state.q.copy(), joint_holding_torques(state), targets.q_ref


@pytest.mark.parametrize("feedforward", [False, True])
def test_the_steady_error_is_the_load_over_the_stiffness(feedforward):
    """K (q_ref − q) = τ at rest, so PD alone hangs below its reference by τ/K; with the
    feed-forward of τ it does not. Of arms, which nothing else holds."""
    arms = [robot().joint_names.index(name) for name in ARMS]
    q, load, reference = standing_joints(() if feedforward else arms, seconds=3.0)
    assert np.abs(load[arms]).max() > 0.5  # [N m]
    expected = 0.0 if feedforward else load[arms] / PD(robot()).stiffness[arms]
    np.testing.assert_allclose((reference - q)[arms], expected, atol=2e-3)


@pytest.mark.parametrize("told", [False, True])
def test_the_lag_is_the_damping_times_the_rate_over_the_stiffness(told):
    """Behind a reference of constant rate v it lags by D v/K, and not if it is given the rate; the
    joint's own damping is in the feed-forward."""
    elbow, rate = robot().joint_names.index("right_elbow"), 0.4
    pd = PD(robot())
    q, _, reference = standing_joints(move=(elbow, rate, told))
    lag = pd.damping[elbow] * rate / pd.stiffness[elbow]
    assert lag > 0.01
    assert (reference - q)[elbow] == pytest.approx(0.0 if told else lag, abs=0.4 * lag)


def test_implicit_is_explicit_for_a_short_period():
    """As Δt → 0 both give the same torques."""
    state = generic_state().state
    targets = Targets.standing(robot(), state)
    gains = PDGains(leg=0.01, trunk=0.01, free=0.001)
    explicit = PD(robot(), PDConfig(gains=gains)).torques(state, targets)
    # the predicted step stops the soles within Δt: no shorter than what they can take
    still = generic_state()
    still.state_arrays.J_v[:] = 0.0
    short = StablePD(robot(), StablePDConfig(gains=gains, period=1e-7))
    np.testing.assert_allclose(short.torques(still.state, targets), explicit, atol=1e-3)


def test_the_predicted_step_obeys_the_dynamics():
    """M v̇ + h − Sᵀ(τ − Δt D v̇) is a force of the soles, which stop within the period."""
    pd, state = StablePD(robot(), StablePDConfig(gains=STIFF)), generic_state().state
    tau = np.random.default_rng(0).normal(0.0, 20.0, len(state.q))
    vdot = pd.acceleration(state, tau)
    rest = state.M @ vdot + state.h
    rest[6:] -= tau - pd.period * pd.damping * vdot[6:]
    wrench = np.linalg.lstsq(state.J.T, rest, rcond=None)[0]
    np.testing.assert_allclose(state.J.T @ wrench, rest, atol=1e-6)
    stopped = state.J_v + pd.period * (state.J @ vdot + state.Jdot_v)
    np.testing.assert_allclose(stopped, 0.0, atol=1e-5)


def test_stable_pd_holds_gains_at_which_pd_blows_up():
    """The same gains and period: one falls unpushed, the other stands still."""
    assert not stands(PD(robot(), PDConfig(gains=STIFF)))
    assert stands(StablePD(robot(), StablePDConfig(gains=STIFF)))


@pytest.mark.parametrize("name", ["pd", "stable-pd", "jacobian-transpose"])
def test_the_packaged_gains_stand(name):
    """Unpushed from a disturbed start, quiet after 3 s."""
    assert stands(name, seconds=3.0)
