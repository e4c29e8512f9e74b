"""Convex polygons in the ground plane, corners counter-clockwise."""

import numpy as np

from poise.envs.compiled.jit import compiled


@compiled
def convex_hull(points: np.ndarray, n: int, line: float, out: np.ndarray) -> int:
    """The hull of the first `n` rows of `points` (≥ n, 2), counter-clockwise, into rows of `out`
    (≥ 2 n + 1, 2); how many they are.

    A corner at most `line` [m] from the segment between its neighbours is none. Monotone chain;
    sorts `points` by x, then y.
    """
    for i in range(1, n):
        x, y = points[i, 0], points[i, 1]
        j = i - 1
        while j >= 0 and (points[j, 0] > x or (points[j, 0] == x and points[j, 1] > y)):
            points[j + 1, 0], points[j + 1, 1] = points[j, 0], points[j, 1]
            j -= 1
        points[j + 1, 0], points[j + 1, 1] = x, y
    size, least = 0, 2
    for k in range(2 * n - 1):
        if k == n:  # the lower chain is done, the upper one leads back
            least = size + 1
        i = k if k < n else 2 * n - 2 - k
        while size >= least and not _turns_left(out, size, points[i, 0], points[i, 1]):
            size -= 1
        out[size, 0], out[size, 1] = points[i, 0], points[i, 1]
        size += 1
    return _without_flat_corners(out, size - 1, line) if line > 0.0 else size - 1


@compiled
def _turns_left(chain: np.ndarray, size: int, x: float, y: float) -> bool:
    """Return whether the last corner of a chain lies to the right of the way to (x, y)."""
    ax, ay = chain[size - 2, 0], chain[size - 2, 1]
    bx, by = chain[size - 1, 0] - ax, chain[size - 1, 1] - ay
    return bx * (y - ay) - by * (x - ax) > 0.0


@compiled
def _without_flat_corners(polygon: np.ndarray, size: int, line: float) -> int:
    """Take away corners at most `line` from the segment between their neighbours; how many stay.

    The chain itself knows no tolerance: of an upright edge whose points differ in x by rounding it
    may meet the middle before an end, and within a tolerance that end would be on the line.
    """
    i = checked = 0
    while size > 1 and checked < size:
        i = (i + 1) % size  # the first corner is checked last
        checked += 1
        if _is_flat(polygon[(i - 1) % size], polygon[i], polygon[(i + 1) % size], line):
            for k in range(i, size - 1):
                polygon[k, 0], polygon[k, 1] = polygon[k + 1, 0], polygon[k + 1, 1]
            size, i, checked = size - 1, i - 1, 0
    return size


@compiled
def _is_flat(a: np.ndarray, b: np.ndarray, c: np.ndarray, line: float) -> bool:
    """Return whether `b` is at most `line` from the segment that leads from `a` to `c`."""
    dx, dy, bx, by = c[0] - a[0], c[1] - a[1], b[0] - a[0], b[1] - a[1]
    along = (bx * dx + by * dy) / max(dx * dx + dy * dy, 1e-300)
    fraction = min(max(along, 0.0), 1.0)
    x, y = bx - fraction * dx, by - fraction * dy
    return x * x + y * y <= line * line


@compiled
def find_nearest(polygon: np.ndarray, point: np.ndarray, out: np.ndarray) -> None:
    """The point of a convex counter-clockwise `polygon` (k, 2) nearest to `point` into `out`."""
    x, y = point[0], point[1]
    out[0], out[1] = x, y
    n, least, outside = polygon.shape[0], np.inf, False
    for i in range(n):
        ax, ay = polygon[i, 0], polygon[i, 1]
        ex, ey = polygon[(i + 1) % n, 0] - ax, polygon[(i + 1) % n, 1] - ay
        outside = outside or ex * (y - ay) - ey * (x - ax) < 0.0
        along = ((x - ax) * ex + (y - ay) * ey) / max(ex * ex + ey * ey, 1e-18)
        fraction = min(max(along, 0.0), 1.0)
        px, py = ax + fraction * ex, ay + fraction * ey
        distance = (px - x) ** 2 + (py - y) ** 2
        if distance < least:
            least = distance
            out[0], out[1] = px, py
    if not outside:
        out[0], out[1] = x, y


def nearest_inside(polygon: np.ndarray, point: np.ndarray) -> np.ndarray:
    """The point of a convex counter-clockwise `polygon` (k, 2) that is nearest to `point` (2,)."""
    out = np.empty(2)
    find_nearest(np.array(polygon), np.array(point, dtype=float), out)
    return out


def shrunk(polygon: np.ndarray, scale: float) -> np.ndarray:
    """`polygon` (k, 2) scaled about the mean of its vertices."""
    middle = polygon.mean(axis=0)
    return middle + scale * (polygon - middle)


def clipped(polygon: np.ndarray, normal: np.ndarray, offset: float) -> np.ndarray:
    """The part of a convex polygon (k, 2) with normal · p ≤ offset; at least its nearest point."""
    over = polygon @ normal - offset
    if np.all(over <= 0.0):
        return polygon
    if np.all(over > 0.0):
        return polygon[[int(np.argmin(over))]]
    kept = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if over[i] <= 0.0:
            kept.append(polygon[i])
        if (over[i] <= 0.0) != (over[j] <= 0.0):
            fraction = over[i] / (over[i] - over[j])
            kept.append(polygon[i] + fraction * (polygon[j] - polygon[i]))
    return np.array(kept)


def ray_to_edge(polygon: np.ndarray, point: np.ndarray, ray: np.ndarray) -> float:
    """Return the distance from `point` (2,) along the unit vector `ray` (2,) to a polygon's edge.

    The corners (k, 2) of the polygon are counter-clockwise. The distance is zero where the point is
    outside."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)  # outward
    gaps = np.einsum("ij,ij->i", normals, polygon - point)
    if np.any(gaps < 0.0):
        return 0.0
    speeds = normals @ ray
    ahead = speeds > 1e-12
    return float(np.min(gaps[ahead] / speeds[ahead]))


def stacked(polygons: list[np.ndarray]) -> np.ndarray:
    """(n, k, 2) polygons of up to k corners, the last one repeated where there are fewer."""
    most = max(len(polygon) for polygon in polygons)
    return np.array([np.pad(p, ((0, most - len(p)), (0, 0)), "edge") for p in polygons])


def half_planes(polygon: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """N (k, 2), b (k,) with N p ≤ b inside a counter-clockwise polygon (k, 2)."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    length = np.linalg.norm(edges, axis=1)
    edges, corners = edges[length > 1e-9], polygon[length > 1e-9]
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return normals, np.einsum("ij,ij->i", normals, corners)
