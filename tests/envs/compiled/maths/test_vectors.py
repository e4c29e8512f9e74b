"""Vectors and frames: `envs/compiled/maths/vectors.py`."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise.envs.compiled.maths.pendulum import drifted_point
from poise.envs.compiled.maths.vectors import along, placed, rotated, rotation_between, turn, turned


def test_a_turned_frame_and_back():
    """`along` and `turned` are the rotation's transpose and the rotation, and undo each other."""
    for yaw in (0.0, 0.7, -2.9):
        cos, sin = float(np.cos(yaw)), float(np.sin(yaw))
        x, y = along(cos, sin, 0.3, -1.2)
        assert [x, y] == pytest.approx(turn(yaw).T @ [0.3, -1.2])
        assert turned(cos, sin, 0.3, -1.2) == pytest.approx(turn(yaw) @ [0.3, -1.2])
        assert turned(cos, sin, x, y) == pytest.approx([0.3, -1.2])
        assert placed(0.5, 2.0, cos, sin, x, y) == pytest.approx([0.8, 0.8])


def test_rodrigues_formula_turns_as_scipy_does():
    """About any axis, by any angle; an axis of zeros turns nothing."""
    rng = np.random.default_rng(0)
    for angle in (0.0, 0.3, 2.0, -3.0):
        axis, u = rng.normal(size=3), rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        expected = Rotation.from_rotvec(angle * axis).apply(u)
        assert rotated(*axis, np.cos(angle), np.sin(angle), u) == pytest.approx(expected)
    assert rotated(0.0, 0.0, 0.0, 1.0, 0.0, u) == pytest.approx(u)


def test_the_rotation_between_frames_is_sine_times_axis():
    """In world axes, from the first frame to the second."""
    first = Rotation.from_rotvec([0.2, -0.4, 1.0])
    for vector in ([0.1, 0.0, 0.0], [0.3, -0.5, 0.2], [0.0, 0.0, -1.2]):
        angle = float(np.linalg.norm(vector))
        second = Rotation.from_rotvec(vector) * first
        found = rotation_between(first.as_matrix(), second.as_matrix())
        assert found == pytest.approx(np.array(vector) / angle * np.sin(angle))


def test_capture_points_drift_from_the_cop():
    """ξ̇ = ω (ξ − p), and where it begins."""
    xi, p, h = np.array([0.3, -0.1]), np.array([0.05, 0.02]), 1e-6
    assert drifted_point(xi, p, 3.5, 0.0) == pytest.approx(xi)
    before, now, after = (np.array(drifted_point(xi, p, 3.5, 0.3 + t)) for t in (-h, 0.0, h))
    assert (after - before) / (2.0 * h) == pytest.approx(3.5 * (now - p), rel=1e-6)
