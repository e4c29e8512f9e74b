"""The momentum QP with any subset of the soles in contact.

One reduced problem for each subset (see `reduced_qp.py`), built on arrays that hold the soles in
contact only; what else is asked of v̇, such as the way of a swing foot, comes as further rows.
"""

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from poise.envs.arrays import RobotArrays, apart, robot_arrays
from poise.envs.kinematics import StateArrays
from poise.envs.robot import Robot
from poise.envs.state import RobotState

from .controller import Targets
from .momentum_qp import MomentumQPConfig, accept, allocate_memory, forget, solve
from .parameters import qp_parameters
from .reduced_qp import Assembly, QPParameters, Workspace, allocate_workspace, assemble
from .solvers import QP
from .task_rows import Rows


class ContactSet:
    """Arrays, parameters and scratch for one subset of the soles (its indices, in order)."""

    def __init__(self, arrays: RobotArrays, parameters: QPParameters, soles: tuple[int, ...]):
        pick = np.array(soles)
        self.soles, self.pick = soles, pick
        self.rows = (6 * pick[:, None] + np.arange(6)).ravel()
        names = [item.name for item in fields(RobotArrays)]
        names = [name for name in names if name.startswith(("sole_", "chain"))]
        self.arrays = replace(arrays, **{name: getattr(arrays, name)[pick] for name in names})
        cone = parameters.cone[pick]  # with a row more for each sole: the bound on its load
        self.parameters = replace(parameters, cone=np.pad(cone, ((0, 0), (0, 1), (0, 0))))
        self.workspace = allocate_workspace(
            self.arrays, self.parameters.cone.shape[1], parameters.soft_root
        )
        nv, nc = len(arrays.q_standing) + 6, len(soles)
        self._own = {
            "J": apart((6 * nc, nv)), "J_v": apart(6 * nc), "Jdot_v": apart(6 * nc),
            "sole_point": apart((nc, 3)), "sole_axes": apart((nc, 3, 3)), "origin": apart(3),
            "contacts": apart(nc),
        }  # fmt: skip
        self._source: StateArrays | None = None

    def state(self, s: StateArrays) -> StateArrays:
        """`s` with the soles of this set only."""
        own = self._own
        for name in ("J", "J_v", "Jdot_v"):
            own[name][:] = getattr(s, name)[self.rows]
        for name in ("sole_point", "sole_axes", "contacts"):
            own[name][:] = getattr(s, name)[self.pick]
        own["origin"][:] = own["sole_point"].mean(axis=0)
        if self._source is not s:
            self._source, self._state = s, replace(s, **own)
        return self._state


class ContactSets:
    """Solves the momentum QP for whichever soles are in contact; remembers torques between ticks.

    `tick` gives torques; after a call `workspace` holds the solution of the set that was used.
    No torque changes by more than `jump` of its limit from one tick to the next, whatever the
    contacts do: the QP knows this bound, and where it has no solution within, the torques are cut.
    """

    def __init__(self, robot: Robot, config: MomentumQPConfig, jump: float = np.inf):
        self.robot, self.config, self.period = robot, config, config.period
        self.arrays = robot_arrays(robot)
        self.parameters = parameters = qp_parameters(robot, self.arrays, config)
        count = len(robot.soles)
        subsets: list[tuple[int, ...]] = [(i,) for i in range(count)]
        if count > 1:
            subsets.append(tuple(range(count)))
        self.sets = {soles: ContactSet(self.arrays, parameters, soles) for soles in subsets}
        self.memory = allocate_memory(parameters.torque_limit)
        self._jump = np.where(parameters.torque_limit > 0.0, jump * parameters.torque_limit, np.inf)
        self._applied: np.ndarray | None = None  # (nv−6,) torques of the last tick
        self._motor_joints = self.arrays.motor_dofs - 6
        self.active: tuple[int, ...] | None = None

    @property
    def failures(self) -> int:
        """Ticks since the reset at which the QP was not solved."""
        return int(self.memory.failures[0])

    def reset(self) -> None:
        """Forget the last trial."""
        forget(self.memory)
        self.active = self._applied = None

    def follow(self, torques: np.ndarray) -> None:
        """Go on from the joint `torques` (nv−6,) of another controller's last tick."""
        self._applied = torques.copy()
        self.memory.torques[:] = torques

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
            tasks: further rows in v̇: nv columns.
            load_limits: (len(soles),) largest vertical force of each sole [N]; none if left out.
        """
        chosen = self.sets[soles]
        ws, p = chosen.workspace, chosen.parameters
        if soles != self.active:
            ws.cop_prev[:] = np.nan
            ws.iscratch[:] = 0
            self.active = soles
        assemble(
            Assembly(
                chosen.arrays, chosen.state(state.arrays), p, targets.arrays(), self.period, ws
            )
        )
        for task in tasks:
            A = task.A @ ws.V
            offset = task.A @ ws.vdot0 - task.b
            weighted = task.weights[:, None] * A
            ws.H[:] += A.T @ weighted
            ws.g[:] += offset @ weighted
        if load_limits is not None:
            rows = p.cone.shape[1]
            for i, limit in enumerate(load_limits):
                row = (i + 1) * rows - 1
                ws.C[row] = ws.E[6 * i + 2]
                ws.u[row] = limit - ws.w0[6 * i + 2]
        if self._applied is not None:
            self._bound_torques(ws, self._applied, self._jump)
        return QP(ws.H, ws.g, ws.C, ws.l, ws.u)

    @staticmethod
    def _bound_torques(ws: Workspace, middle: np.ndarray, width: np.ndarray) -> None:
        """Keep τ = τ₀ + T x within `width` of `middle` as well: rows before the joint limits."""
        nj = len(middle)
        rows = slice(len(ws.l) - 2 * nj, len(ws.l) - nj)
        ws.l[rows] = np.maximum(ws.l[rows], middle - width - ws.tau0)
        ws.u[rows] = np.minimum(ws.u[rows], middle + width - ws.tau0)

    def _free_torques(self, ws: Workspace) -> None:
        """Take the bound on changes away again."""
        nj, limit = len(self._jump), self.parameters.torque_limit
        rows = slice(len(ws.l) - 2 * nj, len(ws.l) - nj)
        ws.l[rows], ws.u[rows] = -limit - ws.tau0, limit - ws.tau0

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
        ws, p = chosen.workspace, chosen.parameters
        solve(ws)
        if ws.status[0] != 0 and self._applied is not None:
            self._free_torques(ws)
            solve(ws)
        accept(state.arrays, p, ws, self.memory)
        if self._applied is not None:
            ws.tau[:] = np.clip(ws.tau, self._applied - self._jump, self._applied + self._jump)
        self._applied = ws.tau.copy()
        return ws.tau[self._motor_joints].copy()

    @property
    def workspace(self) -> Workspace:
        """Scratch and solution of the set that was used last."""
        return self.sets[self.active or tuple(range(len(self.robot.soles)))].workspace
