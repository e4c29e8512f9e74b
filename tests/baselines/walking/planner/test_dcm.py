"""The capture point of a walk, against its differential equation."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from poise.baselines.walking.planner.dcm import (
    constant_cop,
    gait_offset,
    step_to_offset,
    touchdown_target,
    transfer_factor,
    transfer_point,
)

OMEGA = 3.5


def moved(xi, cop, duration):
    """ξ after `duration` of ξ̇ = ω (ξ − p(t)), integrated numerically."""
    end = solve_ivp(
        lambda t, x: OMEGA * (x - cop(t)), (0.0, duration), [xi], rtol=1e-11, atol=1e-13
    )
    return float(end.y[0, -1])


@pytest.mark.parametrize("transfer_time", [0.0, 0.02, 0.1, 0.25])
def test_a_foothold_puts_the_capture_point_at_its_offset(transfer_time):
    """From any ξ at touchdown: p goes from the old sole to the new one, and ξ ends at b from it."""
    end, offset = 0.23, 0.07
    factor = transfer_factor(OMEGA, transfer_time)
    way = step_to_offset(end, offset, factor, OMEGA, transfer_time)
    if transfer_time > 0.0:
        end = moved(end, lambda t: way * t / transfer_time, transfer_time)
    assert end - way == pytest.approx(offset, abs=1e-9)


def test_the_target_at_touchdown_is_the_inverse_of_the_foothold():
    factor = transfer_factor(OMEGA, 0.08)
    end = touchdown_target(0.31, 0.06, factor, OMEGA, 0.08)
    assert step_to_offset(end, 0.06, factor, OMEGA, 0.08) == pytest.approx(0.31, abs=1e-12)


def test_a_constant_cop_brings_the_capture_point_where_it_should_be():
    cop = constant_cop(0.04, 0.19, OMEGA, 0.27)
    assert moved(0.04, lambda _: cop, 0.27) == pytest.approx(0.19, abs=1e-9)


@pytest.mark.parametrize("left", [0.0, 0.03, 0.09])
def test_a_point_of_a_transfer_leads_to_its_end(left):
    cop, goal, end = 0.02, 0.24, 0.29
    speed = (goal - cop) / left if left > 0.0 else 1.7
    start = goal if left == 0.0 else cop
    xi = transfer_point(start, speed, goal, end, OMEGA, left)
    assert moved(xi, lambda t: start + speed * t, left) == pytest.approx(end, abs=1e-9)


@pytest.mark.parametrize("first", [1.0, -1.0])
def test_a_gait_repeats_itself_with_its_velocity_and_width(first):
    """Eight steps by the law, each from where the last one ended, p as the law has it."""
    step_time, transfer_time, width = 0.36, 0.08, 0.21
    velocity = np.array([0.6, 0.1])
    period, factor = step_time + transfer_time, transfer_factor(OMEGA, transfer_time)
    place, side = np.zeros(2), first  # of the stance foot; the side of the one that swings
    xi = place + gait_offset(OMEGA, step_time, transfer_time, *velocity, side * width)
    for _ in range(8):
        offset = gait_offset(OMEGA, step_time, transfer_time, *velocity, -side * width)
        ends = [moved(x, lambda _, p=p: p, step_time) for x, p in zip(xi, place, strict=True)]
        way = [
            step_to_offset(end - p, b, factor, OMEGA, transfer_time)
            for end, p, b in zip(ends, place, offset, strict=True)
        ]
        assert way == pytest.approx([0.6 * period, 0.1 * period + side * width], abs=1e-7)
        xi = np.array([
            moved(x, lambda t, p=p, w=w: p + w * t / transfer_time, transfer_time)
            for x, p, w in zip(ends, place, way, strict=True)
        ])  # fmt: skip
        place, side = place + way, -side
