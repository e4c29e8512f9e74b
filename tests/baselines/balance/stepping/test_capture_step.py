"""Steps where feet in place are not enough; none where they are."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from poise.baselines.balance.references.targets import Offsets, no_offsets
from poise.baselines.balance.stepping.capture_step import CaptureStep
from poise.baselines.balance.stepping.planning.config import CaptureStepConfig
from poise.baselines.balance.stepping.planning.recentring import SHIFTING
from poise.baselines.balance.stepping.planning.swing import time_left
from poise.baselines.controller import WrappedController
from poise.baselines.environments.residual import ResidualBalanceEnv
from poise.baselines.registry import controller_config, load_controller
from poise.configs.errors import ConfigError
from poise.configs.schema import to_dict
from poise.envs.robots.menagerie import WHEEL
from tests.support import planned
from tests.support import stepping_reference as readable
from tests.support.refused import invalid
from tests.support.shared import robot

QUIET_STEPS = 0


def trial(controller, impulse, direction, seed=0, duration=4.0, watch=None, later=()):
    """Whether it fell, and the environment at the end; `later`: further pushes."""
    env = ResidualBalanceEnv(robot(), controller=controller, duration=duration)
    push = {"impulse": impulse, "direction": direction, "start": 0.2, "body": "torso"}
    env.reset(seed=seed, options={"push": [push, *later]})
    done, action = False, np.zeros(4)
    while not done:
        _, fallen, over = env.step_without_info(action)
        done = fallen or over
        if watch is not None:
            watch(env)
    return fallen, env


@pytest.mark.parametrize("name", ["capture-step", "feedback-step"])
def test_a_small_push_is_the_feet_in_place_controllers_bit_for_bit(name):
    """Until the capture point leaves what the feet reach, nothing differs from its own `qp`."""
    ends = []
    for controller in (controller_config("capture-step").qp, name):
        _, env = trial(controller, 10.0, 45.0, duration=1.0)
        ends.append(env.simulation.data.qpos.copy())
    np.testing.assert_array_equal(*ends)
    assert env.controller.steps == 0


@pytest.mark.parametrize(
    ("name", "impulse", "direction"),
    [
        ("capture-step", 24.0, 0.0),
        ("capture-step", 24.0, 135.0),
        ("feedback-step", 31.0, 135.0),
        ("feedback-step", 22.0, 270.0),
    ],
)
def test_steps_recover_what_feet_in_place_do_not(name, impulse, direction):
    """A push far above the baseline's limit: the momentum QP falls, this one comes to rest."""
    fallen, _ = trial("momentum-qp", impulse, direction, seed=1)
    assert fallen
    fallen, env = trial(name, impulse, direction, seed=1, duration=6.0)
    assert not fallen and env.recovered and env.controller.steps >= 1


@pytest.mark.parametrize("direction", [0.0, 90.0, 180.0])
def test_pushes_are_walked_off_on_the_g1(direction):
    """Pushes of 0.9 N·s/kg, far above what gains of another robot survive there."""
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    g1 = robot("unitree_g1")
    env = ResidualBalanceEnv(g1, controller="walk-off-g1", pushes=None, duration=6.0)
    push = {"impulse": 0.9 * g1.mass, "direction": direction, "start": 0.2, "duration": 0.1}
    env.reset(seed=0, options={"push": push})
    over = fallen = False
    while not (over or fallen):
        _, fallen, over = env.step_without_info(np.zeros(4))
    assert env.recovered and env.controller.steps >= 2


def test_the_h1_steps_back_only_where_it_must():
    """With 0.35 N·s/kg its feet stay; 0.48, which feet in place lose, it walks off."""
    pytest.importorskip(WHEEL, reason="its model is not installed: pip install 'poise[robots]'")
    h1 = robot("unitree_h1")
    env = ResidualBalanceEnv(h1, controller="walk-off-h1", pushes=None, duration=6.0)
    for specific, steps in ((0.35, False), (0.48, True)):
        push = {"specific_impulse": specific, "direction": 180.0, "start": 0.5, "duration": 0.1,
                "body": "pelvis"}  # fmt: skip
        env.reset(seed=0, options={"push": push})
        over = fallen = False
        while not (over or fallen):
            _, fallen, over = env.step_without_info(np.zeros(4))
        assert env.recovered and (env.controller.steps > 0) == steps


def test_feet_do_not_cross():
    """At every touchdown each foot is on its own side of the other."""
    widths = []

    def watch(env):
        state, controller = env.simulation.state, env.controller
        if controller.steps > len(widths) and controller.swing is None:
            widths.append(state.sole_points[0, 1] - state.sole_points[1, 1])

    trial("capture-step", 22.0, 0.0, watch=watch)
    assert widths
    assert min(widths) > 0.1


