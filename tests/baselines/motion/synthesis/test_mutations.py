"""Damaged scripts and graphs are taken or refused in one line; `motion_mutations` plays 2,000."""

from __future__ import annotations

from collections import Counter

import pytest

from poise.baselines.motion.synthesis.scripts.parser import parse
from poise.baselines.motion.synthesis.synthesis import Synthesis
from tests.performance.motion_mutations import (
    SCRIPTS,
    clips,
    graph,
    outcome,
    play_graph,
    play_script,
)

CASES = 100


@pytest.mark.parametrize("play", [play_script, play_graph])
def test_damage_ends_in_a_motion_or_in_one_line(play) -> None:
    counts = Counter(outcome(play, seed) for seed in range(CASES))
    assert counts["taken"] > 0 and counts["refused"] > CASES // 2


@pytest.mark.parametrize("text", SCRIPTS)
def test_undamaged_they_are_taken(text: str) -> None:
    made, record = Synthesis(graph(), clips()).make(parse(text))
    assert made.duration > 5.0 and record["parts"]
