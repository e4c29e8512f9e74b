"""Goals: errors, their derivatives, and what is no goal."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines.motion.retargeting.inverse_kinematics.chain import Chain
from poise.baselines.motion.retargeting.inverse_kinematics.goals import IkGoal, Misses
from poise.configs.errors import ConfigError
from poise.envs.robots.robot import Robot, load_robot

RNG = np.random.default_rng(0)
ENDS = ("right_lower_arm", "right_foot")


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def random_goals() -> list[IkGoal]:
    turn = np.roll(Rotation.random(rng=RNG).as_quat(), 1)
    return [
        IkGoal("right_lower_arm", RNG.normal(size=3), 3.0 * turn, [0.1, 0.2, 0.0], weight=2.0),
        IkGoal("right_foot", RNG.normal(size=3), point=[0.0, 0.1, 0.0]),
    ]


def test_jacobian_is_the_derivative_of_the_errors(robot: Robot) -> None:
    """For large errors of orientation as well."""
    chain, h = Chain(robot, "left_foot", ENDS), 1e-6
    for _ in range(5):
        chain.place(robot.standing_qpos)
        misses, q = Misses(chain, random_goals(), 0.3), RNG.uniform(*chain.free)
        chain.move(q)
        jacobian = misses.jacobian()
        for i, step in enumerate(h * np.eye(len(q))):
            ends = []
            for way in (-step, step):
                chain.move(q + way)
                ends.append(misses.vector())
            assert jacobian[:, i] == pytest.approx((ends[1] - ends[0]) / (2 * h), abs=1e-6)


def test_errors_do_not_depend_on_where_the_robot_stands(robot: Robot) -> None:
    """Robot and goals moved together give the same errors."""
    chain, goals = Chain(robot, "left_foot", ENDS), random_goals()
    q = RNG.uniform(*chain.free)
    turn, shift = Rotation.random(rng=RNG), RNG.normal(size=3)
    moved = robot.standing_qpos.copy()
    moved[:3] = turn.apply(moved[:3]) + shift
    moved[3:7] = np.roll((turn * rotation(moved[3:7])).as_quat(), 1)
    errors = []
    for qpos, by in ((robot.standing_qpos, None), (moved, turn)):
        chain.place(qpos)
        wanted = goals if by is None else [turned(goal, by, shift) for goal in goals]
        misses = Misses(chain, wanted, 0.2)
        chain.move(q)
        errors.append(misses.vector())
    assert errors[1] == pytest.approx(errors[0], abs=1e-12)


def rotation(quaternion: np.ndarray) -> Rotation:
    return Rotation.from_quat(np.roll(quaternion, -1))


def turned(goal: IkGoal, turn: Rotation, shift: np.ndarray) -> IkGoal:
    orientation = goal.orientation
    if orientation is not None:
        orientation = np.roll((turn * rotation(orientation)).as_quat(), 1)
    place = turn.as_matrix() @ goal.position + shift
    return IkGoal(goal.body, place, orientation, goal.point, goal.weight)


def test_a_pose_that_is_met_misses_nothing(robot: Robot) -> None:
    """The residual is a distance, with angles by the lever; weights do not enter."""
    chain = Chain(robot, "torso", ["right_lower_arm"])
    body = chain.ends[0]
    met = IkGoal("right_lower_arm", chain.data.xpos[body], chain.data.xquat[body])
    assert Misses(chain, [met], 0.2).residual() < 1e-7
    turn = np.roll((Rotation.from_rotvec([0.0, 0.3, 0.0])
                    * rotation(chain.data.xquat[body])).as_quat(), 1)  # fmt: skip
    other = IkGoal("right_lower_arm", chain.data.xpos[body] + [0.08, 0.0, 0.0], turn, weight=7.0)
    assert Misses(chain, [other], 0.2).residual() == pytest.approx(np.hypot(0.08, 0.06))


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"position": [0.0, 0.0]}, "position"),
        ({"position": [0.0, 0.0, np.nan]}, "position"),
        ({"position": None}, "position"),
        ({"orientation": [0.0, 0.0, 0.0, 0.0]}, "orientation"),
        ({"orientation": "up"}, "orientation"),
        ({"point": [1.0]}, "point"),
        ({"weight": 0.0}, "weight"),
        ({"weight": np.nan}, "weight"),
    ],
)
def test_what_is_no_goal_is_an_error(values: dict, field: str) -> None:
    with pytest.raises(ConfigError) as caught:
        IkGoal(**{"body": "torso", "position": [0.0, 0.0, 0.0], **values})
    assert caught.value.field == field and "'torso'" in str(caught.value)
