"""envs/sensing/external_force.py: what pushes a robot, told by its momentum and the ground."""

import copy
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from poise.baselines.controller import Targets
from poise.baselines.registry import load_controller
from poise.envs.physics.pushes.push import Push
from poise.envs.physics.simulation import Simulation
from poise.envs.sensing.estimator import EstimatedState
from poise.envs.sensing.external_force import ExternalForce, bear_load
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
        seen.append(source.estimation.force.wrench.copy())
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
    source = estimated("field", seed, predictor="rollout", load=False)
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


BODY = {"body": {"payload": 0.08, "com": 0.03, "mass": 0.05}}


def holding(source: EstimatedState, seconds: float) -> None:
    """Let the QP hold the robot by what is believed."""
    controller = load_controller("momentum-qp", robot())
    controller.reset(source.state)
    targets = Targets.standing(robot(), source.state)
    for _ in range(round(seconds / (TICK * robot().model.opt.timestep))):
        source.simulation.step(controller.torques(source.state, targets), TICK)
        source.update()


@pytest.mark.parametrize(
    ("level", "off"), [(BODY, 5e-4), ({"base": "lab", **BODY}, 4e-3)], ids=["exact", "lab"]
)
def test_a_load_is_learned(level, off):
    """It is what gravity does to the true robot: the weight and the CoM that are believed then are
    the true ones, to `off` [m]; without it the CoM is 8 mm away."""
    source = estimated(level, seed=2)
    holding(source, 3.0)
    true, believed, g = source.simulation, source.state, robot().units.gravity
    weight = true.arrays.mass * g
    force, nx, ny = source.estimation.force.load
    assert np.hypot(nx, ny) / weight > 0.008
    assert robot().mass * g - force == pytest.approx(weight, rel=0.005)
    assert robot().mass * g < 0.95 * weight
    shift = true.state.com - true.state.qpos[:3] - (believed.com - believed.qpos[:3])
    assert np.abs(shift[:2]).max() < off


def test_a_load_is_a_heavier_root():
    """h, A v̇ + A_bias and the CoM of a robot that bears a load are those of one whose root has it.

    At rest in a generic posture, all about one point: the CoM of the heavier robot.
    """
    rng = np.random.default_rng(3)
    light = Simulation(robot())
    model = copy.copy(robot().model)
    root = robot().root_body_id
    added, at = 5.0, np.array([0.07, -0.04, 0.11])
    whole = model.body_mass[root] + added
    model.body_ipos[root] = (model.body_mass[root] * model.body_ipos[root] + added * at) / whole
    model.body_mass[root] = whole
    mujoco.mj_setConst(model, mujoco.MjData(model))
    heavy = Simulation(replace(robot(), model=model))
    qpos = robot().standing_qpos.copy()
    qpos[3:7] += 0.2 * rng.standard_normal(4)
    qpos[3:7] /= np.linalg.norm(qpos[3:7])
    qpos[7:] += 0.3 * rng.standard_normal(len(qpos) - 7)
    for each in (light, heavy):
        each.reset(qpos)
    s, arrays = light.state, light.state_arrays
    g = robot().units.gravity
    place = s.qpos[:3] + s.root_axes @ at - s.com
    force = ExternalForce.allocate()
    force.load[:] = -added * g, -added * g * place[1], added * g * place[0]
    bear_load(force, light.arrays, arrays)
    np.testing.assert_allclose(s.h[:6], heavy.state.h[:6], atol=1e-9)
    np.testing.assert_allclose(s.com[:2], heavy.state.com[:2], atol=1e-12)
    np.testing.assert_allclose(s.A_bias[:6], heavy.state.A_bias[:6], atol=1e-9)
    np.testing.assert_allclose(s.capture_point, s.com[:2], atol=1e-12)


def test_moments_move_with_their_point():
    """L about c + δ is L about c less δ × P, for A, its bias and the momentum alike."""
    simulation = Simulation(robot())
    simulation.reset(None, np.random.default_rng(5).standard_normal(robot().model.nv))
    before = simulation.state.copy()
    force = ExternalForce.allocate()
    force.load[:] = -30.0, 4.0, -6.0
    bear_load(force, simulation.arrays, simulation.state_arrays)
    after = simulation.state
    delta = after.com - before.com
    assert delta[2] == 0.0 and np.abs(delta[:2]).min() > 0.005
    for old, new in ((before.A, after.A), (before.arrays.momentum, after.arrays.momentum)):
        moved = old[3:] - np.cross(delta, old[:3], axis=0)
        np.testing.assert_allclose(new[:3], old[:3])
        np.testing.assert_allclose(new[3:], moved, atol=1e-12)
    bias = before.A_bias - [0.0, 0.0, -30.0, 4.0, -6.0, 0.0]
    bias[3:] -= np.cross(delta, bias[:3])
    np.testing.assert_allclose(after.A_bias, bias, atol=1e-9)
    np.testing.assert_allclose(after.capture_point - before.capture_point, delta[:2], atol=1e-12)


def test_a_push_is_no_load():
    """A push that ankles just hold moves the CoM that is believed by less than 4 mm."""
    source = estimated({"base": "lab"})
    holding(source, 2.0)
    before = source.estimation.force.load.copy()
    source.simulation.set_pushes([Push("torso", 2.05, 0.1, 12.0, 15.0)])
    holding(source, 0.5)
    moved = np.abs(source.estimation.force.load - before)
    assert moved[1:].max() < 0.004 * robot().mass * robot().units.gravity
