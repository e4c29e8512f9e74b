"""The baseline: a momentum-based whole-body QP, solved at every control tick."""

from collections.abc import Iterable

import numpy as np

from poise.baselines.controller import (
    BaseController,
    CompiledController,
    Outputs,
    TargetArrays,
    Targets,
)
from poise.baselines.solvers import QP, Status, make_solver
from poise.baselines.warmup import prepare
from poise.envs.compiled.calls import Kernel, address_of
from poise.envs.compiled.copies import Copyable
from poise.envs.physics.arrays import RobotArrays, robot_arrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .compensation import (
    Compensation,
    compensate,
    forget_compensation,
    make_compensation,
    move_targets,
    rebound,
)
from .contacts.contact import contact_arrays
from .gains import COMPILED_SOLVER, MomentumQPConfig
from .parameters import QPParameters, qp_parameters
from .parts.part import Bound, bind_parts
from .reduced_qp import Assembly, assemble
from .stack import copies, exchange_targets, fill_from_python, limit_program, make_stack
from .tasks.com import CoM
from .tasks.posture import PostureBlock, no_posture
from .tasks.task import Task, task_input
from .tick import Tick, accept, allocate_memory, forget, momentum_tick, release_joints, solve
from .workspace import Workspace, allocate_workspace


def com_offset(robot: Robot, task: CoM | None) -> float:
    """Where the CoM is to stand, forward of the middle of the soles [m].

    A robot whose description says nothing else stands as described: the offset of gains that were
    searched on another robot would make it lean.
    """
    if robot.description.posture.com != "controller":
        return robot.com_ahead
    return task.offset * robot.height_com if task is not None else 0.0


class BoundQP(Copyable):
    """A configuration of the momentum QP for one robot, and what outlives its ticks.

    Attributes:
        tasks: the objective by name, see `MomentumQPConfig.objective`.
        contacts, limits: those of the configuration by name. The arrays of the `block` of a task,
            a contact or a limit, such as weights or a reference, may be written to at any time.
    """

    def __init__(self, robot: Robot, config: MomentumQPConfig):
        if config.tasks or config.contacts or config.limits:
            prepare("rows")
        self.robot, self.config, self.period = robot, config, config.period
        self.arrays = robot_arrays(robot)
        self.parameters = qp_parameters(robot, self.arrays, config)
        self.tasks = bind_parts(config.objective(), robot, "tasks")
        self.contacts = bind_parts(config.contacts, robot, "contacts")
        self.limits = bind_parts(config.limits, robot, "limits")
        posture = self.tasks.get("posture")
        #: the gains of the task `posture`; zero without one
        self.posture: PostureBlock = no_posture(robot.model.nv)
        if posture is not None and isinstance(posture.block, PostureBlock):
            self.posture = posture.block
        self.memory = allocate_memory(self.parameters.torque_limit)

    @property
    def failures(self) -> int:
        """The ticks since the reset at which the QP was not solved."""
        return self.memory.failures

    def new_workspace(self, arrays: RobotArrays, p: QPParameters) -> Workspace:
        """Zeroed scratch for the soles of `arrays`."""
        points = self.contacts.values()
        return allocate_workspace(
            arrays, p.cone.shape[1], p.soft_root,
            [contact.chain(block) for contact, block in points],
            sum(contact.cone_rows for contact, _ in points),
            sum(limit.size(block) for limit, block in self.limits.values()),
            copies(self.tasks.values()),
        )  # fmt: skip

    def new_assembly(
        self,
        arrays: RobotArrays,
        s: StateArrays,
        p: QPParameters,
        t: TargetArrays,
        ws: Workspace,
        whole: StateArrays,
        tasks: Iterable[Bound[Task]] = (),
    ) -> Assembly:
        """The problem of the soles of a state `s`, with `tasks` after those of the configuration.

        Tasks and limits read `whole`, the state with all soles.
        """
        points = list(self.contacts.values())
        return Assembly(
            robot=arrays, state=s, parameters=p, targets=t, period=self.period, workspace=ws,
            contacts=contact_arrays(s, points, ws.contact_accel, ws.force_weights, ws.force_des),
            tasks=make_stack([*self.tasks.values(), *tasks], whole, t, s, ws),
            limits=limit_program(self.limits.values(), whole, ws),
        )  # fmt: skip


