"""The time of an episode."""

from dataclasses import dataclass

from poise.envs.compiled.block import Block
from poise.envs.compiled.mutable import Mutable


@dataclass(eq=False)
class Clock(Block):
    """Counts the physics steps of an episode; whoever needs the time holds the same clock."""

    steps: Mutable[int]  # since the reset
