"""The law that feeds the body's lean and turn back to a step."""

from dataclasses import fields

import mujoco
import numpy as np
import pytest

from poise.baselines.balance.stepping.planning import feedback
from poise.baselines.balance.stepping.planning.config import (
    SIGNALS,
    FallFeedback,
    PivotConfig,
    PivotGains,
    SignalGains,
    StepFeedback,
)
from poise.baselines.balance.stepping.planning.feedback import (
    evaluate_feedback,
    pivot_offset,
    schedule_gains,
)
from poise.baselines.registry import load_controller
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from tests.support.shared import generic_state, robot

YAW = 0.7


def arrays_of(robot, always, falls, pivot=None):
    """The gains of one robot, without a pivot unless one is given."""
    return feedback.feedback_arrays(robot, always, falls, pivot or PivotConfig())


def signals(simulation, side=1.0, yaw=YAW):
    """What is read beside the second sole."""
    f, state = arrays_of(simulation.robot, StepFeedback(), {}), simulation.state
    evaluate_feedback(f, state.arrays, state.sole_points[1], np.cos(yaw), np.sin(yaw), side)
    return dict(zip(SIGNALS, f.signals.values, strict=True))


def turned(ahead=0.0, left=0.0):
    """The humanoid faces `YAW` and leans as a whole: first to the left, then ahead [rad]."""
    simulation = Simulation(robot())
    qpos = robot().standing_qpos.copy()
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in (((0, 0, 1), YAW), ((0, 1, 0), ahead), ((1, 0, 0), -left)):
        turn = np.zeros(4)
        mujoco.mju_axisAngle2Quat(turn, np.array(axis, dtype=float), angle)
        mujoco.mju_mulQuat(q, q.copy(), turn)
    mujoco.mju_mulQuat(qpos[3:7], q, robot().standing_qpos[3:7])
    simulation.reset(qpos, np.zeros(robot().model.nv))
    return simulation


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_lean(side):
    """The sine of the angle, ahead and to the foot's side; at rest next to nothing."""
    values = signals(turned(ahead=0.2), side)
    assert values["lean_ahead"] == pytest.approx(np.sin(0.2), abs=1e-3)
    assert values["lean_outward"] == pytest.approx(0.0, abs=1e-3)
    values = signals(turned(left=0.3), side)
    assert values["lean_outward"] == pytest.approx(side * np.sin(0.3), abs=1e-3)
    values = signals(turned(), side)
    assert abs(values["lean_ahead"]) + abs(values["lean_outward"]) < 1e-3


def test_spin_is_mujocos_angular_momentum():
    """ω L/(m g h), about the axes that turn the body ahead and to the side."""
    simulation = generic_state(seed=4)
    model, data, r = simulation.robot.model, simulation.data, simulation.robot
    mujoco.mj_subtreeVel(model, data)
    x, y, _ = data.subtree_angmom[0]
    g, h = -model.opt.gravity[2], r.height_com
    unit = np.sqrt(g / h) / (r.mass * g * h)
    values = signals(simulation, side=-1.0)
    ahead = unit * (np.cos(YAW) * y - np.sin(YAW) * x)  # about the axis to the left
    right = unit * (np.cos(YAW) * x + np.sin(YAW) * y)  # about the axis ahead
    assert values["momentum_ahead"] == pytest.approx(ahead, rel=1e-6)
    assert values["momentum_outward"] == pytest.approx(right, rel=1e-6)
    assert min(abs(ahead), abs(right)) > 1e-4


def test_the_other_foot_sees_the_mirror_image():
    """Only what is outward changes its sign."""
    simulation = generic_state(seed=2)
    one, two = signals(simulation, 1.0), signals(simulation, -1.0)
    for name in SIGNALS:
        assert two[name] == (-one[name] if "outward" in name else one[name])
    assert one["capture_outward"] != 0.0


@pytest.mark.parametrize("name", ["humanoid", "toddler"])
def test_what_is_added_fits_the_robot(name):
    """Lengths in h, times in 1/ω; a row adds up its gains times the signals."""
    r, row = robot(name), SignalGains(constant=0.1, later_step=0.2, phase=0.3, lean_ahead=1.0)
    f = arrays_of(r, StepFeedback(row, row, row, row), {})
    f.signals.later_step, f.signals.phase = 1.0, 0.5
    state = generic_state(name, seed=1).state
    evaluate_feedback(f, state.arrays, state.sole_points[0], np.cos(YAW), np.sin(YAW), 1.0)
    expected = 0.1 + 0.2 + 0.15 + f.signals.lean_ahead
    h = r.height_com
    units = np.array([h, h, np.sqrt(h / -r.model.opt.gravity[2]), h])
    np.testing.assert_allclose(f.added.values, expected * units, rtol=1e-12)


