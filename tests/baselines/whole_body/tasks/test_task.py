"""Every kind of task: kernel against NumPy, derivatives, the QP with it, its configuration."""

import mujoco
import numpy as np
import pytest

from poise.baselines import CaptureStep, CaptureStepConfig, MomentumQP, MomentumQPConfig
from poise.baselines.controller import Targets
from poise.baselines.registry import controller_config, load_controller
from poise.baselines.solvers import make_solver, residuals
from poise.baselines.whole_body.formulation import build, torques_of, unknowns
from poise.baselines.whole_body.parts.part import bind_parts
from poise.baselines.whole_body.tasks.orientation import Orientation
from poise.baselines.whole_body.tasks.task import Task
from poise.configs.errors import ConfigError
from poise.configs.schema import build as build_config
from poise.configs.schema import to_dict
from poise.envs.physics.simulation import Simulation
from tests.support.physics import random_state, recovery, robot_named
from tests.support.refused import invalid
from tests.support.tasks import EXAMPLES, described, filled, given


class FromPython(Orientation):
    """An orientation task without kernel."""

    kernel = None


def config(*names, **changes):
    """A momentum QP with these examples."""
    return controller_config({"base": "momentum-qp", "tasks": described(*names, **changes)})


def bound(kind, **changes):
    """An example for the humanoid."""
    return bind_parts(config(kind, **changes).tasks, robot_named("humanoid"), "tasks")[kind]


def flying(seed):
    """A random state in the air."""
    simulation = Simulation(robot_named("humanoid"))
    return simulation.reset(*random_state(simulation.robot, np.random.default_rng(seed)))


def test_every_kind_has_an_example():
    """A new task is looked at by all tests of this file; the standard ones in test_objective.py."""
    standard = {task.kind for task in MomentumQPConfig(root="soft").objective().values()}
    assert {*EXAMPLES, *standard} == set(Task.kinds())


@pytest.mark.parametrize(
    ("kind", "frame"),
    [*((kind, frame) for kind in EXAMPLES for frame in ("heading", "world")), ("position", "com")],
)
def test_the_kernel_fills_the_rows_that_NumPy_has(kind, frame):
    """In generic states: 1e-9, relative."""
    task = bound(kind, frame=frame)
    for seed in range(4):
        state = flying(seed)
        for ours, theirs in zip(filled(task, state), task.rows(given(state)), strict=True):
            assert np.abs(theirs).max() > 0.0
            scale = max(np.abs(theirs).max(), 1.0)
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * scale)


@pytest.mark.parametrize(
    "fields", [*({"kind": kind} for kind in EXAMPLES), {"kind": "position", "frame": "com"}]
)
def test_without_gains_the_rows_ask_for_no_acceleration(fields):
    """Then b = −Ȧ v: A v, the task's velocity, does not change along q̇ = v where A v̇ = b."""
    task, state, h = bound(**fields, stiffness=0.0, damping_ratio=0.0), flying(1), 1e-6
    change = []
    for sign in (-1.0, 1.0):
        qpos = state.qpos.copy()
        mujoco.mj_integratePos(robot_named("humanoid").model, qpos, state.qvel, sign * h)
        other = Simulation(robot_named("humanoid")).reset(qpos, state.qvel)
        change.append(task.rows(given(other)).A @ state.qvel)
    expected = -(change[1] - change[0]) / (2 * h)
    assert np.abs(expected).max() > 0.1
    np.testing.assert_allclose(task.rows(given(state)).b, expected, atol=1e-5)


def test_the_compiled_problem_with_tasks_has_the_same_solution():
    """Torques and accelerations along push recoveries, all kinds in one stack: 1e-9 relative."""
    qp = MomentumQP(robot_named("humanoid"), config())
    plain = MomentumQP(robot_named("humanoid"), config(weight=0.0))
    moved = 0.0
    for tick in recovery()[::9]:
        state, targets = tick.state, tick.targets
        qp.reset()
        torques = qp.torques(state, targets)
        readable = build(state, targets, qp.parameters, qp.tasks.values())
        solution = make_solver("daqp").solve(readable)
        assert solution.solved
        found = torques_of(state, solution.x)[state.robot.motor_dofs - 6]
        np.testing.assert_allclose(found, torques, atol=1e-9 * np.abs(torques).max())
        vdot = unknowns(state, solution.x).vdot
        np.testing.assert_allclose(qp.vdot, vdot, atol=1e-9 * np.abs(vdot).max())
        plain.reset()
        moved = max(moved, np.abs(plain.torques(state, targets) - torques).max())
    assert moved > 1.0  # [N·m]: the tasks do something


