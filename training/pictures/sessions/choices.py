"""The names that can be chosen on the page, or by a link: nothing that is a path or code.

But for what the user has named on the command line.
"""

from typing import NamedTuple

from poise.baselines.policy_files.known import RIVALS
from poise.configs.files import packaged
from poise.training.benchmarking.trials.names import NO_CONTROL

from .spec import SessionSpec, Spec

NOBODY = "none"  # in the place of a controller


class Choices(NamedTuple):
    """Names of each kind."""

    robots: tuple[str, ...]
    controllers: tuple[str, ...]
    motions: tuple[str, ...]

    @property
    def all(self) -> tuple[str, ...]:
        """Names of any kind."""
        return (*self.robots, *self.controllers, *self.motions)


def choices(named: Spec) -> Choices:
    """What is packaged, no control at all, and what the user has named."""
    players = (*packaged("controllers"), *packaged("policies"), *packaged(RIVALS), NO_CONTROL)
    robots, motions = tuple(packaged("robots")), tuple(packaged("motions"))
    if not isinstance(named, SessionSpec):
        return Choices(robots, players, motions)
    return Choices(
        _with(robots, named.robot),
        _with(players, *named.controllers),
        _with(motions, named.motion),
    )


def _with(names: tuple[str, ...], *more: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*names, *more)))
