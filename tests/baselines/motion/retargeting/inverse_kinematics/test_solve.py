"""Whole solves: goals of all kinds are reached by every method, and what comes back is true."""

import copy
from typing import Any

import mujoco
import numpy as np
import pytest

from poise.baselines.motion.retargeting.inverse_kinematics.goals import IkGoal, IkOptions
from poise.baselines.motion.retargeting.inverse_kinematics.prior import PosePrior
from poise.baselines.motion.retargeting.inverse_kinematics.solve import (
    METHODS,
    InverseKinematics,
    solve_ik,
)
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot, load_robot

HAND = "right_lower_arm"
POINT = (0.18, 0.18, 0.18)


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def reachable(solver: InverseKinematics, rng: np.random.Generator, pose: bool = False) -> IkGoal:
    """A goal that a random posture within the limits reaches, the base where it stands."""
    chain = solver.chain
    qpos = chain.whole(rng.uniform(*chain.free), solver.robot.standing_qpos)
    return at(solver.robot, qpos, solver.names[0], pose)


def at(robot: Robot, qpos: np.ndarray, body: str, pose: bool = False, point=POINT) -> IkGoal:
    """Where a posture has a body."""
    data = mujoco.MjData(robot.model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(robot.model, data)
    place, axes = data.body(body).xpos, data.body(body).xmat.reshape(3, 3)
    turn = data.body(body).xquat if pose else None
    return IkGoal(body, place + axes @ np.asarray(point), turn, point)


def distance(robot: Robot, qpos: np.ndarray, goal: IkGoal) -> float:
    found = at(robot, qpos, goal.body, point=goal.point)
    return float(np.linalg.norm(found.position - goal.position))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_reaches_most_places(robot: Robot, method: str) -> None:
    """Of 25 places of a hand that moves about the pelvis; the residual is the true distance."""
    solver = InverseKinematics(robot, [HAND], base="pelvis", method=method)
    rng, reached = np.random.default_rng(0), 0
    for _ in range(25):
        goal = reachable(solver, rng)
        result = solver.solve([goal])
        assert distance(robot, result.qpos, goal) == pytest.approx(result.residual, abs=1e-9)
        assert result.reached == (result.residual <= 1e-4) and result.within_limits
        assert result.starts == 1 and result.iterations <= 200
        reached += result.reached
    assert reached >= 23


@pytest.mark.parametrize("method", METHODS)
def test_orientations_are_reached_as_well(robot: Robot, method: str) -> None:
    """A foot of six joints is brought to a pose; near ones, for pairs of limits block far ones."""
    options = IkOptions(iterations=1000, patience=100)
    solver = InverseKinematics(robot, ["right_foot"], base="pelvis", method=method, options=options)
    rng, chain = np.random.default_rng(1), solver.chain
    for _ in range(5):
        q = chain.clipped(chain.robot.standing_qpos[chain.qpos] + rng.uniform(-0.3, 0.3, 6))
        qpos = chain.whole(q, robot.standing_qpos)
        result = solver.solve([at(robot, qpos, "right_foot", pose=True)])
        allowed = 2e-3 if method in ("ccd", "jacobian-transpose") else 1e-4  # these creep
        assert result.residual <= allowed, method


def test_limits_are_bounds_and_restarts_find_what_one_start_does_not(robot: Robot) -> None:
    """Of 100 places of a hand on three joints most from standing, all with four restarts; no limit
    is violated. tests/performance/inverse_kinematics.py tries 1,000 of every chain."""
    solver = InverseKinematics(robot, [HAND])
    rng = np.random.default_rng(3)
    goals = [reachable(solver, rng) for _ in range(100)]
    first = [solver.solve([goal]) for goal in goals]
    assert 90 <= sum(result.reached for result in first) < 100
    again = [solver.solve([goal], restarts=4) for goal in goals]
    assert all(result.reached and result.within_limits for result in again)
    assert max(result.starts for result in again) > 1
    low, high = robot.joint_range.T
    assert all(np.all((low <= r.qpos[7:]) & (r.qpos[7:] <= high)) for r in first + again)


def test_several_goals_move_the_whole_body_on_planted_feet(robot: Robot) -> None:
    """Both feet where they are, a hand 25 cm lower and further ahead: the knees bend."""
    start = robot.standing_qpos
    foot = at(robot, start, "right_foot", pose=True, point=(0.0, 0.0, 0.0))
    hand = at(robot, start, HAND)
    wanted = IkGoal(HAND, hand.position + np.array([0.15, 0.0, -0.25]), point=POINT)
    result = solve_ik(robot, [foot, wanted], base="left_foot")
    assert result.reached and result.within_limits
    assert distance(robot, result.qpos, wanted) < 1e-4
    for body in ("left_foot", "right_foot"):
        stands = at(robot, start, body, point=(0.0, 0.0, 0.0))
        assert distance(robot, result.qpos, stands) < 1e-4
    assert result.qpos[2] != pytest.approx(start[2], abs=1e-3)


def test_without_limits_a_joint_may_leave_its_range(robot: Robot) -> None:
    """An elbow bent beyond its limit is reached without limits, and not with them."""
    qpos = robot.standing_qpos.copy()
    elbow = 7 + robot.joint_names.index("right_elbow")
    qpos[elbow] = robot.joint_range[elbow - 7, 1] + 0.6
    goal = at(robot, qpos, HAND)
    for method in METHODS:
        options = IkOptions(limits=False)
        free = solve_ik(robot, [goal], start=qpos, method=method, options=options)
        assert free.reached and not free.within_limits, method
        kept = solve_ik(robot, [goal], start=qpos, method=method)
        assert kept.within_limits, method
        assert np.all(kept.qpos[elbow] <= robot.joint_range[elbow - 7, 1]), method


def test_what_cannot_be_reached_is_come_near_to(robot: Robot) -> None:
    """A place 2 m ahead: the arm is stretched towards it and the residual says what is left."""
    goal = IkGoal(HAND, [2.0, -0.2, 1.2], point=POINT)
    results = [solve_ik(robot, [goal], method=method, restarts=2) for method in METHODS]
    for result in results:
        assert not result.reached and result.starts == 3
        assert result.residual == pytest.approx(distance(robot, result.qpos, goal), abs=1e-9)
    assert results[0].residual <= min(result.residual for result in results) + 1e-3


def test_the_best_of_all_starts_counts(robot: Robot) -> None:
    """Restarts of a single step, which get less far than the start was, change nothing."""
    goal = IkGoal(HAND, [2.0, -0.2, 1.2], point=POINT)
    first = solve_ik(robot, [goal])
    for method in ("bounded", "jacobian-transpose"):
        again = solve_ik(robot, [goal], start=first.qpos, method=method, restarts=3,
                         options=IkOptions(iterations=1))  # fmt: skip
        assert again.starts == 4 and again.residual <= first.residual + 1e-9


def test_the_same_call_gives_the_same_bits(robot: Robot) -> None:
    """Solvers, and copies of them, remember nothing of the goals before."""
    solver = InverseKinematics(robot, [HAND])
    rng = np.random.default_rng(4)
    goals = [reachable(solver, rng) for _ in range(6)]
    first = [solver.solve([goal], restarts=2, seed=5).qpos for goal in goals]
    twin = copy.deepcopy(solver)
    for goal, qpos in list(zip(goals, first, strict=True))[::-1]:
        assert np.array_equal(solver.solve([goal], restarts=2, seed=5).qpos, qpos)
        assert np.array_equal(twin.solve([goal], restarts=2, seed=5).qpos, qpos)


def test_a_prior_makes_a_posture_more_usual(robot: Robot) -> None:
    """Postures seen: both arms the same. The reached one is nearer to that, and as near."""
    rng, names = np.random.default_rng(5), list(robot.joint_names)
    seen = robot.standing_qpos[7:] + 0.01 * rng.normal(size=(200, len(names)))
    seen[:, names.index("abdomen_y")] += rng.uniform(-0.6, 0.2, 200)
    seen[:, names.index("right_shoulder1")] += rng.uniform(-0.5, 0.5, 200)
    prior = PosePrior.fit(seen, variance=0.9)
    qpos = robot.standing_qpos.copy()
    qpos[7:] = seen[0]
    data = InverseKinematics(robot, [HAND], base="pelvis").chain
    goal = at(robot, data.whole(qpos[data.qpos], robot.standing_qpos), HAND)
    plain = solve_ik(robot, [goal], base="pelvis")
    usual = solve_ik(robot, [goal], base="pelvis", prior=prior)
    assert prior.cost(usual.qpos[7:]) < 0.5 * prior.cost(plain.qpos[7:])
    assert plain.reached and usual.residual < 0.01 and usual.within_limits


def test_the_result_is_frozen(robot: Robot) -> None:
    result: Any = solve_ik(robot, [at(robot, robot.standing_qpos, HAND)])
    assert result.reached and result.residual < 1e-9
    with pytest.raises(AttributeError):
        result.residual = 1.0
    with pytest.raises(ValueError):
        result.qpos[0] = 1.0


@pytest.mark.parametrize(
    ("values", "call", "words"),
    [
        ({"method": "newton"}, {}, ["method", "'newton'", "bounded", "ccd"]),
        ({"base": "hull"}, {}, ["body", "'hull'"]),
        ({"method": "ccd", "prior": PosePrior.fit(np.eye(21))}, {}, ["prior", "'ccd'", "bounded"]),
        ({"prior": PosePrior.fit(np.eye(5))}, {}, ["prior", "5 joints", "21"]),
        ({"prior_weight": -1.0}, {}, ["prior_weight"]),
        ({"mobility": {HAND: 1.0}}, {}, ["mobility", HAND]),
        ({}, {"start": [0.0] * 7}, ["start", "28"]),
        ({}, {"start": np.full(28, np.nan)}, ["start", "finite"]),
        ({}, {"restarts": -1}, ["restarts"]),
        ({}, {"seed": 0.5}, ["seed"]),
        ({}, {"goals": []}, ["goals", HAND]),
    ],
)
def test_errors_name_what_is_wrong(robot: Robot, values, call, words) -> None:
    with pytest.raises(ConfigError) as caught:
        goals = call.pop("goals", [IkGoal(HAND, [0.0, 0.0, 1.0])])
        InverseKinematics(robot, [HAND], **values).solve(goals, **call)
    assert all(word in str(caught.value) for word in words), caught.value


@pytest.mark.parametrize("field", ["iterations", "tolerance", "lever", "damping", "patience"])
def test_options_are_above_zero(field: str) -> None:
    for value in (0, -1, np.nan):
        with pytest.raises(ConfigError, match=field):
            IkOptions(**{field: value})
