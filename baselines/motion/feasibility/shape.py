"""A join of a given length, bent until the ground, the motors and the joints allow it."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from poise.baselines.balance.references.legs import PlantedLegs
from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.solvers import QP, make_solver
from poise.envs.compiled.maths.polygons import half_planes

from .check import Feasibility, FeasibilityLimits, check_joints, judge
from .curve import Boundary, Curve, End, JoinPart, WhyNot, bend_shapes, jerk_matrix
from .edges import EDGE, between_clips
from .split import bearable_region
from .trajectory import PlantedRobot, Trajectory, joints_of, sample_trajectory

NEIGHBOURS = 10  # frames of the clips beside a join that are looked at with it
ROUNDS = 5  # times that a curve is bent
COARSE, FINE = 0.02, 0.01  # [s] between samples while bending, and at last
INSIDE = 0.005  # [rad] kept from joint limits, for splines between the frames
AIM = 0.01  # [m] that the ZMP is to be inside of what is needed, since bending is linear
SLACK = 1e5  # price of what remains violated [1/m, 1/rad], beside the jerk
HOPELESS = 0.15  # [m, rad] of violation for which no further round is tried
UNREACHED = 1e-5  # [m, rad] of the soles
MOVED = 6  # coordinates of the curve that are no joints: CoM and φ


@dataclass(frozen=True)
class Shaper:
    """Joins of one robot between two ends, at one rate.

    Attributes:
        dt: time between frames [s].
        heights: lowest and highest CoM that the join may have [m].
        masses: (n,) of the coordinates over the robot's: what K is weighted by.
        time_price: λ of K + λ D, which is made least [m²/s⁴].
    """

    planted: PlantedRobot
    legs: PlantedLegs
    limits: FeasibilityLimits
    dt: float
    heights: tuple[float, float]
    masses: np.ndarray
    time_price: float

    def end(self, motion: ReferenceMotion, time: float, frames: np.ndarray) -> End:
        """The state of a motion at a time [s]; `frames` (m, nj) are those on its side."""
        s, others = motion.sample(time), self.legs.others
        state = Boundary(
            np.concatenate([s.com_offset, s.root, s.q_ref[others]]),
            np.concatenate([s.com_vel, s.root_vel, s.v_ref[others]]),
            np.concatenate([s.com_acc, s.root_acc, s.a_ref[others]]),
        )
        region = bearable_region(self.planted, s.q_ref, share=self.limits.torque)
        region = np.zeros((0, 2)) if region is None else region
        times = time + np.arange(-EDGE, EDGE + 1e-9, FINE)
        times = times[(times >= 0.0) & (times <= motion.duration)]
        own = check_joints(self.planted, joints_of(motion), times, self.limits)
        return End(frames, s.q_ref, state, region, own)

    def attempt(self, a: End, b: End, count: int) -> JoinPart | WhyNot:
        """The join that lasts `count` frames."""
        curve = Curve.between(a.boundary, b.boundary, count * self.dt)
        bends, stuck = self._bent_joints(curve)
        if stuck:
            return WhyNot(stuck)
        curve = curve._replace(bends=bends)
        for _ in range(ROUNDS):
            qpos, slopes = self.frames(curve, a, count)
            if qpos is None:
                return WhyNot("the legs cannot reach the ground")
            judged, path = self._judged(a, b, qpos, COARSE)
            reason = between_clips(judged, a.own, b.own)
            if not reason:
                judged, path = self._judged(a, b, qpos, FINE)
                reason = between_clips(judged, a.own, b.own)
            if not reason:
                return JoinPart(qpos, curve, curve.energy(self.masses), judged)
            step, lacking = self._step(curve, qpos, slopes, judged, path, (a, b))
            if step is None or lacking > HOPELESS or np.abs(step).max() < 1e-7:
                break
            bends = curve.bends.copy()
            bends[:, :MOVED] += step
            curve = curve._replace(bends=bends)
        return WhyNot(reason, judged.lacking)

    def _bent_joints(self, curve: Curve) -> tuple[np.ndarray, str]:
        """Least bends (3, n) that keep the joints in range, each by itself; or what cannot."""
        robot, others = self.planted.robot, self.legs.others
        s = np.linspace(0.0, 1.0, 41)
        shapes, values = bend_shapes(s), curve.at(s)
        bends = np.zeros_like(curve.bends)
        for i, joint in enumerate(others, start=MOVED):
            low, high = robot.joint_range[joint] + [INSIDE, -INSIDE]
            low, high = min(low, *values[[0, -1], i]), max(high, *values[[0, -1], i])
            bend = _least_bend(values[:, i], low, high, shapes)
            if bend is None:
                return bends, f"{robot.joint_names[joint]} cannot stay within its range"
            bends[:, i] = bend
        return bends, ""

    def frames(self, curve: Curve, a: End, count: int) -> tuple[np.ndarray | None, np.ndarray]:
        """Postures (n − 1, nq) on a curve, and the legs' derivatives (n − 1, k, 6)."""
        values = curve.at(np.arange(1, count) / count)
        qpos, slopes, guess = [], [], a.q
        for row in values:
            posture, error = self.legs.reach(row[:3], row[3:6], row[6:], guess)
            if error > UNREACHED:
                return None, np.empty(0)
            slopes.append(self.legs.sensitivity(row[3:6]))
            guess = posture[7:]
            qpos.append(posture)
        return np.array(qpos), np.array(slopes)

    def _judged(
        self, a: End, b: End, qpos: np.ndarray, step: float
    ) -> tuple[Feasibility, Trajectory]:
        frames = np.vstack([a.frames[-NEIGHBOURS:], qpos[:, 7:], b.frames[:NEIGHBOURS]])
        times = np.arange(len(frames)) * self.dt
        spline: BSpline = make_interp_spline(times, frames, k=3)
        rate, bend = spline.derivative(1), spline.derivative(2)
        first = (min(len(a.frames), NEIGHBOURS) - 1) * self.dt
        last = first + (len(qpos) + 1) * self.dt
        samples = np.linspace(first, last, 1 + round((last - first) / step))
        path = sample_trajectory(self.planted, lambda t: (spline(t), rate(t), bend(t)), samples)
        path = path._replace(times=path.times - first)
        return judge(self.planted.robot, path, self.limits), path

    def _step(
        self, curve: Curve, qpos: np.ndarray, slopes: np.ndarray, judged: Feasibility,
        path: Trajectory, ends: tuple[End, End],
    ) -> tuple[np.ndarray | None, float]:  # fmt: skip
        """Change (3, 6) of the bends of CoM and φ by a QP, and what stays violated.

        min Σ mᵢ zᵢᵀ R zᵢ + 10⁵ σ, where the ZMP, p + δc − h/(g + c̈_z) δc̈, the legs,
        q + ∂q/∂(c, φ) δ, and the height keep their bounds up to σ ≥ 0.
        """
        rows, bounds = [], []
        for part in (self._zmp_rows(curve, judged, path, ends),
                     self._leg_rows(qpos, slopes), self._height_rows(curve)):  # fmt: skip
            rows.append(part[0])
            bounds.append(part[1])
        C, u = np.vstack(rows), np.concatenate(bounds)
        near = u < 0.5  # [m, rad]: others will not be met
        C, u = C[near], u[near]
        size = 3 * MOVED
        H, now = np.zeros((size + 1, size + 1)), curve.bends[:, :MOVED].T.ravel()
        R = jerk_matrix()
        H[:size, :size] = np.kron(np.diag(self.masses[:MOVED]), R / R[1, 1])
        H[size, size] = 1.0
        g = np.append(H[:size, :size] @ now, SLACK)
        C = np.vstack([np.hstack([C, -np.ones((len(C), 1))]), np.eye(size + 1)[size:]])
        low, high = np.append(np.full(len(u), -np.inf), 0.0), np.append(u, np.inf)
        solved = make_solver("active-set").solve(QP(H, g, C, low, high))
        if not solved.solved:
            return None, np.inf
        return solved.x[:size].reshape(MOVED, 3).T, float(solved.x[size])

    def _zmp_rows(
        self, curve: Curve, judged: Feasibility, path: Trajectory, ends: tuple[End, End]
    ) -> tuple[np.ndarray, np.ndarray]:
        s = judged.times[1:-1] / curve.duration
        # beside a cut where the clip itself is out, bends change next to nothing
        inner = np.ones(len(s), dtype=bool)
        for end, away in ((ends[0], s), (ends[1], 1.0 - s)):
            inner &= end.own.feasible | (away * curve.duration > EDGE)
        g = self.planted.robot.units.gravity
        h = (path.com[1:-1, 2] - path.height) / (path.com_acc[1:-1, 2] + g)
        moved = bend_shapes(s) - h[:, None] * bend_shapes(s, 2) / curve.duration**2
        rows, bounds = [], []
        for region, margin in (
            (judged.support, self.limits.zmp_margin), (ends[0].region, 0.0), (ends[1].region, 0.0)
        ):  # fmt: skip
            if len(region) == 0:
                continue
            normals, offsets = half_planes(region)
            middle = region.mean(axis=0)
            reach = offsets - normals @ middle
            if margin == 0.0:  # a motor bears less of a greater load
                reach = reach / np.maximum(judged.load[1:-1, None], 1.0)
            room = reach - (judged.zmp[1:-1] - middle) @ normals.T - margin - AIM
            block = np.zeros((len(s), len(normals), 3 * MOVED))
            block[:, :, 0:3] = normals[:, 0, None] * moved[:, None, :]
            block[:, :, 3:6] = normals[:, 1, None] * moved[:, None, :]
            rows.append(block[inner].reshape(-1, 3 * MOVED))
            bounds.append(room[inner].ravel())
        return np.vstack(rows), np.concatenate(bounds)

    def _leg_rows(self, qpos: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = np.arange(1, len(qpos) + 1) / (len(qpos) + 1)
        moved = np.einsum("fki,fj->fkij", slopes, bend_shapes(s))
        moved = moved.reshape(-1, 3 * MOVED)
        legs, bounds = qpos[:, 7 + self.legs.legs], self.planted.robot.joint_range[self.legs.legs]
        over = (bounds[:, 1] - INSIDE - legs).ravel()
        under = (legs - bounds[:, 0] - INSIDE).ravel()
        return np.vstack([moved, -moved]), np.concatenate([over, under])

    def _height_rows(self, curve: Curve) -> tuple[np.ndarray, np.ndarray]:
        s, g = np.linspace(0.05, 0.95, 19), self.planted.robot.units.gravity
        height, lift = curve.at(s)[:, 2], curve.at(s, 2)[:, 2] / g
        shapes, bent = bend_shapes(s), bend_shapes(s, 2) / curve.duration**2 / g
        rows = np.zeros((4 * len(s), 3 * MOVED))
        rows[:, 6:9] = np.vstack([shapes, -shapes, bent, -bent])
        low, high = self.heights
        least, most = self.limits.load
        bounds = (high - height, height - low, most - 1.05 - lift, lift - least + 1.05 - 0.1)
        return rows, np.concatenate(bounds)


def _least_bend(
    values: np.ndarray, low: float, high: float, shapes: np.ndarray
) -> np.ndarray | None:
    """z (3,) of least jerk for which values + N z stay within two bounds; None if none does."""
    if values.min() >= low - 1e-9 and values.max() <= high + 1e-9:
        return np.zeros(shapes.shape[1])
    R = jerk_matrix()
    problem = QP(R / R[1, 1], np.zeros(len(R)), shapes, low - values, high - values)
    solved = make_solver("active-set").solve(problem)
    return solved.x if solved.solved else None
