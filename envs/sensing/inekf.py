"""The contact-aided invariant extended Kalman filter [Hartley20] of a robot's root.

The state is χ = (R, v, p, d₁ … d_nc) and b = (b_g, b_a): axes, velocity and position of the root,
middles of the soles, biases of gyro and accelerometer. Its error is the right-invariant one

    η = χ̂ χ⁻¹ = exp(ξ),   to first order   R̂ Rᵀ = 1 + skew(ξ_R),   v̂ − R̂ Rᵀ v = ξ_v

with ξ_p and ξ_d as ξ_v,
and ζ = b̂ − b, with covariance P of (ξ_R, ξ_v, ξ_p, ξ_d, ζ_g, ζ_a). Without bias and noise ξ obeys a
linear equation exactly, wherever the state is [Barrau17].
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from poise.envs.compiled.block import Block
from poise.envs.compiled.jit import compiled
from poise.envs.compiled.maths.vectors import axes_of, copy_into, quaternion_of
from poise.envs.compiled.memory import guarded_zeros
from poise.envs.compiled.mutable import Mutable

from .config import EstimatorConfig
from .measurement import DRIFT_TIME
from .odometry import START_SPEED, Odometry, copy_axes, keep_joints, place_pressure
from .promises import turn_axes


@dataclass(eq=False)
class Invariant(Block):
    """The filter of a robot with nc soles; n = 15 + 3 nc errors."""

    odometry: Odometry  # whose joints, axes, position and velocity are filled
    place: np.ndarray  # (nc + 2, 3) v, p, d₁ …, of which those that follow are parts
    velocity: np.ndarray  # (3,) v of the root [m/s]
    position: np.ndarray  # (3,) p of the root [m]
    soles: np.ndarray  # (nc, 3) d₁ … [m]
    gyro_bias: Annotated[np.ndarray, 3]  # root axes [rad/s]
    force_bias: Annotated[np.ndarray, 3]  # root axes [m/s²]
    P: Annotated[np.ndarray, "n", "n"]
    before: Annotated[np.ndarray, 3, 3]  # R before a step; then the mean of both
    noise: Annotated[np.ndarray, 3, 3]  # covariance of a measurement
    z: Annotated[np.ndarray, 3]  # what is measured over what is expected
    B: Annotated[np.ndarray, 3, "n"]  # H P; in a step the gyro's columns Gᵀ
    K: Annotated[np.ndarray, 3, "n"]  # Kᵀ; in a step ε of each column of P
    error: Annotated[np.ndarray, "n"]  # ξ̂, ζ̂
    seen: Annotated[np.ndarray, 3]  # a sole from the root, root axes [m]
    quaternion: Annotated[np.ndarray, 4]
    # noises: of the IMU, step to step, and of the walks of its biases
    gyro: Mutable[float]  # [rad/s]
    force: Mutable[float]  # [m/s²]
    gyro_walk: Mutable[float]
    force_walk: Mutable[float]
    attitude: Mutable[float]  # of the measured one, as white noise [rad]
    encoder: Mutable[float]  # [rad]
    kinematics: Mutable[float]  # of a sole's place by the joints [m]
    slide: Mutable[float]  # of a loaded sole [m/s]
    roll: Mutable[float]  # [m] of a loaded sole that turns
    lift: Mutable[float]  # of an unloaded one [m/s]


def allocate_invariant(odometry: Odometry, sizes: dict[str, int]) -> Invariant:
    """The filter of a robot, whose state is all zeros."""
    place = guarded_zeros((sizes["nc"] + 2, 3))
    return Invariant.allocate(
        {"n": 15 + 3 * sizes["nc"]}, odometry=odometry, place=place, velocity=place[0],
        position=place[1], soles=place[2:],
    )  # fmt: skip


def begin_invariant(f: Invariant, noises: dict[str, float], c: EstimatorConfig) -> None:
    """Start at the odometry's state, with what the sensors' noises are thought to be."""
    own, drift = c.invariant, noises["tilt_drift"]
    white = drift * np.sqrt(2.0 * DRIFT_TIME / f.odometry.robot.timestep)
    f.gyro = noises["gyro_noise"]
    f.force = np.hypot(c.acceleration, noises["accelerometer_noise"])
    f.gyro_walk, f.force_walk = own.gyro_bias_walk, c.bias_walk
    f.attitude, f.encoder = np.hypot(own.attitude, white), noises["encoder_noise"]
    f.kinematics, f.slide = own.kinematics, own.slide
    f.roll, f.lift = own.roll, own.lift
    begin_state(f, np.hypot(own.attitude, drift), START_SPEED, own.gyro_bias, c.bias)


@compiled
def begin_state(f: Invariant, attitude: float, speed: float, gyro: float, force: float):
    """Start where the odometry's state is, with these deviations of R, v and the biases."""
    o, P = f.odometry, f.P
    n, nc = P.shape[0], f.place.shape[0] - 2
    copy_into(o.v[:3], f.velocity)
    copy_into(o.position, f.position)
    for i in range(nc):
        find_sole(f, i, o.q)
        for a in range(3):
            f.soles[i, a] = f.position[a]
            for b in range(3):
                f.soles[i, a] += o.axes[a, b] * f.seen[b]
    for r in range(n):
        for c in range(n):
            P[r, c] = 0.0
    for a in range(3):
        f.gyro_bias[a], f.force_bias[a] = 0.0, 0.0
        P[a, a], P[3 + a, 3 + a] = attitude**2, speed**2
        P[n - 6 + a, n - 6 + a], P[n - 3 + a, n - 3 + a] = gyro**2, force**2