class Watched(WrappedController):
    """A controller of which `look(controller, state, targets, torques)` sees every tick."""

    def __init__(self, inner, look):
        super().__init__(inner, inner.robot)
        self.look, self.seen = look, []

    def torques(self, state, targets):
        tau = self.inner.torques(state, targets)
        self.seen.append(self.look(self.inner, state, targets, tau))
        return tau


def watched(controller, impulse, direction, look, duration=1.5):
    """What `look` says of each tick of a trial."""
    watch = Watched(controller, look)
    trial(watch, impulse, direction, duration=duration)
    return watch.seen


@pytest.mark.parametrize(
    ("name", "direction", "duration"),
    [("capture-step", 0.0, 1.5), ("capture-step", 90.0, 1.5), ("feedback-step", 0.0, 4.0)],
)
def test_torques_do_not_jump_at_a_switch(name, direction, duration):
    """From the tick before the first step on, torques change by at most `torque_rate_limit` of
    their limits; on the way back to the nominal stance too."""
    controller = load_controller(name, robot())
    ticks = watched(
        controller, 24.0, direction, lambda c, state, targets, tau: (c.steps, tau.copy()), duration
    )
    first = next(i for i, (steps, _) in enumerate(ticks) if steps > 0)
    torques = np.array([tau for _, tau in ticks[first - 1 :]])
    changes = np.abs(np.diff(torques, axis=0)) / robot().torque_limit
    assert len(changes) > 50
    assert controller.config.torque_rate_limit <= 0.6
    assert changes.max() <= controller.config.torque_rate_limit + 1e-9


def test_a_foot_gives_its_load_away_before_it_lifts_off():
    """While it unloads, its part of the planned force falls; then the foot is no contact."""

    def look(c, *_):
        unloading = c.swing is not None and c.swing.time == 0.0
        return c.sets.sets[0, 1].workspace.wrenches[6 * c.foot + 2] if unloading else np.nan

    controller = load_controller("capture-step", robot())
    loads = np.array(watched(controller, 24.0, 0.0, look, duration=0.6))
    loads = loads[np.isfinite(loads)]
    assert len(loads) >= 2
    assert np.all(np.diff(loads) < 0.0)
    assert loads[-1] < 0.5 * robot().mass * 9.81


def test_hips_that_are_used_up_bring_the_step_forward():
    """Angular momentum in the sense of the fall counts: with it the first step begins earlier."""
    begun = []
    for gain in (0.0, 0.5):
        settings = {**to_dict(controller_config("capture-step")), "momentum_gain": gain}
        controller = load_controller(settings, robot())
        begun.append(watched(controller, 24.0, 0.0, lambda c, *_: c.steps > 0, 0.6).index(True))
    assert begun[1] < begun[0]


@pytest.mark.parametrize(
    ("name", "direction"),
    [
        ("capture-step", 10.0),
        ("feedback-step", 10.0),
        ("feedback-step", 65.0),
        ("feedback-step", 200.0),
    ],
)
def test_targets_are_those_of_the_readable_form(name, direction, monkeypatch):
    """What the QPs are asked for at every tick of a recovery, in a swing and after it."""
    controller, kinds = load_controller(name, robot()), set()
    regions, stood, raised, left, stages = controller.region, [], [0.0], [np.inf], [0]
    steps = [0]
    planner = readable.ReadablePlanner(planned.Planner.of(controller))

    def look(c, state, targets, tau):
        if not c.steps:
            return
        yaw, feet = np.arctan2(*c.memory.level_frame[1::-1, 0]), state.sole_points
        if c.swing is not None:
            if c.steps > steps[-1]:
                planner.see(state, yaw)
            steps.append(c.steps)
            stood.clear()
            stance = 1 - c.foot
            region, overreach = planned.alone(regions, stance, feet[stance], yaw), 0.0
            ground, stride = feet[stance, 2], c.swing.foothold - feet[stance, :2]
            if left[0] > readable.FROZEN:  # the last ticks keep what was fed back
                planner.phase = c.feedback.signals.phase
                raised[0] = planner.added(state, c.foot, yaw)[3]
            left[0] = time_left(c.swing)
        else:
            if c.recentring.stage == SHIFTING and stages[-1] != SHIFTING:
                stood.clear()  # another heading from now on
            stood.append(feet.copy())
            left[0] = np.inf
            region, overreach = regions.both(stood[0], yaw), c.config.cop_overreach
            ground, stride = feet[:, 2].mean(), feet[0, :2] - feet[1, :2]
        kinds.add(c.swing is not None)
        stages.append(int(c.recentring.stage))
        expected = readable.guided(c, state, targets, region, overreach, ground, stride, raised[0])
        for entry, value in expected.items():
            np.testing.assert_allclose(
                getattr(c._reference_out, entry), value, rtol=1e-9, atol=1e-9
            )

    offsets = controller.offsets
    moved = no_offsets()
    moved.com[:], moved.cop[:], moved.height = (0.02, -0.01), (0.01, 0.005), -0.01
    moved.lean[:] = 0.05, 0.08
    added = moved.values

    def clear(own: Offsets) -> None:
        own.values[:] = added if own is offsets else 0.0

    monkeypatch.setattr(Offsets, "clear", clear)  # which the reset calls
    watched(controller, 22.0, direction, look, duration=2.5)
    assert set(stages) == (set(range(4)) if name == "feedback-step" else {0})
    assert kinds == {True, False} and np.array_equal(offsets.values, added)


