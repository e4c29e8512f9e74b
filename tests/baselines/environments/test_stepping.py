"""`ResidualStepEnv`: zero is the planner, every other action moves what it says."""

import inspect
import re
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.legs import nominal_feet
from poise.baselines.balance.stepping.planning.guidance import copy_reference, guide_com
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.environments.scales import StepScales
from poise.baselines.environments.stepping import ResidualStepEnv
from poise.envs.balance.vector.batch import EnvBatch, replicate
from poise.envs.compiled.maths.vectors import turn
from poise.envs.sensing.realism import Realism, load_realism
from tests.support import planned
from tests.support.refused import invalid
from tests.support.sensing import PLAIN
from tests.support.shared import robot

PUSH = {"impulse": 24.0, "direction": 20.0, "start": 0.1, "body": "torso"}
ALL = StepScales(height=0.05, lean=0.2, momentum=0.05, trigger=0.03)


@pytest.fixture(scope="module")
def env():
    return ResidualStepEnv(robot(), duration=1.2, residual=ALL)


def play(env, action=(), seed=2, until=None):
    """Steps with entries of the action by name, until the episode ends or `until` is true."""
    vector = np.zeros(len(env.action_names))
    for name, value in dict(action).items():
        vector[env.action_names.index(name)] = value
    env.reset(seed=seed, options={"push": PUSH})
    done = False
    while not done and not (until and until(env)):
        _, fallen, over = env.step_without_info(vector)
        done = fallen or over


def swinging(env):
    """Whether the first step has begun."""
    return env.controller.swing is not None


def test_action_zero_is_the_planner_bit_for_bit(env):
    """The same end of a trial with steps as of the controller alone in `ResidualBalanceEnv`."""
    plain = ResidualBalanceEnv(robot(), controller="capture-step", duration=1.2)
    for other in (env, plain):
        play(other)
        assert other.controller.steps >= 1
    data, expected = env.simulation.data, plain.simulation.data
    np.testing.assert_array_equal(data.qpos, expected.qpos)
    np.testing.assert_array_equal(data.qvel, expected.qvel)
    assert env.info()["steps"] == plain.controller.steps


@pytest.mark.parametrize("controller", ["capture-step", "ipm-step"])
def test_compiled_steps_are_those_of_python(controller):
    """The same trial under a policy, ticks called from Python: observations, rewards, metrics."""
    env, ends = ResidualStepEnv(robot(), controller=controller, duration=1.2, residual=ALL), []
    assert env.compiled_step() is not None
    for compiled in (True, False):
        env._compiled = compiled
        rows: list = []
        action = {"com_x": 0.2, "foothold_y": 0.3, "time": -0.2, "lean_y": 0.1, "trigger": -0.1}
        play(env, action, until=lambda env, r=rows: r.append(env.episode.observation.copy()))
        e, qpos = env.episode, env.simulation.data.qpos.copy()
        ends.append(
            [np.array(rows), e.reward_terms.copy(), [*e.metrics.mutable_values().values()], qpos]
        )
        assert env.controller.steps >= 1 and len(rows) > 10
    for one, other in zip(*ends, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-6, atol=1e-6)


def test_threads_do_not_share_anything():
    """Four environments in two threads end where each ends alone."""
    first = ResidualStepEnv(robot(), duration=0.6, pushes=None)
    batch = EnvBatch(replicate(first, 4), threads=2)
    options = [{"push": {**PUSH, "direction": 90.0 * k}} for k in range(4)]
    batch.reset([0, 1, 2, 3], options)
    actions = np.full((4, *first.action_space.shape), 0.1)
    for _ in range(29):
        batch.step(actions)
    ends = [env.simulation.data.qpos.copy() for env in batch.envs]
    batch.close()
    assert [env.controller.steps > 0 for env in batch.envs] == [True] * 4
    alone = ResidualStepEnv(robot(), duration=0.6, pushes=None)
    for k, end in enumerate(ends):
        alone.reset(seed=k, options=options[k])
        for _ in range(29):
            alone.step_without_info(actions[k])
        np.testing.assert_array_equal(alone.simulation.data.qpos, end)


