"""What a motion changes for a controller that steps: turn, crouch, and the return to the motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.balance.stepping.planning.blocks import CaptureTick
from poise.baselines.balance.stepping.planning.guidance import crouch, moves
from poise.baselines.balance.stepping.tick import must_step
from poise.baselines.controller import Targets
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config, load_controller
from poise.envs.physics.simulation import Simulation
from tests.support.shared import robot

PUSH = {"impulse": 24.0, "direction": 135.0, "start": 0.2, "body": "torso"}
MOVES = 0.1  # [rad/s] of a joint


def play(controller: object, motion: str, duration: float) -> ResidualBalanceEnv:
    """A pushed episode, played to its end without a fall."""
    env = ResidualBalanceEnv(robot(), controller=controller, motion=motion, duration=duration)
    env.reset(seed=1, options={"push": PUSH})
    over = fallen = False
    while not (over or fallen):
        _, fallen, over = env.step_without_info(np.zeros(4))
    assert not fallen and env.controller.steps >= 1
    return env


def test_standing_has_the_bits_of_a_controller_without() -> None:
    """Neither limit counts, and nothing returns, where nothing moves."""
    config = controller_config("feedback-step")
    assert config.turn_limit < 180.0 and config.crouch_margin > 0.0
    envs = [play(c, "standing", 1.5)
            for c in (config, replace(config, turn_limit=180.0, crouch_margin=0.0))]  # fmt: skip
    np.testing.assert_array_equal(*(env.simulation.data.qpos for env in envs))
    assert not envs[0].controller.memory.moved


def test_home_again_it_goes_on_with_the_motion() -> None:
    """CoM and root are where the motion has them; a robot that only stands stays lower."""
    below = {}
    for motion in ("squat", "standing"):
        env = play("feedback-step", motion, 8.0)
        state, memory = env.simulation.state, env.controller.memory
        assert not memory.recovering
        assert memory.return_fraction == (motion == "squat")
        below[motion] = robot().height_com - (state.com[2] - state.origin[2])
    assert abs(below["squat"]) < 0.003
    assert below["standing"] > 0.02


@pytest.fixture
def tick() -> CaptureTick:
    """That of `feedback-step` standing at rest."""
    state = Simulation(robot()).state
    controller = load_controller("feedback-step", robot())
    assert isinstance(controller, CaptureStep)
    return controller.tick(state, Targets.standing(robot(), state))


def reach(tick: CaptureTick) -> float:
    """How far ahead ξ may be before a first step begins [m]."""
    start, low, high = tick.state.capture_point[0], 0.0, 1.0
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        tick.state.capture_point[0] = start + middle
        low, high = (low, middle) if must_step(tick) else (middle, high)
    tick.state.capture_point[0] = start
    return low


def test_less_haste_in_a_crouch(tick: CaptureTick) -> None:
    """`step_margin` grows by `crouch_margin` of the crouch, in a motion that moves alone."""
    asked, stands = tick.reference_in, reach(tick)
    assert tick.gains.crouch_margin > 0.0
    asked.com[2] -= 0.2
    low = 0.2 - 0.05 * robot().height_com
    assert crouch(tick) == pytest.approx(low)
    assert not moves(tick) and reach(tick) == stands
    asked.v_ref[3] = MOVES
    assert moves(tick)
    assert reach(tick) - stands == pytest.approx(tick.gains.crouch_margin * low, abs=1e-6)
    turn = Rotation.from_rotvec([0.0, 0.5 * tick.gains.turn_limit, 0.0]).as_matrix()
    asked.root_axes[:] = turn @ asked.root_axes
    assert reach(tick) - stands == pytest.approx(0.75 * tick.gains.crouch_margin * low, abs=1e-6)


def test_a_root_that_turns_away_is_a_reason_to_step(tick: CaptureTick) -> None:
    """40° off and 170°/s faster: more than 60° in 0.7/ω. Not if it turns back, or in a crouch."""
    asked = tick.reference_in
    turn = Rotation.from_rotvec([0.0, np.radians(40.0), 0.0]).as_matrix()
    asked.root_axes[:] = turn @ asked.root_axes
    away = tick.state.root_axes.T @ [0.0, 3.0, 0.0]
    asked.root_vel[:] = away
    assert not must_step(tick)  # since nothing moves
    asked.v_ref[3] = MOVES
    assert must_step(tick)
    asked.root_vel[:] = -away
    assert not must_step(tick)
    asked.root_vel[:] = away
    asked.com[2] -= 0.2
    assert not must_step(tick)
