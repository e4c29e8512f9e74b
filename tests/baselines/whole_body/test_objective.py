"""The objective is the sum of its tasks: each can be read, replaced, dropped and added to."""

from dataclasses import dataclass, fields, replace
from typing import ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.baselines import load_controller
from poise.baselines.controller import Targets
from poise.baselines.registry import controller_config
from poise.baselines.solvers import make_solver, residuals
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.baselines.whole_body.momentum_qp import MomentumQP
from poise.baselines.whole_body.tasks.com import CoM
from poise.baselines.whole_body.tasks.cop import CoP
from poise.baselines.whole_body.tasks.posture import Posture
from poise.baselines.whole_body.tasks.root import RootWrench
from poise.baselines.whole_body.tasks.task import Rows, Task, TaskSpace, task_input
from poise.baselines.whole_body.tasks.torques import Torques, TorquesBlock
from poise.baselines.whole_body.tasks.wrenches import Wrenches
from poise.configs.errors import ConfigError
from poise.envs.physics.simulation import Simulation
from tests.support.physics import random_state, recovery, robot_named

STANDARD = ("posture", "com", "cop", "wrenches", "torques")


def config(**changes):
    """The packaged gains with some fields changed."""
    return controller_config({"base": "momentum-qp", "root": "soft", **changes})


def situation(seed=0):
    """A random state in the air, targets that all ask for something."""
    robot, rng = robot_named("humanoid"), np.random.default_rng(seed)
    simulation = Simulation(robot)
    state = simulation.reset(*random_state(robot, rng))
    state.arrays.cop[:] = rng.normal(size=2)
    targets = Targets.standing(robot, state)
    for name in ("v_ref", "a_ref", "root_vel", "root_acc", "com_vel", "com_acc", "cop"):
        getattr(targets, name)[:] = rng.normal(size=len(getattr(targets, name)))
    targets.com[:] = state.com + 0.01 * rng.normal(size=3)  # near, where the posture has weight
    return robot, state, targets


def affine(ws):
    """Z and z₀ of (v̇, w, u_root) = Z x + z₀, by the elimination."""
    u = np.zeros((6, len(ws.g)))
    u[:, ws.first_root :] = np.eye(6)
    return np.vstack([ws.V, ws.E, u]), np.concatenate([ws.vdot0, ws.w0, np.zeros(6)])


def term(rows, ws):
    """H and g of ½ Σ weights (A (v̇, w, u_root) − b)² in the unknowns x of a workspace."""
    Z, z0 = affine(ws)
    A = np.pad(rows.A, ((0, 0), (0, len(Z) - rows.A.shape[1])))
    weighted = rows.weights[:, None] * (A @ Z)
    return (A @ Z).T @ weighted, weighted.T @ (A @ z0 - rows.b)


def difference(one, other):
    """H and g of one problem less those of another."""
    return one.H - other.H, one.g - other.g


def assert_terms(found, expected, scale):
    """Both agree to 1e-9 of the size of the problem that they were taken from."""
    assert np.abs(expected[0]).max() > 0.0
    for ours, theirs, size in zip(found, expected, (scale.H, scale.g), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * np.abs(size).max())


