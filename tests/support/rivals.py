"""Networks that others publish: tests that need one play it where it is, and skip by name else."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

import pytest

import poise
from poise.baselines.allowance import is_script
from poise.baselines.policy_files.known import PLACES, find_network, known_policies

KNOWN = {each.name: each for each in known_policies()}


def network(name: str) -> Path:
    """The network of a known policy; skips the test, by its name, where it is not here."""
    found = find_network(KNOWN[name].origin).network
    if found is None:
        pytest.skip(f"the network of {name} is not here: see {PLACES} in poise policies")
    return found


def allowed(path: Path) -> AbstractContextManager[None]:
    """Inside, the network may run, if it is code."""
    return poise.allowing([str(path)] if is_script(path) else [])
