"""The momentum QP with any subset of the soles in contact, and with contacts of other bodies.

One reduced problem for each subset (see `reduced_qp.py`), built on arrays that hold the soles in
contact only. A stack of tasks says what else is asked of v̇, such as the way of a swing foot.
"""

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace

import numpy as np

from poise.baselines.controller import TargetArrays, Targets
from poise.baselines.solvers import QP
from poise.configs.errors import ConfigError
from poise.envs.compiled.calls import address_of
from poise.envs.compiled.copies import Copyable
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.physics.arrays import RobotArrays, robot_arrays
from poise.envs.physics.kinematics import StateArrays
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .contacts.contact import BoundContact, bind_contacts, contact_arrays
from .gains import MomentumQPConfig
from .limits.limit import BoundLimit, bind_limits
from .momentum_qp import prepare_rows
from .parameters import QPParameters, qp_parameters
from .reduced_qp import Assembly, assemble
from .stack import limit_program, make_stack, put_rows
from .tasks.task import BoundTask, Rows, bind_tasks
from .tick import (
    ContactTick,
    allocate_memory,
    assemble_contacts,
    forget,
    pick_soles,
    solve,
    solve_contacts,
)
from .workspace import Workspace, allocate_workspace


class ContactSet(Copyable):
    """Arrays, parameters and scratch for one subset of the soles (its indices, in order)."""

    def __init__(
        self,
        arrays: RobotArrays,
        parameters: QPParameters,
        soles: tuple[int, ...],
        index: int,
        points: Sequence[BoundContact],
        limits: Iterable[BoundLimit],
    ):
        pick, self.index = np.array(soles), index
        self.soles, self.pick = soles, pick
        self.rows = (6 * pick[:, None] + np.arange(6)).ravel()
        names = [item.name for item in fields(RobotArrays)]
        names = [name for name in names if name.startswith(("sole_", "chain"))]
        self.arrays = replace(arrays, **{name: getattr(arrays, name)[pick] for name in names})
        cone = parameters.cone[pick]  # with a row more for each sole: the bound on its load
        self.parameters = replace(parameters, cone=np.pad(cone, ((0, 0), (0, 1), (0, 0))))
        self.workspace = allocate_workspace(
            self.arrays, self.parameters.cone.shape[1], parameters.soft_root,
            [point.chain for point in points],
            sum(point.contact.cone_rows for point in points),
            limit_rows=sum(limit.size for limit in limits),
        )  # fmt: skip
        nv, nc = len(arrays.q_standing) + 6, len(soles)
        self._own = {
            "J": guarded_zeros((6 * nc, nv)),
            "J_v": guarded_zeros(6 * nc),
            "Jdot_v": guarded_zeros(6 * nc),
            "sole_point": guarded_zeros((nc, 3)),
            "sole_axes": guarded_zeros((nc, 3, 3)),
            "origin": guarded_zeros(3),
            "contacts": guarded_zeros(nc),
        }
        self._bound_to: tuple[object, ...] = ()

    def state(self, s: StateArrays) -> StateArrays:
        """`s` with the soles of this set only."""
        own = replace(s, **self._own)
        pick_soles(s, self.pick, own)
        return own

    def bind(
        self,
        s: StateArrays,
        targets: TargetArrays,
        sets: "ContactSets",
        tasks: Iterable[BoundTask] = (),
        rows: int = 0,
    ) -> ContactTick:
        """Return what a tick from `s` works on, which is `block` from then on.

        Its stack has the tasks of the configuration, then `tasks`, then so many `rows` that are
        written by hand.
        """
        bound = (s, targets, *tasks, rows)
        if bound != self._bound_to:  # blocks are equal where they are the same
            ws, own = self.workspace, replace(s, **self._own)
            problem = Assembly(
                robot=self.arrays, state=own,
                contacts=contact_arrays(
                    own, list(sets.contacts.values()), ws.contact_accel, ws.force_weights,
                    ws.force_des,
                ),
                parameters=self.parameters, targets=targets, period=sets.period,
                tasks=make_stack([*sets.tasks.values(), *tasks], s, ws, rows),
                limits=limit_program(sets.limits.values(), s, ws), workspace=ws,
            )  # fmt: skip
            self.block = ContactTick.allocate(
                {"nc": len(self.soles)},
                source=s, pick=self.pick, problem=problem, memory=sets.memory,
                applied=sets.applied, slew=sets.slew, follows=sets.follows, chosen=sets.chosen,
                index=self.index, assemble=address_of(assemble, problem),
                solve=address_of(solve, ws),
            )  # fmt: skip
            self._bound_to = bound
        return self.block


