"""A hand on a wall: kernel against NumPy, the QP with it, and a robot that leans on it."""

from itertools import islice

import numpy as np
import pytest

from poise.baselines import CaptureStep, CaptureStepConfig, MomentumQP, MomentumQPConfig, Targets
from poise.baselines.registry import controller_config, load_controller
from poise.baselines.solvers import make_solver, residuals
from poise.baselines.whole_body.contacts.contact import (
    Contact,
    ContactRowArrays,
    ContactRows,
    PointTick,
)
from poise.baselines.whole_body.contacts.point import PointContact, force_cone
from poise.baselines.whole_body.formulation import build, torques_of, unknowns
from poise.baselines.whole_body.parts.part import bind_parts
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.simulation import Simulation
from tests.support import contact_sets
from tests.support.physics import random_state, robot_named
from tests.support.refused import invalid
from tests.support.wall import contact_described, reaching, robot_at_a_wall, wall_force

NORMAL = np.array([-1.0, 0.0, 0.0])


def controller(root="hard", contacts=True, **changes):
    """The baseline with a hand on the wall."""
    described = {"contacts": {"hand": contact_described(**changes)}} if contacts else {}
    config = controller_config({"base": "momentum-qp", "root": root, **described})
    return MomentumQP(robot_at_a_wall(), config)


def leaning(qp, seconds, forward=0.08):
    """Ticks of a robot whose CoM goes forward, the hand on the wall: (state, targets, force)."""
    robot = robot_at_a_wall()
    simulation = Simulation(robot)
    state = simulation.reset(reaching(robot))
    targets = Targets.standing(robot, state)
    targets.q_ref[:] = state.q
    qp.reset(state)
    for k in range(round(seconds / qp.period)):
        targets.com[0] = targets.cop[0] = forward * min(k / 500, 1.0)
        torques = qp.torques(state, targets)
        yield simulation, state, targets, torques
        state = simulation.step(torques, 2)


def after(qp, seconds):
    """The tick of `leaning` at that time, before the simulation goes on."""
    return next(islice(leaning(qp, 2.0 * seconds), round(seconds / qp.period), None))


def test_a_point_is_the_only_kind():
    """Another one is to be added to the tests of this file."""
    assert set(Contact.kinds()) == {"point"}


def test_the_kernel_fills_the_rows_that_NumPy_has():
    """In random states of motion: 1e-9."""
    robot = robot_named("humanoid")
    normal = [0.3, -0.8, 0.5]
    config = PointContact("left_lower_arm", tuple(normal), (0.1, 0.2, 0.3), force=0.1)
    (contact,) = bind_parts({"hand": config}, robot, "contacts").values()
    nv = robot.model.nv
    for seed in range(4):
        simulation = Simulation(robot)
        state = simulation.reset(*random_state(robot, np.random.default_rng(seed)))
        arrays = ContactRowArrays(
            guarded_zeros(3),
            guarded_zeros((3, nv)),
            guarded_zeros(3),
            guarded_zeros((5, 3)),
            guarded_zeros(5),
            guarded_zeros(3),
            guarded_zeros(3),
        )
        config.kernel(PointTick(state.arrays, contact.block, arrays))
        expected = contact.rows(state)
        for name in ContactRows._fields:
            ours, theirs = getattr(arrays, name), getattr(expected, name)
            scale = max(np.abs(theirs).max(), 1.0)
            assert np.abs(theirs).max() > 0.0
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * scale)


@pytest.mark.parametrize("normal", [(0, 0, 1), (-1, 0, 0), (0.3, -0.5, 0.2), (0.1, 0, -0.99)])
def test_the_cone_is_a_pyramid_about_the_normal(normal):
    """Inside: less than μ across; outside: more, or pulling; the last row is the normal force."""
    normal, μ = np.array(normal) / np.linalg.norm(normal), 0.4
    cone = force_cone(normal, μ)
    rng = np.random.default_rng(2)
    for _ in range(200):
        across = np.cross(normal, rng.normal(size=3))
        across /= np.linalg.norm(across)
        assert (cone[:4] @ (normal + 0.999 * μ / np.sqrt(2.0) * across)).max() < 0.0
        assert (cone[:4] @ (normal + 1.001 * μ * across)).max() > 0.0
        assert (cone[:4] @ (-normal + across)).max() > 0.0
    assert cone[4] @ (3.0 * normal) == pytest.approx(3.0)


@pytest.mark.parametrize("root", ["hard", "soft"])
def test_the_compiled_problem_has_the_same_solution(root):
    """Torques, accelerations, wrenches and the wall's force while the robot moves: 1e-9."""
    qp, binding = controller(root, friction=0.05, largest_force=0.062), 0
    for k, (_, state, targets, torques) in enumerate(leaning(qp, 1.2)):
        if k % 25 != 3:
            continue
        points = [contact.rows(state) for contact in qp.contacts.values()]
        tasks, cop_vel = qp.tasks.values(), qp.workspace.cop_vel
        readable = build(state, targets, qp.parameters, tasks, cop_vel, points=points)
        solution = make_solver("daqp").solve(readable)
        assert solution.solved
        vdot, w, _ = unknowns(state, solution.x, points)
        found = torques_of(state, solution.x, points)[state.robot.motor_dofs - 6]
        force = qp.forces["hand"]
        pairs = [(found, torques), (vdot, qp.vdot), (w[:12], qp.wrenches), (w[12:], force)]
        for ours, theirs in pairs:
            np.testing.assert_allclose(ours, theirs, atol=1e-9 * max(np.abs(theirs).max(), 1.0))
        binding += (points[0].cone @ force - points[0].bound).max() > -1e-6
    assert binding >= 3  # of 12: the cone is felt


