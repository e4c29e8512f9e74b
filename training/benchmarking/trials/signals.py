"""Signals of a trial over time: CoM, CoP, capture point, angular momentum, torque, sway."""

import numpy as np

from poise.envs.balance.base import BalanceEnv
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.simulation import Simulation
from poise.training.benchmarking.statistics.eurobench import body_sway, recovery_time, sway_angle


class TrialSignals:
    """Record the signals of a trial in the heading frame; pass it to `run_trial`.

    After the trial, `t` is the time (n,) [s] and `columns` has

    - com, cop, capture_point (n, 2): forward and left [m]
    - support (n, 2, 2): extent [m] of the support polygon, [:, axis, (low, high)]
    - angular_momentum (n, 3): about the CoM; forward, left and up axis [kg·m²/s]
    - torque (n,): largest |τ| / τ_max over the motors
    """

    def __init__(self) -> None:
        self._times: list[float] = []
        self._rows: list[dict[str, object]] = []
        self._origin, self._axes = np.zeros(2), np.eye(2)

    def __call__(self, env: BalanceEnv) -> None:
        state = env.simulation.state
        if not self._rows:
            cos, sin = state.heading
            self._origin, self._axes = state.origin[:2].copy(), np.array([[cos, -sin], [sin, cos]])
        support = self._local(state.support_polygon)
        load = np.abs(env.simulation.views.ctrl) / env.robot.torque_limit
        momentum = state.angular_momentum
        self._times.append(env.simulation.time)
        self._rows.append({
            "com": self._local(state.com[:2]),
            "cop": self._local(state.cop),
            "capture_point": self._local(state.capture_point),
            "support": np.stack([support.min(axis=0), support.max(axis=0)], axis=1),
            "angular_momentum": np.append(momentum[:2] @ self._axes, momentum[2]),
            "torque": float(load.max()),
        })  # fmt: skip

    @property
    def t(self) -> np.ndarray:
        return np.array(self._times)

    @property
    def columns(self) -> dict[str, np.ndarray]:
        return {name: np.array([row[name] for row in self._rows]) for name in self._rows[0]}

    def _local(self, points: np.ndarray) -> np.ndarray:
        return (points - self._origin) @ self._axes


class Sway:
    """Record CoM and ankles at every policy step; pass it to `run_trial`."""

    def __init__(self) -> None:
        self._rows: list[tuple[np.ndarray, np.ndarray]] = []
        self._heading = np.array([1.0, 0.0])  # of the start

    def __call__(self, env: BalanceEnv) -> None:
        state = env.simulation.state
        if not self._rows:
            self._heading = state.heading.copy()
        self._rows.append((state.com.copy(), _ankles(env.simulation)))

    def of(self, push: Push, period: float) -> tuple[float, float | None]:
        """Return the body sway [rad] and recovery time [s] in the plane of a push, at rows `period`
        apart."""
        angle, start = self.angle(push.direction), round(push.start / period)
        return body_sway(angle, start), recovery_time(angle, start, 1.0 / period)

    def angle(self, direction: float) -> np.ndarray:
        """θ (n,) in the plane of a push towards `direction` [deg]."""
        cos, sin = self._heading
        c, s = np.cos(np.radians(direction)), np.sin(np.radians(direction))
        com, ankles = (np.array(column) for column in zip(*self._rows, strict=True))
        return sway_angle(com, ankles, [cos * c - sin * s, sin * c + cos * s])


def _ankles(simulation: Simulation) -> np.ndarray:
    """(3,) middle of the feet's own joints, or of the feet where a foot has none [m]."""
    model, data = simulation.model, simulation.data
    points = []
    for sole in simulation.robot.soles:
        first, count = model.body_jntadr[sole.body_id], model.body_jntnum[sole.body_id]
        joints = data.xanchor[first : first + count]
        points.append(joints.mean(axis=0) if count else data.xpos[sole.body_id])
    return np.mean(points, axis=0)
