"""envs/sensing/external_force.py: what pushes a robot, told by its momentum and the ground."""

import numpy as np
import pytest

from poise.envs.physics.pushes.push import Push
from poise.envs.sensing.estimator import EstimatedState
from tests.support.sensing import estimated, start
from tests.support.shared import robot

LATE = {"latency": {"sense": 0.02}}
TICK = 2  # physics steps
SINKS = np.zeros(robot().model.nu)  # torques of a robot that goes down


def pushed(source: EstimatedState, push: Push | None, ticks: int) -> tuple[np.ndarray, np.ndarray]:
    """(wrenches (ticks, 6) that are believed, (ticks, 6) the push and its moment as they were)."""
    source.simulation.set_pushes([] if push is None else [push])
    seen, true = [], []
    body = robot().model.body("torso").id
    for _ in range(ticks):
        state = source.simulation.step(SINKS, TICK)
        source.update()
        force = source.simulation.data.xfrc_applied[body, :3].copy()
        arm = source.simulation.data.xipos[body] - state.com
        seen.append(source.belief.force.wrench.copy())
        true.append(np.concatenate([force, np.cross(arm, force)]))
    return np.array(seen), np.array(true)


def test_a_push_is_known_as_soon_as_it_is_measured():
    """Force and moment are those of the push 20 ms ago, while the robot goes down and lands."""
    source = estimated(LATE, predictor="rollout")
    push = Push("torso", 0.05, 0.1, 30.0, 40.0)
    seen, true = pushed(source, push, 60)
    late = 10 // TICK
    then, now = true[:-late], seen[late:]
    size = np.linalg.norm(then[:, :3], axis=1)
    middle = size > 0.9 * size.max()
    assert middle.sum() > 15
    np.testing.assert_allclose(now[middle][1:, :3], then[middle][1:, :3], atol=6.0)
    np.testing.assert_allclose(now[middle][1:, 3:], then[middle][1:, 3:], atol=3.0)
    quiet = size == 0.0
    assert np.abs(now[quiet][5:, :3]).max() < 12.0 < 0.05 * np.linalg.norm(true, axis=1).max()


@pytest.mark.parametrize("pushes", [False, True])
def test_what_is_led_on_is_nearer_to_the_truth(pushes):
    """During a push the velocity of the CoM is off by a tenth of what it is without the force."""
    errors = []
    for known in (True, False):
        source = estimated(LATE, predictor="rollout", external_force=known)
        push = Push("torso", 0.05, 0.1, 30.0, 40.0) if pushes else None
        source.simulation.set_pushes([push] if push else [])
        off = []
        for tick in range(33):  # to 0.132 s
            source.simulation.step(SINKS, TICK)
            source.update()
            if tick > 18:  # 26 ms after its beginning
                believed, true = source.state.com_vel, source.simulation.state.com_vel
                off.append(np.linalg.norm(believed - true))
        errors.append(np.mean(off))
    assert errors[0] < (0.1 * errors[1] if pushes else 1.5 * errors[1] + 1e-3)
    assert not pushes or errors[1] > 0.1  # [m/s]


@pytest.mark.parametrize("seed", [3, 4, 5])
def test_noise_is_no_push_and_a_push_no_noise(seed):
    """Where sensors err a robot that only sinks is left alone, and a push is seen as it begins."""
    push = Push("torso", 0.2, 0.1, 60.0, 90.0)
    source = estimated("field", seed, predictor="rollout")
    quiet, _ = pushed(source, None, 75)
    start(source, "field", seed)
    seen, _ = pushed(source, push, 75)
    assert np.mean(np.linalg.norm(quiet[:, :3], axis=1) > 0.0) < 0.1
    assert not quiet[:25].any()  # nothing is believed before the noise is known
    force = seen[53:59, :3].mean(axis=0)  # from 12 to 36 ms after its beginning
    assert 200.0 < force[1] < 900.0 and abs(force[0]) < 0.3 * force[1]


def test_episodes_and_switches():
    """An episode forgets the push before; switched off, or never simulated, nothing is believed."""
    push = Push("torso", 0.05, 0.1, 30.0, 0.0)
    source = estimated(LATE, predictor="rollout")
    first, _ = pushed(source, push, 30)
    start(source, LATE)
    again, _ = pushed(source, push, 30)
    assert np.array_equal(first, again) and np.abs(first).max() > 100.0
    for switched in ({"predictor": "promised"}, {"predictor": "none"}, {"external_force": False}):
        other = estimated(LATE, **{"predictor": "rollout", **switched})
        assert not pushed(other, push, 30)[0].any()