@compiled
def follow_invariant(f: Invariant, last: int, earlier: int):
    """Take in all measurements up to the number `last`, as `follow_measurements` does."""
    o = f.odometry
    n, r = o.rings.q.shape[0], o.rings
    for number in range(max(o.seen, last - n + 1), last):
        row = (r.next - r.count + number + n) % n
        keep_joints(o, row, number - 1 - earlier)
        lead_on(f, r.gyro[row], r.force[row])
        place_pressure(o, row)
        see_attitude(f, r.attitude[row])
        for i in range(f.place.shape[0] - 2):
            wander(f, row, i)
            see_sole(f, row, i)
        make_symmetric(f.P)
    o.seen = max(last, o.seen)
    quaternion_of(o.axes, f.quaternion)
    axes_of(f.quaternion, o.axes)
    copy_into(f.velocity, o.v[:3])
    copy_into(f.position, o.position)


@compiled
def lead_on(f: Invariant, gyro: np.ndarray, force: np.ndarray):
    """Lead state and covariance on by one step of the IMU.

        R ← R exp((ω − b_g) dt),   v ← v + (R (f − b_a) + g) dt,   p ← p + v dt

    with each the new one in what follows, as the physics steps do.
    """
    o, R = f.odometry, f.odometry.axes
    dt = o.robot.timestep
    copy_axes(R, f.before)
    turn_axes(
        R, dt * (gyro[0] - f.gyro_bias[0]), dt * (gyro[1] - f.gyro_bias[1]),
        dt * (gyro[2] - f.gyro_bias[2]),
    )  # fmt: skip
    for a in range(3):
        for b in range(3):
            f.before[a, b] = 0.5 * (f.before[a, b] + R[a, b])
    f.velocity[2] -= dt * o.robot.gravity  # v + g dt, which both the state and its error go by
    _lead_errors(f)
    _transpose(f.P)
    _lead_errors(f)
    _add_noise_of_imu(f)
    for a in range(3):
        for b in range(3):
            f.velocity[a] += dt * R[a, b] * (force[b] - f.force_bias[b])
    for a in range(3):
        f.position[a] += dt * f.velocity[a]


