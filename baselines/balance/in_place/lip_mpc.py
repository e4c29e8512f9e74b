"""Receding horizon on the linear inverted pendulum, CoP inside the support polygon [Wieber06]."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import osqp
from scipy import sparse

from poise.baselines.controller import Targets
from poise.baselines.whole_body.gains import MomentumQPConfig
from poise.configs.errors import PoiseError
from poise.envs.compiled.maths.pendulum import lip_step
from poise.envs.compiled.maths.polygons import half_planes, nearest_inside, shrunk
from poise.envs.physics.state import RobotState
from poise.envs.robots.robot import Robot

from .guided import Guided

MAX_EDGES = 16  # rows kept per step; a polygon with fewer edges repeats its last


@dataclass(frozen=True)
class LIPMPCConfig:
    """Horizon of `steps` of `step` seconds, replanned every `replan` seconds.

    Costs over that of the CoP's distance from c_ref: of the capture point's distance, of the
    CoP's change from step to step, and of the capture point at the end of the horizon.
    """

    kind: Literal["lip-mpc"] = "lip-mpc"
    steps: int = field(default=20, metadata={"min": 2, "max": 200})
    step: float = field(default=0.03, metadata={"above": 0.0})  # [s]
    replan: float = field(default=0.02, metadata={"above": 0.0})  # [s]
    capture_point: float = field(default=1.0, metadata={"min": 0.0})
    change: float = field(default=1.0, metadata={"min": 0.0})
    end: float = field(default=100.0, metadata={"min": 0.0})
    share: float = field(default=1.0, metadata={"above": 0.0, "max": 1.0})  # of the polygon
    qp: MomentumQPConfig = field(default_factory=MomentumQPConfig)


class LIPMPC(Guided):
    """p_0 of the plan that minimises Σ w_ξ |ξ_k|² + |p_k|² + w_Δ |p_k − p_(k−1)|² + w_N |ξ_N|².

    Distances from c_ref; ξ_k follows the pendulum exactly, every p_k lies in the polygon of now.
    Unknowns: p_0 … p_(N−1), and x_1 … x_N = [c; ċ/ω] in x and y; a sparse QP, solved by OSQP with
    one pattern, warm-started by the last plan.
    """

    def __init__(self, robot: Robot, config: LIPMPCConfig | None = None):
        self.config = config or LIPMPCConfig()
        super().__init__(robot, self.config.qp)
        self.omega = robot.omega
        self.A, self.B = lip_step(self.omega, self.config.step)
        self._ticks = max(1, round(self.config.replan / self.period))
        self._build()
        self.reset()

    def reset(self, state: RobotState | None = None) -> None:
        """Forget the last trial and its plan."""
        super().reset(state)
        self._tick, self._planned = 0, np.zeros(2)
        self._solver = self._new_solver()  # its step size, too, is of the last trial
        self._used = False

    def _new_solver(self) -> osqp.OSQP:
        solver = osqp.OSQP()
        # the interval is in iterations, so that the plan does not depend on the clock
        solver.setup(
            P=self._P, q=self._q, A=self._A, l=self._low, u=self._high, verbose=False,
            eps_abs=1e-5, eps_rel=1e-5, max_iter=4000, polishing=False, adaptive_rho_interval=50,
        )  # fmt: skip
        return solver

    def __getstate__(self) -> dict[str, object]:
        if self._used:
            raise PoiseError(
                "lip-mpc cannot be copied within an episode, for OSQP does not tell what it "
                "remembers: copy it after its reset"
            )
        return {**super().__getstate__(), "_solver": None}

    def __setstate__(self, state: dict[str, object]) -> None:
        vars(self).update(state)
        self._solver = self._new_solver()

    def _build(self) -> None:
        n, c = self.config.steps, self.config
        eye, xi = sparse.identity, np.ones((2, 2))  # ξ² of [c; ċ/ω], ξ = c + ċ/ω
        change = sparse.diags([-np.ones(n - 1), np.ones(n - 1)], [0, 1], shape=(n - 1, n))
        P_cop = sparse.kron(eye(n) + c.change * change.T @ change, eye(2))
        weights = np.full(n, c.capture_point)
        weights[-1] += c.end
        P_state = sparse.kron(sparse.diags(weights), sparse.kron(xi, eye(2)))
        P = 2.0 * sparse.block_diag([P_cop, P_state + 1e-9 * eye(4 * n)], format="csc")
        pendulum = sparse.kron(eye(n), sparse.kron(self.B[:, None], eye(2)))
        follow = eye(4 * n) - sparse.kron(
            sparse.diags([np.ones(n - 1)], [-1]), sparse.kron(self.A, eye(2))
        )
        ones = sparse.csc_matrix(np.ones((MAX_EDGES, 2)))
        polygons = sparse.hstack(
            [sparse.kron(eye(n), ones), sparse.csc_matrix((n * MAX_EDGES, 4 * n))]
        )
        dynamics = sparse.hstack([-pendulum, follow])
        A = sparse.vstack([dynamics, polygons], format="csc")
        A.sort_indices()
        self._P, self._A, self._q = sparse.triu(P, format="csc"), A, np.zeros(A.shape[1])
        # where the polygon's rows lie among the matrix's values, column by column
        rows, columns = A.indices, np.repeat(np.arange(A.shape[1]), np.diff(A.indptr))
        self._edges = np.flatnonzero(rows >= 4 * n)
        self._edge_of = (rows[self._edges] - 4 * n) % MAX_EDGES
        self._axis_of = columns[self._edges] % 2
        self._values = A.data.copy()
        self._low = np.concatenate([np.zeros(4 * n), np.full(n * MAX_EDGES, -np.inf)])
        self._high = np.concatenate([np.zeros(4 * n), np.ones(n * MAX_EDGES)])

    def cop(self, state: RobotState, targets: Targets) -> np.ndarray:
        """Return p (2,) [m]: replanned every `replan` seconds, else that of the last plan."""
        if self._tick % self._ticks == 0:
            self._planned = self.plan(state, targets)[0]
        self._tick += 1
        return self._planned

    def plan(self, state: RobotState, targets: Targets) -> np.ndarray:
        """(steps, 2) the CoPs of the horizon [m]; where none is found the saturated ξ."""
        n, reference = self.config.steps, targets.com[:2]
        normals, offsets = half_planes(shrunk(state.support_polygon, self.config.share))
        normals = normals[:MAX_EDGES]
        offsets = offsets[:MAX_EDGES] - normals @ reference
        missing = MAX_EDGES - len(offsets)
        normals = np.vstack([normals, np.repeat(normals[-1:], missing, axis=0)])
        offsets = np.concatenate([offsets, np.repeat(offsets[-1:], missing)])
        self._values[self._edges] = normals[self._edge_of, self._axis_of]
        start = np.stack([state.com[:2] - reference, state.com_vel[:2] - targets.com_vel[:2]])
        start[1] /= self.omega
        self._low[:4] = self._high[:4] = (self.A @ start).ravel()
        self._high[4 * n :] = np.tile(offsets, n)
        self._used = True
        self._solver.update(Ax=self._values, l=self._low, u=self._high)
        result = self._solver.solve(raise_error=False)
        if result.info.status_val not in (
            osqp.SolverStatus.OSQP_SOLVED, osqp.SolverStatus.OSQP_SOLVED_INACCURATE
        ):  # fmt: skip
            return np.tile(nearest_inside(state.support_polygon, state.capture_point), (n, 1))
        return result.x[: 2 * n].reshape(n, 2) + reference
