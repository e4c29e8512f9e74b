"""Every kind of limit: compiled against NumPy, what it bounds, and its configuration."""

from dataclasses import replace

import numpy as np
import pytest

from poise.baselines import CaptureStep, CaptureStepConfig, MomentumQP, MomentumQPConfig, Targets
from poise.baselines.registry import controller_config, load_controller
from poise.baselines.solvers import Status, make_solver, residuals
from poise.baselines.whole_body.constraint_rows import torque_matrix
from poise.baselines.whole_body.formulation import build, torques_of, unknowns
from poise.baselines.whole_body.limits.joint_speed import JointSpeed
from poise.baselines.whole_body.limits.limit import Limit
from poise.baselines.whole_body.limits.torque import Torque
from poise.configs.schema import build as build_config
from poise.configs.schema import to_dict
from poise.envs.physics.simulation import Simulation
from tests.support import contact_sets
from tests.support.limits import EXAMPLES, described
from tests.support.physics import recovery, robot_named
from tests.support.refused import invalid


def config(*names, **changes):
    """A momentum QP with these examples."""
    return controller_config({"base": "momentum-qp", "limits": described(*names, **changes)})


def controller(*names, **changes):
    return MomentumQP(robot_named("humanoid"), config(*names, **changes))


def solved_ticks():
    return [tick for tick in recovery()[::5] if tick.solved]


def test_every_kind_has_an_example():
    """A new limit is looked at by all tests of this file."""
    assert set(EXAMPLES) == set(Limit.kinds())


@pytest.mark.parametrize("kind", EXAMPLES)
def test_the_compiled_problem_has_the_same_solution_and_keeps_the_limit(kind):
    """Torques and accelerations along push recoveries: 1e-9 relative; the rows bind in some."""
    qp, binding = controller(kind), 0
    default = MomentumQP(qp.robot, controller_config("momentum-qp"))
    for tick in solved_ticks():
        state, targets = tick.state, tick.targets
        qp.reset()
        torques = qp.torques(state, targets)
        assert qp.failures == 0
        solution = make_solver("daqp").solve(
            build(state, targets, qp.parameters, qp.tasks.values(), limits=qp.limits.values())
        )
        assert solution.solved
        found = torques_of(state, solution.x)[state.robot.motor_dofs - 6]
        np.testing.assert_allclose(found, torques, atol=1e-9 * np.abs(torques).max())
        vdot = unknowns(state, solution.x).vdot
        np.testing.assert_allclose(qp.vdot, vdot, atol=1e-9 * np.abs(vdot).max())
        default.reset()
        default.torques(state, targets)
        bounds = qp.limits[kind].rows(state, torque_matrix(state))
        ours, theirs = (_value(bounds, each) for each in (qp, default))
        scale = np.abs(ours).max()
        assert np.all(ours <= bounds.u + 1e-9 * scale) and np.all(ours >= bounds.l - 1e-9 * scale)
        binding += np.any(theirs > bounds.u + 1e-3 * scale) or np.any(
            theirs < bounds.l - 1e-3 * scale
        )
    assert binding >= 3  # ticks in which the QP without the limit breaks it


def _value(bounds, qp):
    """C x of the last solution in (v̇, w)."""
    x = np.concatenate([qp.vdot, qp.wrenches])
    return bounds.C @ x[: bounds.C.shape[1]]


def test_optimality_conditions_with_limits():
    """No row is violated, the gradient vanishes, the duality gap is closed."""
    tick = solved_ticks()[3]
    problem = controller().problem(tick.state, tick.targets)
    solution = make_solver("active-set").solve(problem)
    left, scale = residuals(problem, solution), np.abs(problem.g).max()
    assert solution.solved
    assert left.primal < 1e-8 and left.dual < 1e-8 * scale and left.gap < 1e-7 * scale


def test_the_gains_have_the_robot_s_units():
    """A fraction of the motors' torques, zero without a motor; speeds in ω, times in 1/ω."""
    robot, limits = robot_named("humanoid"), controller().limits
    torque, speed = limits["torque"].block, limits["joint-speed"].block
    names = [robot.joint_names[i] for i in torque.joints]
    assert "left_knee" in names and all("knee" in n or n.startswith("abdomen") for n in names)
    motors = dict(zip(robot.motor_dofs - 6, robot.torque_limit, strict=True))
    np.testing.assert_allclose(torque.largest, [0.3 * motors[i] for i in torque.joints])
    ω = robot.omega
    np.testing.assert_allclose(speed.largest, 0.1 * ω)
    assert speed.horizon == pytest.approx(0.1 / ω) and speed.floor == pytest.approx(20.0 * ω**2)


def test_a_fast_joint_is_braked_by_no_more_than_the_floor():
    """From twice the limit within the horizon; from far more with `floor`, the way it can."""
    robot = robot_named("humanoid")
    qp = controller("joint-speed", joints=["left_elbow"], largest=1.0)
    ω, dof = robot.omega, 6 + robot.joint_names.index("left_elbow")
    for speed, low, high in ((2.0, -30.0, -10.0), (8.0, -90.0, -20.0), (-2.0, 10.0, 30.0)):
        simulation = Simulation(robot)
        velocity = np.zeros(robot.model.nv)
        velocity[dof] = speed * ω
        state = simulation.reset(robot.standing_qpos, velocity)
        bounds = qp.limits["joint-speed"].rows(state, torque_matrix(state))
        np.testing.assert_allclose([bounds.l[0], bounds.u[0]], [low * ω**2, high * ω**2])