@compiled
def _lead_errors(f: Invariant):
    """P ← F P of a step with R⁻, R and R̄ = ½ (R⁻ + R); ε = −R̄ ζ_g dt is what the gyro's bias turns:

    ξ_R ← ξ_R + ε,   ξ_v ← ξ_v + g × ξ_R dt + (v + g dt) × ε − R ζ_a dt,
    ξ_p ← ξ_p + p × ε + ξ_v dt with the new ξ_v,   ξ_d ← ξ_d + d × ε
    """
    P, R, M, x, E = f.P, f.odometry.axes, f.before, f.place, f.K
    n, dt, g = P.shape[0], f.odometry.robot.timestep, f.odometry.robot.gravity
    for a in range(3):
        m0, m1, m2 = -dt * M[a, 0], -dt * M[a, 1], -dt * M[a, 2]
        r0, r1, r2 = -dt * R[a, 0], -dt * R[a, 1], -dt * R[a, 2]
        for c in range(n):
            E[a, c] = m0 * P[n - 6, c] + m1 * P[n - 5, c] + m2 * P[n - 4, c]
        for c in range(n):
            P[3 + a, c] += r0 * P[n - 3, c] + r1 * P[n - 2, c] + r2 * P[n - 1, c]
    for c in range(n):
        P[3, c] += dt * g * P[1, c]
    for c in range(n):
        P[4, c] -= dt * g * P[0, c]
    for i in range(x.shape[0]):  # the velocity, the position and the soles
        for a in range(3):
            j, k = (a + 1) % 3, (a + 2) % 3
            u, w, row = x[i, j], x[i, k], 3 + 3 * i + a
            for c in range(n):
                P[row, c] += u * E[k, c] - w * E[j, c]
    for a in range(3):
        for c in range(n):
            P[a, c] += E[a, c]
        for c in range(n):
            P[6 + a, c] += dt * P[3 + a, c]


@compiled
def _transpose(P: np.ndarray):
    """P ← Pᵀ: rows propagate faster than columns, and P is symmetric before and after."""
    for r in range(P.shape[0]):
        for c in range(r):
            P[r, c], P[c, r] = P[c, r], P[r, c]


@compiled
def _add_noise_of_imu(f: Invariant):
    """P ← P + G Gᵀ σ_g² dt² + … with the columns of a turn, G = (1, v × , p × + v × dt, d ×, 0, 0),
    of the accelerometer, (0, 1, dt), and of the biases' walks."""
    P, G, x = f.P, f.B, f.place
    n, dt = P.shape[0], f.odometry.robot.timestep
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        for c in range(n):
            G[k, c] = 0.0
        G[k, k] = f.gyro * dt
        for row in range(x.shape[0]):  # x × e_k
            G[k, 3 + 3 * row + i] = f.gyro * dt * x[row, j]
            G[k, 3 + 3 * row + j] = -f.gyro * dt * x[row, i]
        for a in range(3):
            G[k, 6 + a] += dt * G[k, 3 + a]
    for r in range(n - 6):
        g0, g1, g2 = G[0, r], G[1, r], G[2, r]
        for c in range(n - 6):
            P[r, c] += g0 * G[0, c] + g1 * G[1, c] + g2 * G[2, c]
    stir = (f.force * dt) ** 2
    for a in range(3):
        P[3 + a, 3 + a] += stir
        P[3 + a, 6 + a] += dt * stir
        P[6 + a, 3 + a] += dt * stir
        P[6 + a, 6 + a] += dt * dt * stir
        P[n - 6 + a, n - 6 + a] += dt * f.gyro_walk**2
        P[n - 3 + a, n - 3 + a] += dt * f.force_walk**2


@compiled
def wander(f: Invariant, row: int, i: int):
    """Lead the middle of sole i on, d ← d + ω_i × (d − c) dt of a sole that rolls about the point c
    at which it is pressed; the more doubtful the less it bears and the faster it turns."""
    o, s, axes = f.odometry, f.odometry.state, f.odometry.state.sole_axes[i]
    dt, turning = o.robot.timestep, 0.0
    for a in range(3):
        rate = 0.0
        for j in range(3, o.v.shape[0]):
            rate += s.J[6 * i + 3 + a, j] * o.v[j]
        f.z[a] = rate
        turning += rate * rate
    rx = axes[0, 0] * o.pressed[i, 0] + axes[0, 1] * o.pressed[i, 1]
    ry = axes[1, 0] * o.pressed[i, 0] + axes[1, 1] * o.pressed[i, 1]
    rz = axes[2, 0] * o.pressed[i, 0] + axes[2, 1] * o.pressed[i, 1]
    doubt, load = f.lift**2, o.share[i]
    if o.rings.found[row, i] > 0.0 and load > 0.0:
        roll = f.slide**2 + f.roll**2 * turning
        doubt = min(doubt, roll / (load * load))
        f.soles[i, 0] -= dt * (f.z[1] * rz - f.z[2] * ry)
        f.soles[i, 1] -= dt * (f.z[2] * rx - f.z[0] * rz)
        f.soles[i, 2] -= dt * (f.z[0] * ry - f.z[1] * rx)
    for a in range(9 + 3 * i, 12 + 3 * i):
        f.P[a, a] += dt * doubt