class MomentumQP(BoundQP, CompiledController):
    """Tracks a posture, the CoM through linear and the CoP through angular momentum.

    `torques` solves the reduced problem of `reduced_qp.py`, whose readable form is
    `formulation.py`. After a call, `vdot`, `wrenches`, `forces`, `root_wrench` and `failures` tell
    what was found. Raises ConfigError for an unknown solver or solver option, and for a task, a
    contact or a limit of a body or a joint that the robot does not have.
    """

    config: MomentumQPConfig

    def __init__(self, robot: Robot, config: MomentumQPConfig | None = None):
        super().__init__(robot, config or MomentumQPConfig())
        self.workspace = self.new_workspace(self.arrays, self.parameters)
        self.com_offset = com_offset(robot, self.config.com)
        self.solver = None
        if self.config.solver != COMPILED_SOLVER or self.config.solver_options:
            self.solver = make_solver(self.config.solver, **self.config.solver_options)
        self._motor_joints = self.arrays.motor_dofs - 6
        self.observes_force = True  #: false: whoever calls its tick watches what pushes
        self._compensation: Compensation | None = None
        self._assembly: Assembly | None = None
        self._tick: Tick | None = None

    @property
    def vdot(self) -> np.ndarray:
        """(nv,) accelerations of the last solution."""
        return self.workspace.vdot.copy()

    @property
    def wrenches(self) -> np.ndarray:
        """(6 nc,) sole wrenches of the last solution, world axes, at the sole points."""
        return self.workspace.wrenches[: 6 * len(self.robot.soles)].copy()

    @property
    def forces(self) -> dict[str, np.ndarray]:
        """(3,) force [N] on each of `contacts` in the last solution, world axes."""
        rest = self.workspace.wrenches[6 * len(self.robot.soles) :].reshape(-1, 3)
        return {name: force.copy() for name, force in zip(self.contacts, rest, strict=True)}

    @property
    def root_wrench(self) -> np.ndarray:
        """(6,) u_root of the last solution: force and moment about the CoM; soft root only."""
        return self.workspace.root_wrench.copy()

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial."""
        forget(self.memory)
        self.workspace.cop_prev[:] = np.nan
        self.workspace.iscratch[:] = 0  # no row to start from
        self.workspace.tau[:] = 0.0
        self.workspace.root_wrench[:] = 0.0
        self.workspace.wrenches[:] = 0.0
        if self._compensation is not None:
            forget_compensation(self._compensation)
        if self.solver is not None:
            self.solver.reset()

    def compiled_tick(self, state: RobotState, targets: Targets) -> tuple[Kernel[Tick], Tick]:
        """The kernel that compiled code calls for `torques`, and its block; see `outputs`."""
        tick = self.tick(state, targets)
        return address_of(momentum_tick, tick), tick

    @property
    def compiled(self) -> bool:
        """True with the compiled solver, and kernels for all tasks; see `CompiledController`."""
        return super().compiled and self.solver is None and self._kernels

    @property
    def _kernels(self) -> bool:
        """True with kernels for all tasks."""
        return all(task.kernel is not None for task, _ in self.tasks.values())

    def gains(self) -> QPParameters:
        """The parameters in SI units; see `CompiledController`."""
        return self.parameters

    def outputs(self) -> Outputs:
        ws, p = self.workspace, self.parameters
        return Outputs(
            ws.tau, ws.root_wrench, self.memory.memory_of("failures"), p.soft_root, ws.vdot
        )

    def compensation(self, state: RobotState, targets: Targets) -> Compensation:
        """The block that `compensate` moves these targets by, see `ForceCompensation`."""
        s, t, known = state.arrays, targets.arrays(), self._compensation
        if known is None:
            known = make_compensation(
                self.config.compensation, self.arrays, s, t, self.period, self.observes_force
            )
        self._compensation = rebound(known, s, t)
        return self._compensation

    def assembly(self, state: RobotState, targets: Targets) -> Assembly:
        """The block that `assemble` fills the workspace from."""
        s, t, known = state.arrays, self.compensation(state, targets).moved, self._assembly
        if known is None or known.state is not s:
            known = self.new_assembly(self.arrays, s, self.parameters, t, self.workspace, s)
        elif known.targets is not t or known.parameters is not self.parameters:
            if known.targets is not t:
                exchange_targets(known.tasks, t)
            known = known.replace(targets=t, parameters=self.parameters)
        self._assembly = known
        return known

    def tick(self, state: RobotState, targets: Targets) -> Tick:
        """The block that `momentum_tick` works on."""
        problem = self.assembly(state, targets)
        if self._tick is None or self._tick.problem is not problem:
            stages = address_of(assemble, problem), address_of(solve, self.workspace)
            self._tick = Tick(problem, self.memory, self.compensation(state, targets), *stages)
        return self._tick

    def _filled(self, state: RobotState, targets: Targets) -> Assembly:
        """`assembly`, with the rows of tasks that Python fills."""
        problem = self.assembly(state, targets)
        if not self._kernels:
            vel = np.nan_to_num((state.cop - self.workspace.cop_prev) / self.period)
            given = task_input(state, problem.targets, cop_vel=vel)
            fill_from_python(problem.tasks, list(self.tasks.values()), given)
        return problem

    def problem(self, state: RobotState, targets: Targets) -> QP:
        """The reduced QP of this state: pure, nothing is solved or remembered."""
        ws = self.workspace
        before = ws.cop_prev.copy()
        if (moved := self.compensation(state, targets)).active:
            move_targets(moved)
        assemble(self._filled(state, targets))
        ws.cop_prev[:] = before
        return QP(ws.H.copy(), ws.g.copy(), ws.C.copy(), ws.l.copy(), ws.u.copy())

    def torques(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Joint torques (nu,) [N·m] for the next `period`."""
        ws, problem = self.workspace, self._filled(state, targets)
        if self.solver is None:
            momentum_tick(self.tick(state, targets))
        else:
            if (moved := self.compensation(state, targets)).active:
                compensate(moved)
            assemble(problem)
            solution = self.solver.solve(QP(ws.H, ws.g, ws.C, ws.l, ws.u))
            if solution.status is Status.INFEASIBLE:
                release_joints(ws)
                solution = self.solver.solve(QP(ws.H, ws.g, ws.C, ws.l, ws.u))
            if solution.solved:
                ws.x[:] = solution.x
            ws.status = 0 if solution.solved else 1
            accept(state.arrays, self.parameters, ws, self.memory)
        return ws.tau[self._motor_joints].copy()


class AroundQP(BaseController):
    """Holds the QP in `qp` and forwards its period, CoM offset, failures and root wrench."""

    def __init__(self, robot: Robot, qp: MomentumQPConfig):
        self.robot = robot
        self.qp = MomentumQP(robot, qp)
        self.period, self.com_offset = self.qp.period, self.qp.com_offset

    @property
    def failures(self) -> int:
        return self.qp.failures

    @property
    def vdot(self) -> np.ndarray:
        return self.qp.vdot

    @property
    def root_wrench(self) -> np.ndarray:
        return self.qp.root_wrench

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial."""
        self.qp.reset(state)