class ContactSets(Copyable):
    """Solves the momentum QP for whichever soles are in contact; remembers torques between ticks.

    `tick` gives torques; after a call `workspace` holds the solution of the set that was used.
    No torque changes by more than `torque_rate_limit` of its limit from one tick to the next,
    whatever the contacts do: the QP knows this bound, and where it has no solution within, the
    torques are cut.
    """

    def __init__(self, robot: Robot, config: MomentumQPConfig, torque_rate_limit: float = np.inf):
        prepare_rows(config)
        self.robot, self.config, self.period = robot, config, config.period
        self.tasks = bind_tasks(config.tasks, robot)
        for name, (task, _) in self.tasks.items():
            if task.kernel is None:
                raise ConfigError("has no kernel", field=f"tasks.{name}")
        self.contacts = bind_contacts(config.contacts, robot)
        self.limits = bind_limits(config.limits, robot)
        self.arrays = robot_arrays(robot)
        self.parameters = parameters = qp_parameters(robot, self.arrays, config)
        count = len(robot.soles)
        subsets: list[tuple[int, ...]] = [(i,) for i in range(count)]
        if count > 1:
            subsets.append(tuple(range(count)))
        self.sets = {
            soles: ContactSet(
                self.arrays, parameters, soles, index,
                list(self.contacts.values()), self.limits.values(),
            )
            for index, soles in enumerate(subsets)
        }  # fmt: skip
        self.memory = allocate_memory(parameters.torque_limit)
        limit = parameters.torque_limit
        self.slew = np.where(limit > 0.0, torque_rate_limit * limit, np.inf)
        self.applied = guarded_zeros(len(limit))  # torques of the last tick, if
        self.follows = guarded_zeros(1, dtype=np.int64)  # there was one
        # index of the subset of the last tick, −1: none
        self.chosen = guarded_zeros(1, dtype=np.int64)
        self.chosen[0] = -1
        self._motor_joints = self.arrays.motor_dofs - 6

    @property
    def active(self) -> tuple[int, ...] | None:
        """The soles of the last tick, if there was one."""
        return None if self.chosen[0] < 0 else list(self.sets)[self.chosen[0]]

    @property
    def failures(self) -> int:
        """Ticks since the reset at which the QP was not solved."""
        return int(self.memory.failures[0])

    @property
    def forces(self) -> dict[str, np.ndarray]:
        """(3,) force [N] on each of `contacts` in the last solution, world axes."""
        forces = self.workspace.wrenches[len(self.workspace.wrenches) - 3 * len(self.contacts) :]
        return dict(zip(self.contacts, forces.reshape(-1, 3).copy(), strict=True))

    def reset(self) -> None:
        """Forget the last trial."""
        forget(self.memory)
        self.chosen[0], self.follows[0] = -1, 0

    def problem(
        self,
        state: RobotState,
        targets: Targets,
        soles: tuple[int, ...],
        tasks: Sequence[Rows] = (),
        load_limits: np.ndarray | None = None,
    ) -> QP:
        """The reduced QP with `soles` in contact.

        Args:
            tasks: further rows in v̇: nv columns; the configuration's are there already.
            load_limits: (len(soles),) largest vertical force of each sole [N]; none if left out.
        """
        chosen = self.sets[soles]
        ws = chosen.workspace
        rows = sum(len(task.b) for task in tasks)
        block = chosen.bind(state.arrays, targets.arrays(), self, rows=rows)
        stack = block.problem.tasks
        put_rows(stack, tasks, len(stack.b) - rows)
        block.limited[0] = load_limits is not None
        if load_limits is not None:
            block.load_limits[:] = load_limits
        assemble_contacts(block)
        return QP(ws.H, ws.g, ws.C, ws.l, ws.u)

    def tick(
        self,
        state: RobotState,
        targets: Targets,
        soles: tuple[int, ...],
        tasks: Sequence[Rows] = (),
        load_limits: np.ndarray | None = None,
    ) -> np.ndarray:
        """Joint torques (nu,) [N·m]; arguments as of `problem`."""
        self.problem(state, targets, soles, tasks, load_limits)
        chosen = self.sets[soles]
        solve_contacts(chosen.block)
        return chosen.workspace.tau[self._motor_joints].copy()

    @property
    def workspace(self) -> Workspace:
        """Scratch and solution of the set that was used last."""
        return self.sets[self.active or tuple(range(len(self.robot.soles)))].workspace