def test_the_foothold_moves_by_what_is_added(env):
    """Seen where the step begins, for the foot and the time that are planned."""
    play(env, until=swinging)
    planner, state = planned.Planner.of(env.controller), env.simulation.state
    plan = planned.plan(planner, state, 0.0)
    start = state.sole_points[plan.foot, :2]

    def foothold():
        return planned.footholds(planner, state, plan.foot, 0.0, np.array([plan.time]), start)[0][0]

    before = foothold().copy()
    env.controller.offsets.foothold[:] = 0.04, 0.02
    np.testing.assert_allclose(foothold() - before, [0.04, 0.02], atol=1e-12)


def test_the_foothold_stays_within_the_limits_of_a_step(env):
    """However far it is pulled across: the feet keep their least width."""
    play(env, until=swinging)
    controller, state = env.controller, env.simulation.state
    planner, foot = planned.Planner.of(controller), controller.foot
    side = planner.foot_sign[foot]
    controller.offsets.foothold[1] = -1e20 * side
    start = state.sole_points[foot, :2]
    footholds, _ = planned.footholds(planner, state, foot, 0.0, np.array([9.0]), start)
    width = side * (footholds[0] - state.sole_points[1 - foot, :2])[1]
    least = controller.config.limits.width_min * controller.robot.height_com
    assert width == pytest.approx(least, abs=1e-9)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_time_of_a_step_moves_by_what_is_added_once(env, sign):
    """Planned anew at every tick, the swing still ends one shift away from the planner's time."""
    ends = []
    for value in (0.0, sign):
        play(env, {"time": 0.5 * value}, until=swinging)
        duration = env.controller.swing.duration
        for _ in range(3):
            env.step_without_info(env.episode.action.copy())
        ends.append((duration, env.controller.swing.duration))
    first, later = np.diff(ends, axis=0)[0]
    assert first == pytest.approx(sign * 0.5 * ALL.time, abs=1e-9)
    assert later == pytest.approx(sign * 0.5 * ALL.time, abs=0.03)


def test_a_later_trigger_means_a_later_step(env):
    """The capture point gets further before the foot leaves the ground."""
    begun = []
    for value in (-1.0, 0.0, 1.0):
        play(env, {"trigger": value}, until=swinging)
        begun.append(env.steps)
    assert begun[0] <= begun[1] <= begun[2] and begun[0] < begun[2]


@pytest.mark.parametrize(
    ("name", "index", "part"),
    [("cop_y", 1, "cop"), ("com_z", 2, "com"), ("lean_y", 2, "root_axes")],
)
def test_targets_of_a_step_are_moved(env, name, index, part):
    """In a swing: p and c̈_ref, the height, the root's axes."""
    seen = []
    for value in (0.0, 0.2):
        play(env, until=swinging)
        vector = np.zeros(len(env.action_names))
        vector[env.action_names.index(name)] = value
        env.step_without_info(vector)
        seen.append(np.array(getattr(env.controller._reference_out, part))[..., index].copy())
    assert np.abs(seen[1] - seen[0]).max() > 5e-3


def test_rest_after_a_step_is_moved(env):
    """Where p is free, c̈ = ω² (c − p), p = ξ + k (ξ − ξ_ref), changes by ω² k Δξ_ref."""
    play(env, until=swinging)
    controller, state = env.controller, env.simulation.state
    anywhere = 9.0 * np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    tick, seen = controller.tick(state, env.targets), []
    for shift in ([0.0, 0.0], [0.1, -0.05]):
        controller.offsets.com[:] = shift
        copy_reference(tick)
        guide_com(tick, anywhere, 0.0, 0.0, 0.0, 0.0)
        seen.append(tick.reference_out.com_acc[:2].copy())
    R = controller.memory.level_frame[:2, :2]
    expected = state.omega**2 * controller.config.gain * R @ [0.1, -0.05]
    np.testing.assert_allclose(seen[1] - seen[0], expected, atol=1e-9)