def test_optimality_conditions_with_tasks():
    """No row is violated, the gradient vanishes, the duality gap is closed."""
    tick = recovery()[20]
    problem = MomentumQP(robot_named("humanoid"), config()).problem(tick.state, tick.targets)
    solution = make_solver("active-set").solve(problem)
    left, scale = residuals(problem, solution), np.abs(problem.g).max()
    assert solution.solved
    assert left.primal < 1e-8 and left.dual < 1e-8 * scale and left.gap < 1e-7 * scale


@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_task_without_weight_changes_no_bit(kind):
    """Its rows add zeros: torques are those of the QP without it; with a weight it is followed."""
    robot, tick = robot_named("humanoid"), recovery()[40]
    found = []
    for tasks in ((kind, 0.0), (kind, 1e6)):
        qp = MomentumQP(robot, config(tasks[0], weight=tasks[1]))
        found.append((qp.torques(tick.state, tick.targets), qp))
    default = MomentumQP(robot, controller_config("momentum-qp"))
    np.testing.assert_array_equal(found[0][0], default.torques(tick.state, tick.targets))
    heavy = found[1][1]
    rows = heavy.tasks[kind].rows(given(tick.state))
    before = np.abs(rows.A @ default.vdot - rows.b).max()
    assert np.abs(rows.A @ heavy.vdot - rows.b).max() < 0.3 * before


def test_tasks_are_read_from_a_file(tmp_path):
    """Under names of one's own, over those of a base; what is written back says the same."""
    below, above = tmp_path / "below.yaml", tmp_path / "above.yaml"
    task = "{kind: orientation, body: torso, weight: 3.0}"
    below.write_text(f"base: momentum-qp\ntasks: {{trunk: {task}}}\n")
    above.write_text(f"base: {below}\ntasks: {{trunk: {{weight: 2}}, arm: {task}}}\n")
    tasks = controller_config(above).tasks
    assert tasks == {
        "trunk": Orientation("torso", weight=2.0),
        "arm": Orientation("torso", weight=3.0),
    }
    again = build_config(MomentumQPConfig, to_dict(controller_config(above)), "again")
    assert again.tasks == tasks


@pytest.mark.parametrize(
    ("task", "message"),
    [
        ({"body": "torso"}, ("tasks.t.kind", "orientation")),
        ({"kind": "dance"}, ("tasks.t.kind", "'dance'", "orientation")),
        ({"kind": ["a"]}, ("tasks.t.kind", "'a'")),
        ("orientation", ("tasks.t",)),
        ({"kind": "orientation"}, ("tasks.t.body",)),
        ({"kind": "orientation", "body": "nose"}, ("tasks.t.body", "'nose'", "torso")),
        ({"kind": "orientation", "body": "torso", "weight": -1.0}, ("tasks.t.weight",)),
    ],
)
def test_a_task_that_cannot_be_is_refused(task, message):
    """Naming the field and the choices."""
    with invalid(*message):
        load_controller({"base": "momentum-qp", "tasks": {"t": task}}, robot_named("humanoid"))


def test_a_task_without_kernel_is_called_from_python():
    """The same torques as with one; the controller says that it is not compiled."""
    robot, tick = robot_named("humanoid"), recovery()[40]
    gains = dict(EXAMPLES["orientation"])
    compiled, python = (
        MomentumQP(robot, MomentumQPConfig(tasks={"arm": kind(**gains)}))
        for kind in (Orientation, FromPython)
    )
    assert compiled.compiled and not python.compiled
    ours, theirs = (qp.torques(tick.state, tick.targets) for qp in (compiled, python))
    np.testing.assert_allclose(ours, theirs, atol=1e-9 * np.abs(theirs).max())
    default = MomentumQP(robot, MomentumQPConfig()).torques(tick.state, tick.targets)
    assert np.abs(ours - default).max() > 0.1


def test_controllers_that_step_stack_their_tasks_with_the_swing_foot():
    """A task of `step_qp` is in the QP of every contact set; one without kernel is refused."""
    robot = robot_named("humanoid")
    arm = Orientation(**EXAMPLES["orientation"])
    controller = CaptureStep(robot, CaptureStepConfig(step_qp=MomentumQPConfig(tasks={"arm": arm})))
    state = Simulation(robot).state
    block = controller.tick(state, Targets.standing(robot, state))
    stacks = [chosen.problem.tasks for chosen in (block.on_first, block.on_second, block.on_both)]
    assert [len(stack.b) for stack in stacks] == [9, 9, 3]
    without = MomentumQPConfig(tasks={"arm": FromPython(**EXAMPLES["orientation"])})
    for name in ("qp", "step_qp"):
        with pytest.raises(ConfigError, match=f"{name}.tasks.arm: has no kernel"):
            CaptureStep(robot, CaptureStepConfig(**{name: without}))
