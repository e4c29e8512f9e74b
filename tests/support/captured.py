"""Captured clips, which are not ours to give: tests play them where they are, and skip by name
else."""

import pytest

from poise.baselines.motion.clips.bvh import read_bvh
from poise.baselines.motion.clips.clip import Clip
from poise.baselines.motion.clips.library import PLACES, captured_clips


def captured(name: str) -> Clip:
    """A captured clip; skips the test, by the clip's name, where it is not here."""
    found = captured_clips().get(name)
    if found is None:
        pytest.skip(f"the captured clip {name} is not here: name its folder in {PLACES}")
    return read_bvh(found).clip