def test_observation_tells_of_the_step():
    """Terms of the step against the controller, in a swing and with both feet down."""
    env = ResidualStepEnv(robot(), duration=1.2)
    names = [f"{term.name}.{entry}" for term in env.terms for entry in term.entries]
    play(env, until=lambda env: swinging(env) and env.controller.swing.time > 0.1)
    seen = dict(zip(names, env.episode.observation, strict=True))
    controller, state = env.controller, env.simulation.state
    assert [seen["swing.left"], seen["swing.right"]] == [controller.foot == 0, controller.foot == 1]
    assert seen["phase.fraction"] == pytest.approx(
        controller.swing.time / controller.swing.duration
    )
    assert seen["steps.count"] == 1.0 and seen["time_left.t"] > 0.0
    cos, sin = state.heading
    axes, half = np.array([[cos, -sin], [sin, cos]]), 0.5 * env.robot.height_com
    stance = state.sole_points[1 - controller.foot]
    for term, point in (
        ("foothold", controller.swing.foothold),
        ("swing_foot", state.sole_points[controller.foot, :2]),
        ("stance_capture_point", state.capture_point),
    ):
        found = [seen[f"{term}.x"], seen[f"{term}.y"]]
        np.testing.assert_allclose(found, (point - stance[:2]) @ axes / half, atol=1e-9)
    play(env, until=lambda env: env.controller.steps and not swinging(env))
    seen = dict(zip(names, env.episode.observation, strict=True))
    assert seen["swing.left"] == seen["swing.right"] == seen["foothold.x"] == 0.0
    assert seen["feet.y"] > 0.1 / half


def test_a_replica_acts_alike(env):
    """Copies have the scales and the controller's configuration; the same bits."""
    ends = []
    for one in replicate(env, 2):
        play(one, {"foothold_x": 0.5, "time": -0.3, "lean_y": 0.2})
        ends.append(one.episode.observation.copy())
    np.testing.assert_array_equal(ends[0], ends[1])


def test_perfect_sensors_change_no_step(env):
    """With perfect sensors of the same robot the trial is the same, but for friction that slides
    tell."""
    ends, known = [], env.estimator
    env.estimator = replace(known, slide_speed=0.0)
    for level in (Realism(), load_realism(PLAIN)):
        env.realism = level
        play(env, {"foothold_x": 0.5})
        ends.append(env.episode.observation.copy())
    env.realism, env.estimator = Realism(), known
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6)


def test_controllers_that_do_not_step_are_refused():
    """The momentum QP has no steps to move."""
    with invalid("controller"):
        ResidualStepEnv(robot(), controller="momentum-qp")


def test_the_class_docstring_is_the_specification():
    """Its tables tell of every term and, for the default scales, of every entry of an action."""
    text, env = inspect.getdoc(ResidualStepEnv), ResidualStepEnv(robot())
    for term in env.terms:
        assert f"| {term.name} |" in text and f"| {term.unit} | {term.meaning} |" in text
    assert not re.search(r"<\w+>", text)
    for i, (name, scale) in enumerate(zip(env.action_names, env._residual.scale, strict=True)):
        field, unit = name.split("_")[0], "s" if name == "time" else "m"
        assert f"| {i} | {name} | `residual.{field}`, {scale:g} {unit} |" in text


@pytest.mark.parametrize("controller", ["capture-step", "ipm-step"])
def test_footholds_move_whatever_plans_them(controller):
    """Pulled to either side, the first step ends elsewhere."""
    env = ResidualStepEnv(robot(), controller=controller, pushes=None, duration=1.2)
    ends = []
    for pull in (-1.0, 0.0, 1.0):
        play(env, {"foothold_x": pull})
        assert env.controller.steps >= 1
        ends.append(env.simulation.data.qpos.copy())
    assert not np.array_equal(ends[0], ends[1]) and not np.array_equal(ends[1], ends[2])


@pytest.mark.parametrize(
    ("level", "away"),
    [
        ("ideal", (0.0, 0.06)),
        ({"body": {"mass": 0.001}}, (0.0, 0.06)),
        ({"sensors": {"encoder_bias": 0.005, "tilt_bias": 0.005}}, (0.0, 0.06)),
        ({"sensors": {"encoder_bias": 0.01, "tilt_bias": 0.01}}, (0.1, 1.0)),
    ],
)
def test_feet_go_home_where_legs_are_known_alone(level, away):
    """After the same push: where joints and tilt may be biased by 0.02 rad `feedback-step` stays in
    the stance that caught the fall, by another one's gains. `away` [m] is the range of a foot from
    its nominal place."""
    env = ResidualBalanceEnv(
        robot(), controller="feedback-step", realism=load_realism(level), duration=6.0
    )
    play(env)
    assert env.controller.steps >= 1 and not env.fallen
    state, feet = env.simulation.state, nominal_feet(robot())
    apart = turn(state.heading_yaw).T @ (state.sole_points[0] - state.sole_points[1])[:2]
    distance = float(np.linalg.norm(apart - (feet[0] - feet[1])[:2]))
    assert away[0] <= distance <= away[1]