def test_a_limit_may_be_written_to():
    """The next tick has it."""
    tick = solved_ticks()[3]
    qp = controller("torque", share=1.0)
    joints = qp.limits["torque"].block.joints
    qp.torques(tick.state, tick.targets)
    largest = 0.5 * np.abs(qp.workspace.tau[joints]).max()
    qp.limits["torque"].block.largest[:] = largest
    qp.torques(tick.state, tick.targets)
    assert np.abs(qp.workspace.tau[joints]).max() == pytest.approx(largest, rel=1e-6)


def test_without_joint_limits_no_joint_is_stopped():
    """`joint: null` takes their rows away, from both forms of the problem."""
    robot, tick = robot_named("humanoid"), solved_ticks()[3]
    with_limits, without = (
        MomentumQP(robot, controller_config({"base": "momentum-qp", **changes}))
        for changes in ({}, {"joint": None})
    )
    nj = len(robot.joint_names)
    bounded, free = (qp.problem(tick.state, tick.targets) for qp in (with_limits, without))
    np.testing.assert_array_equal(free.C, bounded.C)
    np.testing.assert_array_equal(free.u[:-nj], bounded.u[:-nj])
    assert np.isfinite(bounded.u[-nj:]).any() and not np.isfinite(free.u[-nj:]).any()
    assert np.isfinite(bounded.l[-nj:]).any() and not np.isfinite(free.l[-nj:]).any()
    rows = [
        len(build(tick.state, tick.targets, qp.parameters, tick.tasks).l)
        for qp in (without, with_limits)
    ]
    assert rows[0] == rows[1] - nj


def test_a_problem_that_limits_make_impossible_is_solved_without_them():
    """They go with the joint limits, and no failure is counted."""
    tick = solved_ticks()[3]
    qp = controller("joint-speed", largest=1e-6, horizon=1e-6, floor=1e9)  # beyond all torques
    impossible = make_solver("daqp").solve(qp.problem(tick.state, tick.targets))
    assert impossible.status is Status.INFEASIBLE
    default = MomentumQP(qp.robot, replace(qp.config, limits={}, joint=None))
    ours, theirs = (each.torques(tick.state, tick.targets) for each in (qp, default))
    assert qp.failures == 0
    np.testing.assert_allclose(ours, theirs, atol=1e-7 * np.abs(theirs).max())


def test_limits_are_read_from_a_file(tmp_path):
    """Under names of one's own, over those of a base; what is written back says the same."""
    below, above = tmp_path / "below.yaml", tmp_path / "above.yaml"
    below.write_text("base: momentum-qp\nlimits: {arms: {kind: torque, joints: ['*elbow']}}\n")
    speed = "{kind: joint-speed, largest: 3}"
    above.write_text(
        f"base: {below}\nlimits: {{arms: {{share: 0.5}}, all: {speed}}}\njoint: null\n"
    )
    found = controller_config(above)
    assert found.limits == {"arms": Torque(("*elbow",), share=0.5), "all": JointSpeed(3.0)}
    assert found.joint is None
    assert build_config(MomentumQPConfig, to_dict(found), "again") == found
    assert "limits" not in to_dict(controller_config("momentum-qp"))


@pytest.mark.parametrize(
    ("limit", "message"),
    [
        ({"kind": "power"}, ("limits.c.kind", "'power'", "joint-speed", "torque")),
        ({"kind": "joint-speed"}, ("limits.c.largest",)),
        ({"kind": "torque", "joints": ["tail*"]}, ("limits.c.joints", "'tail*'", "left_elbow")),
        ({"kind": "torque", "share": 2.0}, ("limits.c.share", "1")),
    ],
)
def test_a_limit_that_cannot_be_is_refused(limit, message):
    """Naming the field and the choices."""
    with invalid(*message):
        load_controller({"base": "momentum-qp", "limits": {"c": limit}}, robot_named("humanoid"))


def test_controllers_that_step_have_limits_in_every_contact_set():
    """A limit of `step_qp` is kept with one foot on the ground and with two."""
    robot = robot_named("humanoid")
    torque = Torque(("*elbow",), share=0.01)
    plain = CaptureStep(robot, CaptureStepConfig(step_qp=MomentumQPConfig()))
    limited = CaptureStep(
        robot, CaptureStepConfig(step_qp=MomentumQPConfig(limits={"arms": torque}))
    )
    state = recovery()[20].state
    targets = Targets.standing(robot, state)
    elbows = [robot.joint_names.index(f"{side}_elbow") for side in ("left", "right")]
    largest = 0.01 * robot.torque_limit.max()
    for soles in ((0,), (1,), (0, 1)):
        free, held = (
            contact_sets.problem(each.sets, state, targets, soles) for each in (plain, limited)
        )
        assert len(held.l) == len(free.l) + 2
        _, ws = contact_sets.tick(limited.sets, state, targets, soles)
        assert np.abs(ws.tau[elbows]).max() <= largest
