"""Arrays of unit quaternions (…, 4), scalar first, by SciPy's Rotation."""

import numpy as np
from scipy.spatial.transform import Rotation

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def to_scipy(quaternions: np.ndarray) -> Rotation:
    """Quaternions (…, 4) as one flat `Rotation`."""
    return Rotation.from_quat(np.roll(quaternions.reshape(-1, 4), -1, axis=1))


def from_scipy(rotations: Rotation, shape: tuple[int, ...]) -> np.ndarray:
    """The flat `Rotation` as quaternions (*shape, 4)."""
    return np.roll(rotations.as_quat(), 1, axis=1).reshape(*shape, 4)


def multiply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The products a b, (…, 4); `b` turns first. Both are broadcast."""
    w1, x1, y1, z1 = np.moveaxis(a, -1, 0)
    w2, x2, y2, z2 = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ],
        axis=-1,
    )


def inverse(q: np.ndarray) -> np.ndarray:
    """The inverse rotations (…, 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotate(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Vectors `v` (…, 3) turned by `q` (…, 4): v + 2 w (u × v) + 2 u × (u × v)."""
    u, w = q[..., 1:], q[..., :1]
    cross = np.cross(u, v)
    return v + 2.0 * (w * cross + np.cross(u, cross))


def about_z(angle: float) -> np.ndarray:
    """The quaternion (4,) of a turn about z by `angle` [rad]."""
    return np.array([np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)])


def log(quaternions: np.ndarray) -> np.ndarray:
    """Rotation vectors (…, 3) [rad] of unit quaternions (…, 4), on the shorter way."""
    return to_scipy(quaternions).as_rotvec().reshape(*quaternions.shape[:-1], 3)


def exp(vectors: np.ndarray) -> np.ndarray:
    """Unit quaternions (…, 4) of rotation vectors (…, 3) [rad]."""
    return from_scipy(Rotation.from_rotvec(vectors.reshape(-1, 3)), vectors.shape[:-1])


def slerp(a: np.ndarray, b: np.ndarray, u: np.ndarray | float) -> np.ndarray:
    """Rotations (…, 4) at fractions `u` of the ways from `a` to `b`: a exp(u log(a⁻¹ b))."""
    return multiply(a, exp(log(multiply(inverse(a), b)) * np.asarray(u)[..., None]))


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The angles (…) [rad] between rotations (…, 4)."""
    gap = multiply(inverse(a), b)
    return to_scipy(gap).magnitude().reshape(gap.shape[:-1])


def heading_angle(forward: np.ndarray) -> np.ndarray:
    """The angles (…) [rad] from x to vectors (…, 3) seen from above."""
    return np.arctan2(forward[..., 1], forward[..., 0])
