"""One step of each classical method: what it makes least, and how methods become each other."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.motion.retargeting.inverse_kinematics.chain import Chain
from poise.baselines.motion.retargeting.inverse_kinematics.goals import IkGoal, IkOptions, Misses
from poise.baselines.motion.retargeting.inverse_kinematics.steps import (
    ccd_step,
    damped_step,
    gauss_newton_step,
    transpose_step,
)
from poise.envs.robots.robot import Robot, load_robot
from tests.baselines.motion.retargeting.inverse_kinematics.test_chain import ARM
from tests.support.small_biped import write_biped

RNG = np.random.default_rng(1)
OPTIONS = IkOptions()
SHARES = {"left_hip_*": 0.3, "abdomen_*": 0.6}


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def case(robot: Robot, mobility: dict | None = None, far: float = 0.3) -> Misses:
    """A hand with an orientation and a foot's place to be reached from the other foot."""
    chain = Chain(robot, "left_foot", ["right_lower_arm", "right_foot"], mobility)
    turn = np.roll(Rotation.random(rng=RNG).as_quat(), 1)
    chain.place(robot.standing_qpos)
    hand, foot = (chain.data.xpos[end] + far * RNG.normal(size=3) for end in chain.ends)
    goals = [IkGoal("right_lower_arm", hand, turn, weight=1.5), IkGoal("right_foot", foot)]
    misses = Misses(chain, goals, OPTIONS.lever)
    chain.move(np.clip(chain.q + RNG.uniform(-0.3, 0.3, len(chain.q)), chain.low, chain.high))
    return misses


@pytest.mark.parametrize("mobility", [None, SHARES])
def test_gauss_newton_undoes_a_linear_error_with_the_least_motion(robot, mobility) -> None:
    misses = case(robot, mobility)
    step, jacobian, e = gauss_newton_step(misses, OPTIONS), misses.jacobian(), misses.vector()
    assert jacobian @ step == pytest.approx(-e, abs=1e-9)
    within = np.linalg.svd(jacobian)[2][len(e) :]  # motions that leave the ends where they are
    assert within @ (step / misses.chain.mobility) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("mobility", [None, SHARES])
def test_damped_makes_its_sum_least(robot, mobility) -> None:
    misses, options = case(robot, mobility), IkOptions(damping=0.3)
    step, jacobian = damped_step(misses, options), misses.jacobian()
    gradient = jacobian.T @ (jacobian @ step + misses.vector())
    gradient += options.damping**2 * step / misses.chain.mobility
    assert gradient == pytest.approx(0.0, abs=1e-9)


def test_damping_leads_from_gauss_newton_to_the_transpose(robot) -> None:
    misses = case(robot, SHARES)
    newton = gauss_newton_step(misses, OPTIONS)
    assert damped_step(misses, IkOptions(damping=1e-6)) == pytest.approx(newton, abs=1e-6)
    much, downhill = damped_step(misses, IkOptions(damping=1e4)), transpose_step(misses, OPTIONS)
    assert much / np.linalg.norm(much) == pytest.approx(
        downhill / np.linalg.norm(downhill), abs=1e-6
    )


def test_transpose_goes_as_far_as_is_best(robot) -> None:
    """Along −M Jᵀ e no other length makes the linear error smaller."""
    misses = case(robot, SHARES)
    step, jacobian, e = transpose_step(misses, OPTIONS), misses.jacobian(), misses.vector()
    downhill = -misses.chain.mobility * (jacobian.T @ e)
    assert step == pytest.approx(downhill * (step @ downhill) / (downhill @ downhill))
    assert (jacobian @ step) @ (e + jacobian @ step) == pytest.approx(0.0, abs=1e-9)
    assert step @ downhill > 0.0


def cost(misses: Misses) -> float:
    """Σ w²(‖p − p*‖² + ½ℓ²‖R − R*‖²), what a joint of CCD makes least."""
    total = 0.0
    for k, goal in enumerate(misses.goals):
        place, axes = misses.chain.end_pose(k, goal.point)
        total += goal.weight**2 * float(((place - misses.places[k]) ** 2).sum())
        if (wanted := misses.turns[k]) is not None:
            share = 0.5 * misses.lever**2 * goal.weight**2
            total += share * float(((axes - wanted) ** 2).sum())
    return total


@pytest.mark.parametrize("joint", ["left_ankle_x", "abdomen_y", "right_hip_y", "right_elbow"])
def test_a_joint_of_ccd_goes_to_its_best_angle(robot, joint) -> None:
    """On either side of the tree, against a scan of all angles."""
    misses = case(robot, {"*": 0.0, joint: 1.0})
    q = misses.chain.q
    after = q + ccd_step(misses, IkOptions(limits=False))
    costs = []
    for angle in (after, *(after + np.linspace(-np.pi, np.pi, 401)[:, None])):
        misses.chain.move(angle)
        costs.append(cost(misses))
    assert costs[0] == pytest.approx(min(costs), abs=1e-12) and max(costs) > costs[0] + 1e-3


def test_a_slide_of_ccd_goes_to_its_best_place(tmp_path) -> None:
    chain = Chain(load_robot(write_biped(tmp_path, trunk=ARM)), "trunk", ["arm"], {"swing": 0.0})
    goals = [IkGoal("arm", chain.data.xpos[chain.ends[0]] + np.array([0.05, 0.1, 0.02]))]
    step = ccd_step(Misses(chain, goals, 0.2), OPTIONS)
    assert step == pytest.approx([0.6 * 0.1 + 0.8 * 0.02])


def test_a_sweep_of_ccd_makes_nothing_worse(robot) -> None:
    """With limits and mobilities too, and what it says of the ends holds after it."""
    for mobility in (None, SHARES):
        misses = case(robot, mobility, far=0.6)
        costs = [cost(misses)]
        for _ in range(10):
            misses.chain.move(misses.chain.q + ccd_step(misses, OPTIONS))
            costs.append(cost(misses))
        assert np.all(np.diff(costs) <= 1e-12) and costs[-1] < 0.5 * costs[0]
        assert np.all(misses.chain.q <= misses.chain.high + 1e-12)


@pytest.mark.parametrize("step", [ccd_step, transpose_step, gauss_newton_step, damped_step])
def test_a_joint_of_small_mobility_moves_less(robot, step) -> None:
    """Of a hand that is to rise by 5 cm; CCD's first joints move most anyway."""
    moved = []
    for share in (1.0, 0.05):
        chain = Chain(robot, "torso", ["right_lower_arm"], {"right_elbow": share})
        place = chain.data.xpos[chain.ends[0]] + np.array([0.02, 0.01, 0.05])
        goal = IkGoal("right_lower_arm", place, point=[0.1, 0.1, 0.1])
        misses = Misses(chain, [goal], 0.2)
        moved.append(abs(step(misses, OPTIONS)[2]))
    if step is gauss_newton_step:  # three joints and three numbers leave no choice
        assert moved[1] == pytest.approx(moved[0])
    else:
        assert moved[1] < 0.3 * moved[0]
