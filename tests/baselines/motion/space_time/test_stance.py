"""Displacements that keep planted soles, and postures that are led back to them."""

import numpy as np
import pytest

from poise.baselines.motion.space_time.constraints.scene import Scene
from poise.baselines.motion.space_time.stance import motions, move_soles, sole_error
from tests.support.scenes import swaying


def error_of(scene: Scene, frame: int) -> float:
    return float(np.abs(sole_error(scene, frame)[0]).max(initial=0.0))


@pytest.mark.parametrize("name", ["humanoid", "toddler"])
def test_free_motions_move_no_sole_and_all_others_do(name: str) -> None:
    """To first order: a tenth of the way, a hundredth of the error."""
    scene = swaying(name, size=0.0)
    ways = motions(scene, 0)
    assert np.abs(ways.given).max() < 1e-12
    rank = scene.model.nv - ways.free.shape[1]
    assert rank == 12 if name == "humanoid" else 10 <= rank <= 12
    assert ways.free.T @ ways.free == pytest.approx(np.eye(ways.free.shape[1]), abs=1e-12)
    way = ways.free @ np.random.default_rng(0).normal(size=ways.free.shape[1])
    errors = []
    for size in (1e-2, 1e-3):
        moved = swaying(name, size=0.0)
        moved.displace(0, size * way)
        errors.append(error_of(moved, 0))
    assert errors[0] > 50.0 * errors[1] > 0.0


def test_soles_are_led_back() -> None:
    scene = swaying(size=0.05)
    joints = scene.qpos[:, 7:].copy()
    frames = np.arange(3, len(scene))
    assert max(error_of(scene, f) for f in frames) > 0.03
    move_soles(scene, frames)
    assert max(error_of(scene, f) for f in frames) < 1e-9
    assert np.abs(scene.qpos[:, 7:] - joints).max() < 0.2  # nearby
