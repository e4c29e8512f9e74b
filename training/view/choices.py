"""The names that can be chosen on the page: packaged ones, nothing that is a path or code."""

from __future__ import annotations

from poise.baselines.policy_files.reading import RIVALS
from poise.configs.files import packaged
from poise.training.trials.agents import NO_CONTROL

NOBODY = "none"  # in the place of a controller


def robots() -> tuple[str, ...]:
    """The packaged robots."""
    return tuple(packaged("robots"))


def controllers() -> tuple[str, ...]:
    """The packaged controllers and policies, and no control at all."""
    return (*packaged("controllers"), *packaged("policies"), *packaged(RIVALS), NO_CONTROL)