def test_the_packaged_objective_is_the_sum_of_the_papers_terms():
    """H and g against a dense sum, each term written out here from its equation: 1e-9."""
    robot, state, targets = situation()
    c, cop_vel = config(), np.array([0.3, -0.2])
    qp = MomentumQP(robot, c)
    qp.problem(state, targets)  # for the elimination
    qp.workspace.cop_prev[:] = state.cop - qp.period * cop_vel
    problem, ws = qp.problem(state, targets), qp.workspace
    nv, k, nj = len(state.qvel), len(state.J), len(state.q)
    m, g, h = robot.mass, 9.81, robot.height_com
    ω = np.sqrt(g / h)

    k_t = np.array([c.posture.root_stiffness] * 3 + [c.posture.stiffness] * nj) * ω**2
    weight = np.array([c.posture.root_weight] * 3 + [c.posture.leg_weight] * nj)
    for j, name in enumerate(robot.joint_names):
        if name.startswith("abdomen"):  # what moves both soles from the pelvis on
            weight[3 + j] = c.posture.trunk_weight
        elif "shoulder" in name or "elbow" in name:
            weight[3 + j], k_t[3 + j] = c.posture.free_weight, c.posture.free_stiffness * ω**2
    d_t = 2.0 * c.posture.damping_ratio * np.sqrt(k_t)
    turn = Rotation.from_matrix(state.root_axes.T @ targets.root_axes).as_rotvec()
    error = np.concatenate([turn, targets.q_ref - state.q])
    a_ref = np.concatenate([targets.root_acc, targets.a_ref])
    v_ref = np.concatenate([targets.root_vel, targets.v_ref])
    away = np.sum((state.com - targets.com)[:2] ** 2) / (c.posture.far_distance * h) ** 2
    β = c.posture.far_share + (1.0 - c.posture.far_share) * np.exp(-away)
    posture = Rows(
        np.eye(nv)[3:], a_ref + k_t * error + d_t * (v_ref - state.qvel[3:]), β * weight / ω**4
    )

    s_c = np.array([c.com.stiffness] * 2 + [c.com.height_stiffness]) * ω**2
    d_c = 2.0 * c.com.damping_ratio * np.sqrt(s_c)
    P_des = m * (
        targets.com_acc + s_c * (targets.com - state.com) + d_c * (targets.com_vel - state.com_vel)
    )
    ω_c = np.array([c.com.weight] * 2 + [c.com.height_weight]) / (m * g) ** 2
    com = Rows(state.A[:3], P_des - state.Adot_v[:3], ω_c)

    T = c.cop.horizon / ω
    p_acc = -c.cop.stiffness * ω**2 * (state.cop - targets.cop) - c.cop.damping * ω * cop_vel
    p_des = np.append(state.cop + T * cop_vel + 0.5 * T**2 * p_acc, state.origin[2])
    L_des = np.cross(p_des - state.com, P_des + [0.0, 0.0, m * g])
    ω_p = np.array([c.cop.weight] * 2 + [c.cop.yaw_weight]) / (m * g * h) ** 2
    cop = Rows(state.A[3:], L_des - state.Adot_v[3:], ω_p)

    small = np.tile(
        [c.contact.force_weight / (m * g) ** 2] * 3
        + [c.contact.moment_weight / (m * g * h) ** 2] * 3,
        2,
    )
    wrenches = Rows(np.eye(k, nv + k, nv), np.zeros(k), small)
    torques = Rows(
        np.hstack([state.M, -state.J.T])[6:], -state.h[6:],
        np.full(nj, c.torque.weight / (m * g * h) ** 2),
    )  # fmt: skip
    ω_root = c.root_weight / np.repeat([m * g, m * g * h], 3) ** 2
    root = Rows(np.eye(6, nv + k + 6, nv + k), np.zeros(6), ω_root)
    H, gradient = np.zeros_like(problem.H), np.zeros_like(problem.g)
    for rows in (posture, com, cop, wrenches, torques, root):
        added = term(rows, ws)
        H, gradient = H + added[0], gradient + added[1]
    H[: ws.first_internal, : ws.first_internal] += 1e-8 / ω**4 * np.eye(ws.first_internal)
    np.testing.assert_allclose(problem.H, H, rtol=0.0, atol=1e-9 * np.abs(H).max())
    np.testing.assert_allclose(problem.g, gradient, rtol=0.0, atol=1e-9 * np.abs(gradient).max())


@pytest.mark.parametrize("name", [*STANDARD, "root"])
def test_dropping_a_task_removes_its_term(name):
    """H and g lose what its rows say, and no more; a CoM task is also what the CoP task reads."""
    robot, state, targets = situation(1)
    whole, other = MomentumQP(robot, config()), MomentumQP(robot, config())
    assert list(whole.tasks) == [*STANDARD, "root"]
    with_all = whole.problem(state, targets)
    given = task_input(state, targets)
    if name == "com":
        del whole.tasks["cop"], other.tasks["cop"]
        whole, other = rebuilt(whole), rebuilt(other)
        with_all = whole.problem(state, targets)
    if name == "cop":
        com = other.tasks["com"].rows(given)
        given = given._replace(force=com.b + state.A_bias[:3])
    expected = term(other.tasks.pop(name).rows(given), whole.workspace)
    without = rebuilt(other).problem(state, targets)
    assert_terms(difference(with_all, without), expected, with_all)


def rebuilt(qp):
    """A controller with the tasks that `qp` has left."""
    new = MomentumQP(qp.robot, qp.config)
    new.tasks = qp.tasks
    return new


def test_a_file_drops_and_replaces_tasks(tmp_path):
    """`cop: null` drops it; a name under `tasks` replaces the standard one of that name."""
    path = tmp_path / "mine.yaml"
    path.write_text(
        "base: momentum-qp\ncop: null\n"
        "tasks:\n"
        "  posture: {kind: posture, leg_weight: 7.0}\n"
        "  ankles: {kind: torques, weight: 0.5}\n"
    )
    qp = load_controller(path, robot_named("humanoid"))
    assert list(qp.tasks) == ["posture", "com", "wrenches", "torques", "ankles"]
    assert qp.tasks["posture"].part == Posture(leg_weight=7.0)
    _, state, targets = situation(2)
    plain = MomentumQP(qp.robot, replace(qp.config, tasks={}, posture=Posture(leg_weight=7.0)))
    expected = term(Torques(0.5).rows(task_input(state, targets), qp.tasks["ankles"].block),
                    qp_workspace(plain, state, targets))  # fmt: skip
    both = qp.problem(state, targets)
    assert_terms(difference(both, plain.problem(state, targets)), expected, both)


def qp_workspace(qp, state, targets):
    """Its workspace with the elimination of a state, and no soft root's columns missing."""
    qp.problem(state, targets)
    ws = qp.workspace
    return SimpleWorkspace(ws) if ws.first_root == len(ws.g) else ws


