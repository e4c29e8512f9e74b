"""Planted feet: of captured clips, and of one whose skating is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.contacts import grounded, measure_contacts
from poise.baselines.motion.clips.library import find_bvh, packaged_clips
from poise.configs.files import packaged_folder
from poise.configs.schema import read_yaml
from tests.support.captured import captured
from tests.support.motion_files import small_bvh


@pytest.mark.parametrize(
    "name", [name for name in packaged_clips() if not name.endswith(("walk", "kick"))]
)
def test_clips_in_place_have_planted_feet(name: str) -> None:
    contacts = measure_contacts(read_bvh(find_bvh(name)).clip)
    assert contacts.in_place
    assert contacts.planted.mean() > 0.9


def test_captured_walking_feet_take_turns() -> None:
    contacts = measure_contacts(captured("cmu02_walk"))
    assert not contacts.in_place
    left, right = contacts.planted.T
    assert 0.2 < left.mean() < 0.7 and 0.2 < right.mean() < 0.7
    assert np.mean(left != right) > 0.5


def test_feet_of_the_own_walk_are_in_the_air_within_its_steps() -> None:
    """Its keyframes say when: a foot is never in the air outside of its steps, and is in each."""
    clip = read_bvh(find_bvh("humanoid_walk")).clip
    steps = read_yaml(packaged_folder("clips") / "keyframes" / "walk.yaml")["steps"]
    contacts = measure_contacts(clip)
    assert not contacts.in_place and len(steps) == 5
    for foot, side in enumerate(("left", "right")):
        spans = [(step["lift"], step["land"]) for step in steps if step["foot"] == side]
        inside = [(clip.times > lift) & (clip.times < land) for lift, land in spans]
        assert contacts.planted[~np.any(inside, axis=0), foot].all()
        assert all(not contacts.planted[span, foot].all() for span in inside)


def test_skating_and_sinking_are_measured(tmp_path: Path) -> None:
    """A rigid figure that slides at 5 cm/s along x while its last frame is 3 mm lower."""
    path = tmp_path / "small.bvh"
    path.write_text(small_bvh(60))
    clip = read_bvh(path).clip
    still = np.broadcast_to(clip.rotations[:1], clip.rotations.shape).copy()
    root = np.zeros((60, 3))
    root[:, 0], root[:, 2] = 0.05 * clip.times, 0.95
    root[-1, 2] -= 0.003
    contacts = measure_contacts(replace(clip, root=root, rotations=still))
    assert contacts.planted.all()
    assert contacts.skating == pytest.approx(0.05, rel=1e-6)
    assert contacts.skating_largest == pytest.approx(0.05, rel=1e-6)
    assert contacts.floor == pytest.approx(0.0, abs=1e-6)
    assert contacts.penetration == pytest.approx(0.003, abs=1e-6)


def test_short_flights_are_taken_down_where_there_are_no_long_ones() -> None:
    """The foot that lifted off last stays until the next one lands; 0.1 s are a jump."""
    left = [1, 1, 1, 0, 0, 0, 0, 0, 1, 1]
    right = [0, 0, 0, 0, 0, 1, 1, 1, 0, 0]
    planted = np.array([left, right], dtype=bool).T
    down = grounded(planted, 0.03)
    assert down[:, 0].tolist() == [bool(x) for x in [1, 1, 1, 1, 1, 0, 0, 0, 1, 1]]
    assert (down[:, 1] == planted[:, 1]).all()
    assert (grounded(planted, 0.05) == planted).all()
    first = grounded(planted[3:], 0.03)  # begins in flight: the foot that lands is down
    assert first[:, 1].tolist() == [True] * 5 + [False] * 2
    run = np.tile(planted[:8], (3, 1))
    run[7::8] = False  # a flight at every step
    assert (grounded(run, 0.02) == run).all()