def test_motion_obeys_physics_and_the_hand_stays():
    """The root's rows of M v̇ + h = Jᵀw with the wall's force; the hand has the motion asked for;
    optimality conditions of the reduced problem."""
    qp = controller()
    _, state, targets, _ = after(qp, 0.4)
    (point,) = (contact.rows(state) for contact in qp.contacts.values())
    force = state.M @ qp.vdot + state.h - state.J.T @ qp.wrenches - point.J.T @ qp.forces["hand"]
    np.testing.assert_allclose(force[:6], 0.0, atol=1e-6)
    np.testing.assert_allclose(point.J @ qp.vdot, point.accel, atol=1e-6)
    problem = qp.problem(state, targets)
    solution = make_solver("active-set").solve(problem)
    left, scale = residuals(problem, solution), np.abs(problem.g).max()
    assert solution.solved
    assert left.primal < 1e-8 and left.dual < 1e-8 * scale and left.gap < 1e-7 * scale


def test_the_force_that_is_wanted_has_a_limit():
    """A wish beyond `largest_force` gets that; both may be written to."""
    qp = controller(force=0.3, force_weight=100.0, largest_force=0.05)
    _, state, targets, _ = after(qp, 0.1)
    weight = state.mass * state.robot.gravity
    assert NORMAL @ qp.forces["hand"] == pytest.approx(0.05 * weight, rel=1e-6)
    qp.contacts["hand"].block.largest = 0.02 * weight
    qp.torques(state, targets)
    assert NORMAL @ qp.forces["hand"] == pytest.approx(0.02 * weight, rel=1e-6)


def test_a_robot_leans_on_a_wall():
    """Ten seconds, the CoM 8 cm ahead of the soles' middle: the wall's force is in its cone and
    what the QP asks for, and holds the CoP of the feet back; without it the CoP is under the CoM.
    """
    qp, weight = controller(), robot_at_a_wall().units.force
    for k, (simulation, *_) in enumerate(leaning(qp, 10.0)):
        state = simulation.state
        if k % 125 == 124:
            force, asked = wall_force(simulation), qp.forces["hand"]
            np.testing.assert_allclose(force, asked, atol=0.02 * 0.06 * weight)
            pressing = NORMAL @ force
            assert pressing > 0.05 * weight
            assert np.linalg.norm(force - pressing * NORMAL) < 0.5 * pressing
    assert qp.failures == 0 and not state.other_contact
    assert np.linalg.norm(state.com_vel) < 0.002
    assert state.com[0] == pytest.approx(0.08, abs=0.003)
    ahead = state.com[0] - _cop_of_feet(qp, state)[0]
    assert ahead == pytest.approx(0.06 * 1.18, abs=0.01)  # moment of the force over the weight
    alone = controller(contacts=False)
    _, state, _, _ = after(alone, 3.0)
    assert abs(state.com[0] - _cop_of_feet(alone, state)[0]) < 0.015


def _cop_of_feet(qp, state):
    """(2,) where the soles' wrenches of the last solution have no horizontal moment [m]."""
    points, wrenches = state.sole_points, qp.wrenches.reshape(-1, 6)
    force = wrenches[:, 2]
    x = points[:, 0] * force - wrenches[:, 4]
    y = points[:, 1] * force + wrenches[:, 3]
    return np.array([x.sum(), y.sum()]) / force.sum()


@pytest.mark.parametrize(
    ("contact", "message"),
    [
        ({"kind": "rope"}, ("contacts.c.kind", "'rope'", "point")),
        ({"kind": "point", "body": "torso"}, ("contacts.c.normal",)),
        (contact_described(body="nose"), ("contacts.c.body", "'nose'", "right_lower_arm")),
        (contact_described(normal=[0.0, 0.0, 0.0]), ("contacts.c",)),
        (contact_described(friction=0.0), ("contacts.c.friction", "0")),
    ],
)
def test_a_contact_that_cannot_be_is_refused(contact, message):
    """Naming the field and the choices."""
    with invalid(*message):
        load_controller({"base": "momentum-qp", "contacts": {"c": contact}}, robot_at_a_wall())


@pytest.mark.parametrize("soles", [(0,), (1,), (0, 1)])
def test_controllers_that_step_have_contacts_in_every_contact_set(soles):
    """With one foot on the ground or two: the readable problem's solution, and the wall's force."""
    robot, qp = robot_at_a_wall(), controller()
    hand = {"hand": PointContact(**contact_described(largest_force=0.05))}
    config = CaptureStepConfig(step_qp=MomentumQPConfig(contacts=hand))
    sets = CaptureStep(robot, config).sets
    _, state, targets, _ = after(qp, 0.4)
    points = [contact.rows(state) for contact in sets.contacts.values()]
    _, ws = contact_sets.tick(sets, state, targets, soles)
    chosen, restricted = sets.sets[soles], contact_sets.restricted(sets, state, targets, soles)
    tasks, cop_vel = sets.tasks.values(), chosen.workspace.cop_vel
    readable = build(restricted, targets, chosen.parameters, tasks, cop_vel, points=points)
    solution = make_solver("daqp").solve(readable)
    assert solution.solved and sets.failures == 0
    vdot, w, _ = unknowns(restricted, solution.x, points)
    np.testing.assert_allclose(chosen.workspace.vdot, vdot, atol=1e-6 * np.abs(vdot).max())
    force = ws.wrenches[-3:]
    np.testing.assert_allclose(force, w[-3:], atol=1e-6 * np.abs(w).max())
    assert 1.0 < NORMAL @ force <= 0.05 * robot.units.force * (1.0 + 1e-9)
    np.testing.assert_allclose(points[0].J @ chosen.workspace.vdot, points[0].accel, atol=1e-6)