class SimpleWorkspace:
    """A workspace of a hard root, as `affine` reads it."""

    def __init__(self, ws):
        self.V, self.E, self.vdot0, self.w0, self.g = ws.V, ws.E, ws.vdot0, ws.w0, ws.g
        self.first_root = len(ws.g) - 6  # columns of u that `term` never reads


@dataclass(frozen=True)
class JointTorques(Task[TorquesBlock]):
    """½ w Σ (τ − 3 N·m)² of all joints: a user's cost on torques, without kernel."""

    space: ClassVar[TaskSpace] = TaskSpace.TORQUES
    weight: float = 1.0

    def bind(self, robot):
        return TorquesBlock(weight=np.full(len(robot.joint_names), self.weight))

    def rows(self, t, block):
        return Rows(t.torques, 3.0 - t.state.h[6:], block.weight)


def test_a_users_cost_changes_the_qp_as_its_equation_says():
    """½xᵀHx + gᵀx grows from x to y by ½ w Σ (τ − 3)² of y less that of x; and it is followed."""
    tick, robot = recovery()[40], robot_named("humanoid")
    plain = MomentumQP(robot, controller_config("momentum-qp"))
    mine = MomentumQP(robot, replace(plain.config, tasks={"mine": JointTorques(0.1)}))
    assert plain.compiled and not mine.compiled
    before, after = (qp.problem(tick.state, tick.targets) for qp in (plain, mine))
    ws, rng = mine.workspace, np.random.default_rng(0)
    x, y = rng.normal(size=(2, len(before.g)))

    def cost(x):
        return 0.05 * np.sum((ws.T @ x + ws.tau0 - 3.0) ** 2)

    def value(qp, x):
        return 0.5 * x @ qp.H @ x + qp.g @ x

    grown = value(after, y) - value(after, x) - value(before, y) + value(before, x)
    assert grown == pytest.approx(cost(y) - cost(x), rel=1e-9)
    solution = make_solver("active-set").solve(after)
    left, scale = residuals(after, solution), np.abs(after.g).max()
    assert left.primal < 1e-8 and left.dual < 1e-9 * scale and left.gap < 1e-8 * scale
    other = make_solver("daqp").solve(after)
    np.testing.assert_allclose(other.x, solution.x, atol=1e-6 * np.abs(solution.x).max())
    first = make_solver("active-set").solve(before)
    assert cost(solution.x) < 0.9 * cost(first.x)


def from_python(task):
    """The same task without kernel."""
    kind = type(f"Python{type(task).__name__}", (type(task),), {"kernel": None})
    return kind(**{field.name: getattr(task, field.name) for field in fields(task)})


@pytest.mark.parametrize("name", [*STANDARD, "root"])
def test_a_standard_task_is_the_same_from_python(name):
    """In place of its kernel its rows are read: the same H and g, 1e-9 relative."""
    robot, state, targets = situation(3)
    c = config()
    python = MomentumQP(robot, replace(c, tasks={name: from_python(c.objective()[name])}))
    assert not python.compiled and list(python.tasks) == [*STANDARD, "root"]
    ours, theirs = (qp.problem(state, targets) for qp in (MomentumQP(robot, c), python))
    for one, other in ((ours.H, theirs.H), (ours.g, theirs.g)):
        np.testing.assert_allclose(one, other, rtol=0.0, atol=1e-9 * np.abs(other).max())


def test_two_tasks_of_one_space_add_up():
    """A second posture, CoM and CoP with other gains: H and g grow by their rows."""
    robot, state, targets = situation(4)
    further = {
        "arms": Posture(free_weight=5.0, stiffness=9.0),
        "slow": CoM(weight=50.0, stiffness=0.5),
        "p": CoP(weight=3.0),
        "w": Wrenches(force_weight=0.2),
        "u": RootWrench(weight=10.0),
    }
    one, two = MomentumQP(robot, config()), MomentumQP(robot, replace(config(), tasks=further))
    before, after = one.problem(state, targets), two.problem(state, targets)
    given = task_input(state, targets)
    expected = [0.0, 0.0]
    for name in further:
        rows = two.tasks[name].rows(given)
        if name == "slow":
            given = given._replace(force=rows.b + state.A_bias[:3])
        expected = [a + b for a, b in zip(expected, term(rows, one.workspace), strict=True)]
    assert_terms(difference(after, before), expected, after)


def test_a_task_of_a_soft_root_needs_one():
    """Naming the task."""
    with pytest.raises(ConfigError, match=r"tasks.u: .*root is 'hard'"):
        controller_config({"base": "momentum-qp", "tasks": {"u": {"kind": "root-wrench"}}})


def test_new_targets_are_read_by_all_tasks():
    """Targets made anew at each tick give the problem of a controller that has met no others."""
    robot, state, targets = situation(5)
    used = MomentumQP(robot, config())
    for seed in (6, 7):
        _, _, other = situation(seed)
        used.problem(state, other)
    ours, theirs = used.problem(state, targets), MomentumQP(robot, config()).problem(state, targets)
    np.testing.assert_array_equal(ours.H, theirs.H)
    np.testing.assert_array_equal(ours.g, theirs.g)


def test_default_configuration_lists_its_tasks():
    assert list(MomentumQPConfig().objective()) == list(STANDARD)