def test_a_copy_is_a_controller_of_its_own():
    """Pickled or copied after a step it plays the same trial, and leaves the original alone."""
    _, env = trial("capture-step", 22.0, 180.0, duration=0.6)
    original, end = env.controller, env.simulation.data.qpos.copy()
    assert original.steps
    memory = [array.copy() for array in original.memory.members()]
    for twin in (copy.deepcopy(original), pickle.loads(pickle.dumps(original))):
        assert twin.steps and twin.steps == original.steps
        _, other = trial(twin, 22.0, 180.0, duration=0.6)
        np.testing.assert_array_equal(other.simulation.data.qpos, end)
    for array, before in zip(original.memory.members(), memory, strict=True):
        np.testing.assert_array_equal(array, before)


def test_a_step_at_the_first_tick_does_not_know_the_trial_before():
    """Thrown forward from the start, it ends as a new controller does."""
    ends, old = [], load_controller("capture-step", robot())
    trial(old, 20.0, 180.0, duration=0.6)
    for controller in (load_controller("capture-step", robot()), old):
        env = ResidualBalanceEnv(robot(), controller=controller, duration=0.5)
        qvel = np.zeros(robot().model.nv)
        qvel[0] = 1.3
        env.reset(options={"push": [], "qpos": robot().standing_qpos, "qvel": qvel})
        for _ in range(10):
            env.step_without_info(np.zeros(4))
        assert controller.steps >= 1
        ends.append(env.simulation.data.qpos.copy())
    np.testing.assert_array_equal(*ends)


@pytest.mark.parametrize(
    ("qp", "changes", "named"),
    [
        ("qp", {"root": "soft"}, ("qp.root", "'hard'")),
        ("step_qp", {"root": "soft"}, ("step_qp.root", "'hard'")),
        ("step_qp", {"solver": "daqp"}, ("step_qp.solver", "'active-set'")),
        ("qp", {"solver": "daqp"}, ("qp.solver", "'active-set'")),
        ("qp", {"solver_options": {"max_iter": 9.0}}, ("qp.solver_options",)),
        ("step_qp", {"period": 0.002}, ("step_qp.period",)),
    ],
)
def test_qps_that_cannot_step_are_refused(qp, changes, named):
    """A wrench on the root has no meaning in a step; the contact QPs have one solver and period."""
    config = controller_config("capture-step")
    config = replace(config, **{qp: replace(getattr(config, qp), **changes)})
    with invalid(*named):
        CaptureStep(robot(), config)


def test_replicas_start_anew():
    """After a reset nothing of the last trial is left."""
    _, env = trial("capture-step", 22.0, 180.0, duration=1.0)
    assert env.controller.steps
    env.controller.reset(env.simulation.state)
    assert not env.controller.steps and env.controller.swing is None
    assert env.controller.steps == env.controller.failures == 0


def test_packaged_configuration():
    """`capture-step` is a packaged controller of this kind, with physical roots."""
    config = controller_config("capture-step")
    assert isinstance(config, CaptureStepConfig)
    assert config.qp.root == "hard" and config.step_qp.root == "hard"
    assert isinstance(load_controller("capture-step", robot()), CaptureStep)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"gain": 0.0}, "gain"),
        ({"limits": {"time_min": -1.0}}, "limits.time_min"),
        ({"swing": {"lift": 1.5}}, "swing.lift"),
        ({"width": 1.0}, "width"),
    ],
)
def test_wrong_fields_are_named(change, field):
    """A wrong or unknown field is an error that says which."""
    with pytest.raises(ConfigError, match=field.rsplit(".", maxsplit=1)[-1]):
        load_controller({"kind": "capture-step", **change}, robot())
