"""Captured clips, which are not ours to give: their tests run where `../shared/motions` is."""

import pytest

from poise.baselines.motion.clips.library import captured_clips

#: of CMU's subject 02, of one skeleton; empty where they are not
CMU = sorted(name for name in captured_clips() if name.startswith("cmu02_") and "jump" not in name)
captured = pytest.mark.skipif(not CMU, reason="no captured clips in ../shared/motions")
