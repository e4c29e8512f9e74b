"""Both pendulums alone in a plane [Zhao, fig. 10]: `python -m tests.performance.planar_stances`.

A mass m at the hip, rods or a spring without mass, one stance from half a step behind the CoP to
half a step ahead, nothing of a robot. With a free knee the force N of the leg goes from the CoP p
through the knee to the mass. So the shank's angle θ says where all are, and θ̈ and N follow from

    m r̈ = N u − m g ẑ,   r(θ) = k + L1 u,   k = L2 (sin θ, cos θ),   u = (k − p)/‖k − p‖,

two equations: [Zhao (4), (5)] without small angles. With p at the ankle the leg is straight, the
first-order pendulum. The spring's mass is free in the plane: m r̈ = k (ℓ₀ − ‖r‖) r/‖r‖ − m g ẑ.
`--plot FILE` draws the legs.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from poise.baselines.walking.models.two_rods import flexion_at, length_at
from poise.envs.robots.robot import load_robot

from .knee_bound import KAPPA, RISE, STEP, Plane, plane_of

G = 9.81
SPEED = 0.5  # [m/s] over the CoP


@dataclass(frozen=True)
class Stance:
    """What a model went through: hips and knees (n, 2) [m] from the ankle, N/(m g) (n,)."""

    time: np.ndarray
    hip: np.ndarray
    knee: np.ndarray
    force: np.ndarray

    @property
    def flexion(self) -> np.ndarray:
        """β of the knee [rad]."""
        shank, thigh = self.knee, self.hip - self.knee
        return np.arctan2(shank[:, 0], shank[:, 1]) - np.arctan2(thigh[:, 0], thigh[:, 1])


def rods(body: Plane, theta: float, cop: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Knee, hip and the direction of the force; the CoP lies at the height of the sole."""
    knee = body.shank * np.array([np.sin(theta), np.cos(theta)])
    way = knee - np.array([cop, -body.ankle])
    u = way / np.linalg.norm(way)
    return knee, knee + body.thigh * u, u


def acceleration(body: Plane, theta: float, rate: float, cop: float) -> tuple[float, float]:
    """θ̈ [rad/s²] and N/m [m/s²]; derivatives of the hip's place are central differences."""
    e = 1e-4
    low, mid, high = (rods(body, theta + s * e, cop)[1] for s in (-1.0, 0.0, 1.0))
    first, second = (high - low) / (2.0 * e), (high - 2.0 * mid + low) / e**2
    u = rods(body, theta, cop)[2]
    A = np.stack([first, -u], axis=1)
    theta_acc, force = np.linalg.solve(A, np.array([0.0, -G]) - second * rate**2)
    return float(theta_acc), float(force)


def free_knee(body: Plane, cop: float, step: float = STEP, speed: float = SPEED) -> Stance:
    """A stance of the second-order pendulum that is as fast in the middle as `speed` [m/s]."""
    start = _theta_at(body, cop, cop)
    slope = (rods(body, start + 1e-4, cop)[1] - rods(body, start - 1e-4, cop)[1])[0] / 2e-4

    def motion(_: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], acceleration(body, y[0], y[1], cop)[0]

    parts = []
    for sign in (-1.0, 1.0):

        def beyond(_: float, y: np.ndarray, sign: float = sign) -> float:
            return float(abs(rods(body, y[0], cop)[1][0] - cop) - 0.5 * step)

        beyond.terminal = True
        parts.append(solve_ivp(motion, (0.0, sign * 2.0), (start, speed / slope), rtol=1e-8,
                               events=beyond, max_step=0.005))  # fmt: skip
    time = np.concatenate([parts[0].t[:0:-1], parts[1].t])
    states = np.concatenate([parts[0].y[:, :0:-1], parts[1].y], axis=1)
    places = [rods(body, theta, cop)[:2] for theta in states[0]]
    force = [acceleration(body, theta, rate, cop)[1] / G for theta, rate in states.T]
    return Stance(time, np.array([p[1] for p in places]), np.array([p[0] for p in places]),
                  np.array(force))  # fmt: skip


def _theta_at(body: Plane, cop: float, x: float) -> float:
    """θ of a hip at x [m] ahead of the ankle, by bisection."""
    low, high = -0.7, 0.7
    for _ in range(60):
        middle = 0.5 * (low + high)
        if rods(body, middle, cop)[1][0] < x:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def spring(body: Plane, kappa: float = KAPPA, step: float = STEP, speed: float = SPEED) -> Stance:
    """A stance of the spring, from where it bears the mass at rest in the vertical."""
    rest = float(length_at(body.thigh, body.shank, RISE))
    stiffness = kappa * G / rest

    def motion(_: float, y: np.ndarray) -> tuple[float, ...]:
        r = float(np.hypot(y[0], y[1]))
        pull = stiffness * (rest - r) / r
        return y[2], y[3], pull * y[0], pull * y[1] - G

    def beyond(_: float, y: np.ndarray) -> float:
        return float(abs(y[0]) - 0.5 * step)

    beyond.terminal = True
    parts = [
        solve_ivp(motion, (0.0, sign * 2.0), (0.0, rest * (1.0 - 1.0 / kappa), speed, 0.0),
                  rtol=1e-9, events=beyond, max_step=0.005) for sign in (-1.0, 1.0)
    ]  # fmt: skip
    time = np.concatenate([parts[0].t[:0:-1], parts[1].t])
    hip = np.concatenate([parts[0].y[:2, :0:-1], parts[1].y[:2]], axis=1).T
    length = np.hypot(*hip.T)
    bend = np.array([flexion_at(body.thigh, body.shank, float(r)) for r in length])
    lean = np.arctan2(hip[:, 0], hip[:, 1]) + np.arctan2(
        body.thigh * np.sin(bend), body.shank + body.thigh * np.cos(bend)
    )
    knee = body.shank * np.stack([np.sin(lean), np.cos(lean)], axis=1)
    return Stance(time, hip, knee, stiffness * (rest - length) / G)


def plot(stances: dict[str, Stance], out: str) -> None:
    """The legs over the stance, each model beside the other."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(stances), sharey=True, figsize=(7.0, 3.4))
    for axis, (name, stance) in zip(axes, stances.items(), strict=True):
        for i in np.linspace(0, len(stance.time) - 1, 9).astype(int):
            leg = np.array([[0.0, 0.0], stance.knee[i], stance.hip[i]]).T
            axis.plot(*leg, "o-", color="0.2", markersize=3)
        axis.set(title=name, xlabel="x [m]", aspect="equal")
    axes[0].set_ylabel("z [m]")
    figure.savefig(out, dpi=120, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plot")
    asked = parser.parse_args()
    body = plane_of(load_robot("human"))
    cop = 0.5 * sum(body.cop)
    stances = {"spring": spring(body), "free knee": free_knee(body, cop)}
    for name, stance in stances.items():
        bend = np.degrees(stance.flexion)
        print(f"{name}: knee bent by {bend.mean():.1f} ° ({bend.min():.1f} to {bend.max():.1f}), "
              f"stance of {np.ptp(stance.time):.2f} s, force {stance.force.min():.2f} to "
              f"{stance.force.max():.2f} m g")  # fmt: skip
    if asked.plot:
        plot(stances, asked.plot)


if __name__ == "__main__":
    main()
