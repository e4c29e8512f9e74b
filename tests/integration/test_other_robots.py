"""Other bipeds, described by data alone, stand and recover with the default controller's gains."""

import numpy as np
import pytest

from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.envs.physics.legs import find_legs, standing_data
from poise.envs.robots.menagerie import WHEEL
from poise.envs.robots.robot import load_robot
from tests.support.physics import robot_named


def trial(name, push, duration):
    """The environment after a trial with the default controller, and whether the robot fell."""
    robot = robot_named(name)
    env = ResidualBalanceEnv(robot, pushes=None, duration=duration)
    if push:
        body = robot.model.body(robot.root_body_id).name
        specific, direction = push
        push = {"impulse": specific * robot.mass, "direction": direction, "duration": 0.1,
                "start": 0.3, "body": body}  # fmt: skip
    env.reset(seed=0, options={"push": push})
    for _ in range(env.max_steps):
        env.step_without_info(np.zeros(4))
        if env.fallen:
            break
    return env


@pytest.mark.parametrize("name", ["humanoid", "tall", "compact", "human"])
def test_standing(name):
    """From a slightly disturbed start it stands for 5 s, all but at rest, and fails at no tick."""
    env = trial(name, [], 5.0)
    state = env.simulation.state
    assert not env.fallen and env.recovered
    assert np.linalg.norm(state.com_vel) < 0.05  # `tall` may rock its feet
    assert env.controller.failures == 0
    assert state.support_distance(state.com[:2]) > 0.03


@pytest.mark.parametrize("direction", [0.0, 90.0, 180.0, 270.0])
@pytest.mark.parametrize("name", ["humanoid", "tall", "compact", "human"])
def test_light_pushes(name, direction):
    """0.15 N·s/kg from any side: it recovers, and comes back to where it stood to 1 cm."""
    env = trial(name, (0.15, direction), 3.5)
    assert not env.fallen and env.recovered
    state = env.simulation.state
    np.testing.assert_allclose(state.com[:2], env.targets.com[:2], atol=0.01)


@pytest.mark.parametrize("name", ["tall", "compact", "toddler", "human"])
def test_walking(name):
    """At v = √(0.05 g l), l the hip's height, with the same gains, scaled: as commanded."""
    robot = robot_named(name)
    data = standing_data(robot)
    hip = data.xanchor[robot.model.joint(find_legs(robot)[0].hip).id, 2]
    speed = float(np.sqrt(0.05 * robot.units.gravity * hip))
    env = ResidualBalanceEnv(robot, controller="walk", pushes=None, duration=7.0)
    env.reset(seed=1, options={"command": {"ahead": speed}})
    places = []
    for _ in range(env.max_steps):
        env.step_without_info(np.zeros(4))
        places.append(env.simulation.state.com[0])
        assert not env.fallen
    assert (places[-1] - places[-151]) / 3.0 == pytest.approx(speed, rel=0.05)


def test_single_axis_ankles():
    """A robot whose feet cannot tilt sideways, and whose soles constrain each other, stands too."""
    env = trial("toddler", [], 5.0)
    assert not env.fallen
    assert np.linalg.norm(env.simulation.state.com_vel) < 0.1


def test_feet_that_stand_a_little_turned_do_not_make_short_legs_lean():
    """Soles turned by 1.2° to each other hold the H1's pelvis back like a wedge, so that it used to
    lean 4° for ever: it comes upright all the same."""
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    env = ResidualBalanceEnv(load_robot("unitree_h1"), pushes=None, duration=4.0)
    env.reset(seed=3987980942)
    for _ in range(env.max_steps):
        env.step_without_info(np.zeros(4))
    state = env.simulation.state
    headings = state.sole_axes[:, :, 0]
    turned = np.degrees(np.arctan2(headings[:, 1], headings[:, 0]))
    assert env.recovered and turned[0] - turned[1] > 0.9
    assert np.degrees(np.arccos(state.root_axes[2, 2])) < 1.0


@pytest.mark.parametrize(("direction", "specific"), [(0.0, 0.4), (112.5, 0.72)])
def test_gains_for_the_t1(direction, specific):
    """They hold pushes 15 % below their limit, feet in place."""
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    t1 = load_robot("booster_t1")
    env = ResidualBalanceEnv(t1, controller="momentum-qp-t1", pushes=None, duration=5.0)
    feet = env.simulation.state.sole_points.copy()
    push = {"specific_impulse": specific, "direction": direction, "duration": 0.1, "start": 0.2}
    env.reset(seed=0, options={"push": push})
    over = fallen = False
    while not (over or fallen):
        _, fallen, over = env.step_without_info(np.zeros(4))
    assert env.recovered
    np.testing.assert_allclose(env.simulation.state.sole_points, feet, atol=0.05)


def test_gains_scale_with_mass_and_height():
    """One configuration becomes other numbers: forces by m g, moments by m g h, rates by √(g/h)."""
    humanoid, tall = (ResidualBalanceEnv(robot_named(n), pushes=None) for n in ("humanoid", "tall"))
    both = humanoid.controller, tall.controller
    a, b = ({name: task.block for name, task in each.tasks.items()} for each in both)
    m = tall.robot.mass / humanoid.robot.mass
    h = tall.robot.height_com / humanoid.robot.height_com
    np.testing.assert_allclose(b["com"].weight, a["com"].weight / m**2)
    np.testing.assert_allclose(b["cop"].weight, a["cop"].weight / (m * h) ** 2)
    np.testing.assert_allclose(b["com"].stiffness, a["com"].stiffness / h)
    np.testing.assert_allclose(b["com"].damping, a["com"].damping / np.sqrt(h))
    np.testing.assert_allclose(b["posture"].stiffness[3:6], a["posture"].stiffness[3:6] / h)
    np.testing.assert_allclose(b["posture"].weight[3:6], a["posture"].weight[3:6] * h**2)
    wrenches = a["wrenches"], b["wrenches"]
    assert wrenches[1].force_weight == pytest.approx(wrenches[0].force_weight / m**2)
    assert wrenches[1].moment_weight == pytest.approx(wrenches[0].moment_weight / (m * h) ** 2)
    damping = [each.parameters.sole_damping for each in both]
    assert damping[1] == pytest.approx(damping[0] / np.sqrt(h))