@pytest.mark.parametrize(
    ("angle", "expected"),
    [(0.0, 1.5), (30.0, 1.5), (60.0, 1.25), (75.0, 1.125), (90.0, 1.0), (120.0, 2.5), (170.0, 4.0)],
)
def test_gains_are_linear_between_the_angles_of_falls(angle, expected):
    """What is always fed back and what is added there; further out as at the last angle."""
    r = robot()
    falls = {
        "back": FallFeedback(angle=150.0, ahead=SignalGains(lean_ahead=3.0)),
        "ahead": FallFeedback(angle=30.0, ahead=SignalGains(lean_ahead=0.5)),
        "side": FallFeedback(angle=90.0),
    }
    f = arrays_of(r, StepFeedback(SignalGains(lean_ahead=1.0, phase=0.3)), falls)
    for side in (1.0, -1.0):
        speed = 0.7 * np.array([np.cos(np.radians(angle)), side * np.sin(np.radians(angle))])
        f.signals.later_step = 1.0
        schedule_gains(f, *speed)
        np.testing.assert_array_equal(f.gains, f.always)  # further steps
        f.signals.later_step = 0.0
        schedule_gains(f, *speed)
        gains = dict(zip(SIGNALS, f.gains[0] / r.height_com, strict=True))
        assert gains.pop("lean_ahead") == pytest.approx(expected, rel=1e-12)
        assert gains.pop("phase") == pytest.approx(0.3, rel=1e-12)
        assert not any(gains.values()) and not f.gains[1:].any()


def test_each_signal_has_its_index():
    """The kernels' names of signals and changes are those of the YAML files, in their order."""
    assert tuple(feedback.Signals.mutable) == SIGNALS
    assert tuple(feedback.Changes.mutable) == tuple(item.name for item in fields(StepFeedback))
    f = arrays_of(robot(), StepFeedback(), {})
    for k, name in enumerate(SIGNALS):
        setattr(f.signals, name, 1.0 + k)
    assert f.signals.values.tolist() == [1.0 + k for k in range(len(SIGNALS))]


@pytest.mark.parametrize(
    ("falls", "words"),
    [
        ({"a": {"angle": 40.0}, "b": {"angle": 40.0}}, ["falls", "differ"]),
        ({"a": {"angle": 190.0}}, ["falls.a.angle", "180"]),
        ({"a": {"time": {"phase": 0.1}}}, ["falls.a.angle", "missing"]),
        ({"a": {"angle": 40.0, "sideways": {}}}, ["falls.a.sideways", "outward"]),
    ],
)
def test_falls_that_are_wrong(falls, words):
    """One error names the field."""
    with pytest.raises(ConfigError) as error:
        load_controller({"kind": "capture-step", "falls": falls}, robot())
    for word in words:
        assert word in str(error.value)


def test_the_force_passes_the_com_where_it_rights_the_trunk():
    """r = k ω L/(m g) + k' h e along the heading, by MuJoCo's L and the root's axes."""
    simulation = generic_state(seed=4)
    r, state, data = simulation.robot, simulation.state, simulation.data
    mujoco.mj_subtreeVel(r.model, data)
    x, y, _ = data.subtree_angmom[0]
    h = r.height_com
    omega = np.sqrt(-r.model.opt.gravity[2] / h)
    upright = robot().standing_qpos[3:7], np.zeros(3)
    mujoco.mju_rotVecQuat(upright[1], np.array([0.0, 0.0, 1.0]), upright[0] * [1, -1, -1, -1])
    e = np.zeros(3)  # the root's axis that is vertical at rest, now
    mujoco.mju_rotVecQuat(e, upright[1], data.qpos[3:7])
    gains = PivotGains(momentum=0.8, lean=-0.3)
    f = arrays_of(r, StepFeedback(), {}, PivotConfig(swing=gains, lateral_fraction=0.5))
    found = pivot_offset(f, state.arrays, f.swing, np.cos(YAW), np.sin(YAW))
    turning = 0.8 * omega / (r.mass * -r.model.opt.gravity[2]) * np.array([y, -x])
    wanted = turning - 0.3 * h * e[:2]
    ahead = np.array([np.cos(YAW), np.sin(YAW)])
    left = np.array([-np.sin(YAW), np.cos(YAW)])
    expected = (wanted @ ahead) * ahead + 0.5 * (wanted @ left) * left
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert np.all(np.abs(expected) > 1e-4)


def test_such_a_force_takes_the_turn_back():
    """c̈ = ω² (c − p + r) at a constant height makes L̇ = −k ω L about the horizontal axes."""
    simulation, k = generic_state(seed=4), 0.7
    r, state = simulation.robot, simulation.state
    h, weight = r.height_com, r.mass * 9.81
    omega = np.sqrt(9.81 / h)
    pivot = PivotConfig(stance=PivotGains(momentum=k))
    f = arrays_of(r, StepFeedback(), {}, pivot)
    x, y = pivot_offset(f, state.arrays, f.stance, np.cos(YAW), np.sin(YAW))
    p = np.array([0.1, 0.05, -h])  # of the CoP from the CoM
    force = r.mass * omega**2 * (np.array([x, y, 0.0]) - p)
    force[2] = weight
    L = state.angular_momentum[:2]
    np.testing.assert_allclose(np.cross(p, force)[:2], -k * omega * L, atol=1e-9)
    assert np.all(np.abs(L) > 1e-2)
