"""The optimum over a whole clip: what postures cost, and a sequence of quadratic programs."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse

from poise.baselines.motion.space_time.constraints.constraint import Constraint
from poise.baselines.motion.space_time.constraints.scene import Scene
from poise.configs.errors import PoiseError

from .asked import Asked
from .program import Penalised, Quadratic, solve_program
from .stance import SoleMotions, motions, move_soles
from .trajectory import coordinate_derivative, coordinates, third_difference

PENALTY = 100.0  # of what a user's constraint lacks [1/m, 1/rad], times its weight
HARD = 300.0  # the same of clearance and of joint limits
DAMPING = 1e-4  # of displacements: what nothing asks for stays
MARGIN = 0.005  # [rad] kept from the joint limits, for splines between the frames
MOST, TRUST = 25, 0.3  # programs, and the largest move of a joint in the first [rad]
LEAST_TRUST = 2e-3  # [rad] that ends it
SHARES = (1.0, 0.5, 0.25, 0.1)  # of a step that are tried
ENOUGH, MET = 1e-3, 0.02  # decreases that end it: of the cost, relative; of the penalties


class Cost(NamedTuple):
    """What postures cost.

    Attributes:
        tasks: Σ ‖W e‖².
        rough: ρ Σ ‖x⃛‖².
        lacking: penalties.
    """

    tasks: float
    rough: float
    lacking: float

    @property
    def whole(self) -> float:
        """The sum."""
        return self.tasks + self.rough + self.lacking


class Problem:
    """min Σ ‖W e‖² + ρ Σ ‖x⃛‖² + penalties, over the postures of all frames but the ends.

    e are the errors of `FrameTasks`, x the coordinates of a posture, ρ = (2π f)⁻⁶. Hard are the
    soles where they are planted and the joint limits. By the L1 norm are penalised: constraints of
    the user's, and the clearance of links [Witkin88; Gleicher98].
    """

    def __init__(
        self, scene: Scene, asked: Asked, constraints: Sequence[Constraint], crossover: float
    ):
        self.scene, self.asked, self.constraints = scene, asked, constraints
        nv = scene.model.nv
        third = third_difference(len(scene), scene.dt)
        self.third = sparse.kron(third, sparse.identity(nv), format="csr")
        self.rho = (2.0 * np.pi * crossover) ** -6
        self.inner = np.arange(1, len(scene) - 1)
        inner = scene.robot.joint_range + np.array([MARGIN, -MARGIN])
        self.low, self.high = np.sort(inner, axis=1).T  # of a range below two margins the middle

    def cost(self) -> Cost:
        """The cost of the postures as they are."""
        scene = self.scene
        errors = [self.asked.errors(scene, frame) for frame in range(len(scene))]
        rough = self.third @ coordinates(scene.qpos, scene.robot.standing_qpos).ravel()
        joints = scene.qpos[1:-1, 7:]
        lacking = HARD * float(
            np.maximum(np.maximum(self.low - joints, joints - self.high), 0).sum()
        )
        for frame in self.inner.tolist():
            lacking += HARD * self.asked.too_near(scene, frame)
        lacking += sum(each.weight * float(each.rows.excess.sum()) for each in self._wanted())
        return Cost(sum(float(e @ e) for e in errors), self.rho * float(rough @ rough), lacking)

    def step(self, trust: float) -> np.ndarray | None:
        """(F, nv) the displacements of one quadratic program, joints by at most `trust` [rad]."""
        scene, nv = self.scene, self.scene.model.nv
        errors, jacobians, moves, penalised = [], [], [], self._wanted()
        for frame in range(len(scene)):
            errors.append(self.asked.errors(scene, frame))
            jacobians.append(sparse.csr_matrix(self.asked.tasks.jacobian()))
            if 0 < frame < len(scene) - 1:
                moves.append(motions(scene, frame))
                penalised += [Penalised(each, HARD) for each in self.asked.clearance(scene, frame)]
            else:
                moves.append(SoleMotions(np.zeros(nv), np.zeros((nv, 0))))
        cost = self._quadratic(np.concatenate(errors), jacobians, moves)
        columns = (self.inner[:, None] * nv + np.arange(6, nv)).ravel()
        joints = scene.qpos[1:-1, 7:]
        low, high = (np.clip(end - joints, -trust, trust).ravel() for end in (self.low, self.high))
        found = solve_program(cost, columns, low, high, penalised)
        return None if found is None else found.reshape(-1, nv)

    def _wanted(self) -> list[Penalised]:
        """The rows of the user's constraints."""
        return [
            Penalised(rows, PENALTY * constraint.weight, group if rows.shared else -1)
            for group, constraint in enumerate(self.constraints)
            for rows in constraint.all_rows(self.scene)
        ]

    def _quadratic(
        self, errors: np.ndarray, jacobians: list[sparse.csr_matrix], moves: list[SoleMotions]
    ) -> Quadratic:
        scene = self.scene
        basis = sparse.block_diag([m.free for m in moves], format="csr")
        given = np.concatenate([m.given for m in moves])
        J = sparse.block_diag(jacobians, format="csr")
        T = self.third @ coordinate_derivative(scene.qpos, scene.robot.standing_qpos)
        x = coordinates(scene.qpos, scene.robot.standing_qpos).ravel()
        Jb, Tb = J @ basis, T @ basis
        damping = DAMPING * sparse.identity(basis.shape[1])
        H = 2.0 * (Jb.T @ Jb + self.rho * (Tb.T @ Tb) + damping)
        rough = self.third @ x + T @ given
        g = 2.0 * (Jb.T @ (errors + J @ given) + self.rho * (Tb.T @ rough))
        return Quadratic(H.tocsr(), g, basis, given, scene.model.nv)


def optimise(problem: Problem, progress: Callable[[int, Cost], None] | None = None) -> None:
    """Move the postures of the problem's scene to a minimum of its cost.

    Each program gives displacements; the largest of their shares 1, ½, ¼ and 0.1 is taken that
    lowers the cost once the soles are projected to their places. The trust region shrinks by half
    where less than the whole was good, and doubles otherwise.

    Raises PoiseError if OSQP breaks down in the first program.
    """
    scene, cost = problem.scene, problem.cost()
    trust, solved = TRUST, 0
    while solved < MOST and trust > LEAST_TRUST:
        step = problem.step(trust)
        if step is None:
            if solved == 0:
                raise PoiseError("OSQP finds no solution of the first program of the clip")
            break
        solved += 1
        before, share, found = scene.qpos.copy(), 0.0, cost
        for tried in SHARES:
            for frame in problem.inner.tolist():
                scene.displace(frame, tried * step[frame])
            move_soles(scene, problem.inner)
            found = problem.cost()
            if found.whole < cost.whole:
                share = tried
                break
            scene.move(before.copy())
        if share == 0.0:
            trust *= 0.25
            continue
        enough = cost.whole - found.whole < ENOUGH * cost.whole
        enough &= cost.lacking - found.lacking < MET
        cost = found
        if progress is not None:
            progress(solved, cost)
        if enough:
            break
        trust = min(2.0 * trust, TRUST) if share == 1.0 else 0.5 * trust
