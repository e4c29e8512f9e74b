"""The way from rest to rest: `envs/compiled/maths/easing.py`."""

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from poise.envs.compiled.maths.easing import ease, eased

QUINTIC = Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
ROUNDING = 31.0 * np.finfo(float).eps  # of terms of up to 10, 15 and 6 that add up to 1


def test_from_rest_to_rest():
    """From 0 to 1, at rest at both ends, and the same distance from both at equal times."""
    u = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(ease(u), QUINTIC(u), atol=1e-14)
    for order in (1, 2):
        np.testing.assert_allclose(QUINTIC.deriv(order)([0.0, 1.0]), 0.0, atol=1e-12)
    np.testing.assert_allclose(ease(u) + ease(1.0 - u), 1.0, atol=1e-14)


def test_no_way_from_rest_to_rest_has_less_jerk():
    """∫ jerk² = 720, and any way that differs by a bump with no rates at the ends has more."""
    bump = Polynomial([0.0, 0.0, 0.0, 1.0]) * Polynomial([1.0, -1.0]) ** 3

    def cost(way: Polynomial) -> float:
        squared = (way.deriv(3) ** 2).integ()
        return float(squared(1.0) - squared(0.0))

    assert cost(QUINTIC) == pytest.approx(720.0)
    for size in (-0.5, 0.1, 2.0):
        assert cost(QUINTIC + size * bump) > cost(QUINTIC)


def test_compiled_code_has_the_same():
    """But for rounding: it adds the terms in another order."""
    values = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose([eased(u) for u in values], ease(values), rtol=0.0, atol=ROUNDING)
