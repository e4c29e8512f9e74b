"""Vectors and frames: `envs/maths/vectors.py`."""

import numpy as np
import pytest

from poise.envs.maths.vectors import along, placed, turn, turned


def test_a_turned_frame_and_back():
    """`along` and `turned` are the rotation's transpose and the rotation, and undo each other."""
    for yaw in (0.0, 0.7, -2.9):
        cos, sin = float(np.cos(yaw)), float(np.sin(yaw))
        x, y = along(cos, sin, 0.3, -1.2)
        assert [x, y] == pytest.approx(turn(yaw).T @ [0.3, -1.2])
        assert turned(cos, sin, 0.3, -1.2) == pytest.approx(turn(yaw) @ [0.3, -1.2])
        assert turned(cos, sin, x, y) == pytest.approx([0.3, -1.2])
        assert placed(0.5, 2.0, cos, sin, x, y) == pytest.approx([0.8, 0.8])
