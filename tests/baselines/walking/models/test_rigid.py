"""The rigid leg, alone and on the way from one leg to the other."""

import numpy as np
import pytest

from poise.baselines.walking.models.legs import leg_arrays, measure_legs
from poise.baselines.walking.models.reference import allocate_reference, share_load
from poise.baselines.walking.models.rigid import Rigid
from poise.baselines.walking.models.two_rods import length_at
from poise.envs.compiled.calls import run
from tests.support.shared import generic_state, robot


def answered(model, shares):
    """The reference of a model for a moving state after `shares` (leg, fraction, duration)."""
    state = generic_state().state
    r = allocate_reference(robot(), 0.004, leg_arrays(robot()))
    program = model.bind(robot(), state.arrays, r)
    r.com_vel[:], r.com_acc[:], r.ahead[:] = (0.5, 0.1), (0.8, -0.3), (1.0, 0.0)
    share_load(r, *shares)
    run(program)
    return r


@pytest.mark.parametrize("leg", [0, 1])
def test_one_leg_keeps_its_length(leg):
    """The hip goes to a distance ℓ of the ankle, and z ż + d ḋ = 0 and its derivative."""
    r = answered(Rigid(flexion=15.0), (leg, 1.0, np.inf))
    legs = r.legs
    length = length_at(legs.thigh, legs.shank, np.radians(15.0))
    to_hip = legs.hip[leg] - legs.ankle[leg]
    to_hip[2] += r.height[0]
    assert np.linalg.norm(to_hip) == pytest.approx(length)
    velocity, accel = np.append(r.com_vel, r.height[1]), np.append(r.com_acc, r.height[2])
    assert to_hip @ velocity == pytest.approx(0.0, abs=1e-12)
    assert velocity @ velocity + to_hip @ accel == pytest.approx(0.0, abs=1e-12)


def test_both_legs_share_the_height():
    """Between both feet the height is the mean of both arcs, by their shares."""
    ends = [answered(Rigid(), (leg, 1.0, np.inf)) for leg in (0, 1)]
    middle = answered(Rigid(), (0, 0.5, np.inf))
    for k in range(3):
        mean = 0.5 * (ends[0].height[k] + ends[1].height[k])
        assert middle.height[k] == pytest.approx(mean, abs=1e-12)


def test_shares_go_over_with_two_derivatives():
    """w from 0 to 1 in the transfer, as smooth as it says; the other leg's is what is left."""
    state = generic_state().state
    r = allocate_reference(robot(), 0.004, leg_arrays(robot()))
    measure_legs(state.arrays, r.legs)
    seen, step, duration = [], 1e-4, 0.1
    for fraction in (0.3 - step, 0.3, 0.3 + step):
        share_load(r, 1, fraction, duration)
        seen.append(r.share.copy())
        assert r.share[0].sum() == pytest.approx(1.0)
    dt = step * duration
    np.testing.assert_allclose(seen[1][1], (seen[2][0] - seen[0][0]) / (2.0 * dt), rtol=1e-5)
    np.testing.assert_allclose(
        seen[1][2], (seen[2][0] - 2.0 * seen[1][0] + seen[0][0]) / dt**2, rtol=1e-3
    )
    for fraction, share in ((0.0, 0.0), (1.0, 1.0), (1.7, 1.0)):
        share_load(r, 1, fraction, duration)
        assert r.share[0, 1] == share
        np.testing.assert_allclose(r.share[1:], 0.0, atol=1e-9)
