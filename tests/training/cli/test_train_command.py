"""training/cli/train.py: what `poise train` says of its end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from poise.training.cli.train import steps_note
from tests.support.shared import finished_run, tiny_config


@pytest.mark.parametrize(
    ("steps", "note"),
    [(192, ""), (193, "steps come in rollouts of 64: it ended at 256"), (64, "")],
)
def test_a_run_that_does_not_end_at_its_steps_says_so(
    tmp_path: Path, steps: int, note: str
) -> None:
    """Steps come in rollouts of all environments."""
    assert steps_note(tiny_config(steps=steps), tmp_path, resume=False) == note


def test_a_run_that_is_finished_says_so() -> None:
    """One that goes on counts from where it is."""
    out = finished_run()
    assert steps_note(tiny_config(), out, resume=True) == (
        f"{out} has 192 steps already; --steps says how many it is to have"
    )
    more = replace(tiny_config(), steps=200)
    assert steps_note(more, out, resume=True).endswith("it ended at 256")
