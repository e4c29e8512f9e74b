"""Vectors and frames: formulas without state."""

import numpy as np

from poise.envs.compiled.jit import compiled


@compiled
def copy_into(source: np.ndarray, out: np.ndarray) -> None:
    """`out[:] = source` of two vectors; NumPy's form compiles checks and their messages too."""
    for i in range(out.shape[0]):
        out[i] = source[i]


@compiled
def cross(a: np.ndarray, b: np.ndarray, out: np.ndarray) -> None:
    """out = a × b for arrays of three."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = x, y, z


@compiled
def along(cos: float, sin: float, x: float, y: float) -> tuple[float, float]:
    """A horizontal vector (x, y) of the world along the axes of a frame turned by (cos, sin)."""
    return cos * x + sin * y, cos * y - sin * x


@compiled
def turned(cos: float, sin: float, x: float, y: float) -> tuple[float, float]:
    """(x, y) along the axes of a frame turned by (cos, sin), in the world; undoes `along`."""
    return cos * x - sin * y, sin * x + cos * y


@compiled
def placed(ox: float, oy: float, cos: float, sin: float, x: float, y: float) -> tuple[float, float]:
    """The point (x, y) of a frame at (ox, oy) turned by (cos, sin), in the world."""
    return ox + cos * x - sin * y, oy + sin * x + cos * y


@compiled
def rotated(
    x: float, y: float, z: float, cos: float, sin: float, u: np.ndarray
) -> tuple[float, float, float]:
    """The vector `u` (3,) turned about the unit axis n = (x, y, z), by Rodrigues' formula:

    u cos θ + (n × u) sin θ + n (n · u) (1 − cos θ)

    An axis of zeros turns nothing, if cos θ = 1.
    """
    dot = (x * u[0] + y * u[1] + z * u[2]) * (1.0 - cos)
    return (
        cos * u[0] + sin * (y * u[2] - z * u[1]) + dot * x,
        cos * u[1] + sin * (z * u[0] - x * u[2]) + dot * y,
        cos * u[2] + sin * (x * u[1] - y * u[0]) + dot * z,
    )


@compiled
def rotation_error(axes: np.ndarray, desired: np.ndarray, out: np.ndarray) -> None:
    """½ Σ aᵢ × bᵢ of the columns of two frames into `out` (3,): sine times axis of the turn that
    leads from `axes` to `desired`.

    The sine needs no division and is smooth everywhere. It equals the angle to first order, and
    falls again beyond 90°. So it serves where frames stay near each other, as soles and trunks that
    are kept level do. `turn_error`, `rotation_vector` have the angle, for what may be turned far.
    """
    for a in range(3):
        i, j = (a + 1) % 3, (a + 2) % 3
        total = 0.0
        for k in range(3):
            total += desired[j, k] * axes[i, k] - desired[i, k] * axes[j, k]
        out[a] = 0.5 * total


@compiled
def turn_error(axes: np.ndarray, desired: np.ndarray, out: np.ndarray) -> float:
    """The turn that leads from a frame R to another one D, in the axes of R: sine times axis of
    RᵀD into `out` (3,); returned is angle/sine, by which `out` becomes angle times axis."""
    trace = 0.0  # of RᵀD; its skew part is axis · sin(angle)
    for a in range(3):
        i, j = (a + 1) % 3, (a + 2) % 3
        skew = 0.0
        for b in range(3):
            trace += axes[b, a] * desired[b, a]
            skew += axes[b, j] * desired[b, i] - axes[b, i] * desired[b, j]
        out[a] = 0.5 * skew
    sine = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    return np.arctan2(sine, 0.5 * (trace - 1.0)) / sine if sine > 1e-9 else 1.0


def rotation_between(axes: np.ndarray, desired: np.ndarray) -> np.ndarray:
    """(3,) `rotation_error` of two frames (3, 3): sine times axis of the turn between them."""
    out = np.empty(3)
    rotation_error(np.array(axes), np.array(desired), out)
    return out


def rotation_vector(R: np.ndarray) -> np.ndarray:
    """(3,) angle times axis of a rotation: φ with R = exp(skew(φ)), |φ| < π [rad]."""
    sine_axis = rotation_between(np.eye(3), R)
    sine = float(np.linalg.norm(sine_axis))
    angle = np.arctan2(sine, 0.5 * (np.trace(R) - 1.0))
    return sine_axis if sine < 1e-9 else sine_axis * (angle / sine)


def skew(r: np.ndarray) -> np.ndarray:
    """(3, 3) matrix of the cross product: skew(r) f = r × f."""
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def turn(yaw: float) -> np.ndarray:
    """(2, 2) rotation by `yaw` in the plane."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])


@compiled
def quaternion_of(R: np.ndarray, out: np.ndarray) -> None:
    """The unit quaternion (w, x, y, z) of axes R (3, 3) into `out` (4,) [Shepperd78]."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    k, largest = -1, trace
    for a in range(3):
        if R[a, a] > largest:
            k, largest = a, R[a, a]
    if k < 0:
        w = 0.5 * np.sqrt(1.0 + trace)
        out[0] = w
        for a in range(3):
            i, j = (a + 1) % 3, (a + 2) % 3
            out[1 + a] = (R[j, i] - R[i, j]) / (4.0 * w)
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        x = 0.5 * np.sqrt(max(1.0 + 2.0 * R[k, k] - trace, 1e-12))
        out[0] = (R[j, i] - R[i, j]) / (4.0 * x)
        out[1 + k] = x
        out[1 + i] = (R[i, k] + R[k, i]) / (4.0 * x)
        out[1 + j] = (R[j, k] + R[k, j]) / (4.0 * x)
    norm = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2 + out[3] ** 2)
    for a in range(4):
        out[a] /= norm


@compiled
def axes_of(quaternion: np.ndarray, out: np.ndarray) -> None:
    """The axes (3, 3) of a unit quaternion (w, x, y, z) into `out`."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    out[0, 0], out[0, 1], out[0, 2] = (
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
    )
    out[1, 0], out[1, 1], out[1, 2] = (
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
    )
    out[2, 0], out[2, 1], out[2, 2] = (
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    )