@compiled
def see_attitude(f: Invariant, attitude: np.ndarray):
    """Correct by the attitude A = exp(δ) R of the IMU: log(R̂ Aᵀ) = ξ_R − δ, to first order.

    δ drifts slowly; `attitude` is the deviation of white noise that is as bad in the long run.
    """
    R = f.odometry.axes
    for a in range(3):
        i, j = (a + 1) % 3, (a + 2) % 3
        f.z[a] = 0.0
        for b in range(3):
            f.z[a] += 0.5 * (R[j, b] * attitude[i, b] - R[i, b] * attitude[j, b])
            f.noise[a, b] = f.attitude**2 if a == b else 0.0
    correct_error(f, 0, -1)


@compiled
def find_sole(f: Invariant, i: int, q: np.ndarray):
    """`seen` ← the middle of sole i from the root, at joint positions q (nj,), in root axes [m].

    Product of exponentials: from the posture of the tick before each joint of the leg turns the
    point about its axis by the difference of its positions, the outermost first.
    """
    o, s = f.odometry, f.odometry.state
    chain, point = o.robot.chain[i], s.sole_point[i]
    x, y, z = point[0], point[1], point[2]
    for k in range(o.robot.chain_length[i] - 1, -1, -1):
        d = chain[k]
        if d < 6:
            break
        angle = q[d - 6] - s.qpos[1 + d]
        wx, wy, wz = s.J[6 * i + 3, d], s.J[6 * i + 4, d], s.J[6 * i + 5, d]
        px, py, pz = x - point[0], y - point[1], z - point[2]
        ux = s.J[6 * i, d] + wy * pz - wz * py  # velocity of the point for each rad/s
        uy = s.J[6 * i + 1, d] + wz * px - wx * pz
        uz = s.J[6 * i + 2, d] + wx * py - wy * px
        hinge = wx * wx + wy * wy + wz * wz > 0.5
        sine, cosine = (np.sin(angle), 1.0 - np.cos(angle)) if hinge else (angle, 0.0)
        x += sine * ux + cosine * (wy * uz - wz * uy)
        y += sine * uy + cosine * (wz * ux - wx * uz)
        z += sine * uz + cosine * (wx * uy - wy * ux)
    x, y, z = x - s.qpos[0], y - s.qpos[1], z - s.qpos[2]
    for a in range(3):
        f.seen[a] = s.root_axes[0, a] * x + s.root_axes[1, a] * y + s.root_axes[2, a] * z


@compiled
def see_sole(f: Invariant, row: int, i: int):
    """Correct by where the joints have sole i: R̂ h − (d̂ − p̂) = ξ_p − ξ_d of h = Rᵀ(d − p)."""
    o, s = f.odometry, f.odometry.state
    find_sole(f, i, o.rings.q[row])
    for a in range(3):
        f.z[a] = f.position[a] - f.soles[i, a]
        for b in range(3):
            f.z[a] += o.axes[a, b] * f.seen[b]
            total = 0.0
            for k in range(o.robot.chain_length[i]):
                d = o.robot.chain[i, k]
                if d >= 6:
                    total += s.J[6 * i + a, d] * s.J[6 * i + b, d]
            f.noise[a, b] = f.encoder**2 * total
        f.noise[a, a] += f.kinematics**2
    correct_error(f, 6, 9 + 3 * i)


@compiled
def correct_error(f: Invariant, plus: int, minus: int):
    """Correct state and covariance by z = ξ[plus : plus + 3] − ξ[minus : minus + 3] + noise.

    K = P Hᵀ (H P Hᵀ + N)⁻¹,   (ξ̂, ζ̂) = K z,   χ̂ ← exp(−ξ̂) χ̂,   b̂ ← b̂ − ζ̂,   P ← P − K H P

    Args:
        minus: −1 where nothing is taken away.
    """
    P, B, K, z = f.P, f.B, f.K, f.z
    n = P.shape[0]
    for k in range(3):
        for c in range(n):
            B[k, c] = P[plus + k, c] - (P[minus + k, c] if minus >= 0 else 0.0)
    for a in range(3):
        for b in range(3):
            f.noise[a, b] += B[a, plus + b] - (B[a, minus + b] if minus >= 0 else 0.0)
    invert_symmetric(f.noise)
    S = f.noise
    for k in range(3):
        s0, s1, s2 = S[k, 0], S[k, 1], S[k, 2]
        for c in range(n):
            K[k, c] = s0 * B[0, c] + s1 * B[1, c] + s2 * B[2, c]
    z0, z1, z2 = z[0], z[1], z[2]
    for c in range(n):
        f.error[c] = K[0, c] * z0 + K[1, c] * z1 + K[2, c] * z2
    for r in range(n):
        k0, k1, k2 = K[0, r], K[1, r], K[2, r]
        for c in range(n):
            P[r, c] -= k0 * B[0, c] + k1 * B[1, c] + k2 * B[2, c]
    retract(f)


@compiled
def make_symmetric(P: np.ndarray):
    """P ← ½ (P + Pᵀ), which differ by rounding alone."""
    for r in range(P.shape[0]):
        for c in range(r):
            P[r, c] = P[c, r] = 0.5 * (P[r, c] + P[c, r])


@compiled
def invert_symmetric(S: np.ndarray):
    """S ← S⁻¹ of a symmetric matrix (3, 3)."""
    a, b, c, d, e, g = S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2]
    A, B, C = d * g - e * e, c * e - b * g, b * e - c * d
    scale = 1.0 / (a * A + b * B + c * C)
    S[0, 0], S[1, 1], S[2, 2] = A * scale, (a * g - c * c) * scale, (a * d - b * b) * scale
    S[0, 1] = S[1, 0] = B * scale
    S[0, 2] = S[2, 0] = C * scale
    S[1, 2] = S[2, 1] = (b * c - a * e) * scale


@compiled
def retract(f: Invariant):
    """χ̂ ← exp(−ξ̂) χ̂, b̂ ← b̂ − ζ̂: R ← E R and x ← E x − J ξ_x of each other column x, with
    E = exp(skew(φ)), φ = −ξ_R, and J the left Jacobian of the rotations at φ [Hartley20]."""
    e, R, n = f.error, f.odometry.axes, f.P.shape[0]
    x, y, z = -e[0], -e[1], -e[2]
    square = x * x + y * y + z * z
    angle = np.sqrt(square)
    if angle > 1e-4:
        s, c = np.sin(angle) / angle, (1.0 - np.cos(angle)) / square
        j = (1.0 - s) / square
    else:
        s, c, j = 1.0 - square / 6.0, 0.5 - square / 24.0, 1.0 / 6.0 - square / 120.0
    for k in range(3):
        R[0, k], R[1, k], R[2, k] = _bent(R[0, k], R[1, k], R[2, k], x, y, z, s, c)
    for i in range(f.place.shape[0]):
        p, k = f.place[i], 3 + 3 * i
        p[0], p[1], p[2] = _bent(p[0], p[1], p[2], x, y, z, s, c)
        u, v, w = _bent(e[k], e[k + 1], e[k + 2], x, y, z, c, j)
        p[0], p[1], p[2] = p[0] - u, p[1] - v, p[2] - w
    for a in range(3):
        f.gyro_bias[a] -= e[n - 6 + a]
        f.force_bias[a] -= e[n - 3 + a]


@compiled
def _bent(
    u: float, v: float, w: float, x: float, y: float, z: float, s: float, c: float
) -> tuple[float, float, float]:
    """r + s φ × r + c φ × (φ × r) of r = (u, v, w), φ = (x, y, z)."""
    p, q, t = y * w - z * v, z * u - x * w, x * v - y * u
    return (
        u + s * p + c * (y * t - z * q),
        v + s * q + c * (z * p - x * t),
        w + s * t + c * (x * q - y * p),
    )
