"""The interface of a controller that performs motions whose feet leave the ground."""

from typing import Protocol, runtime_checkable

from poise.baselines.balance.references.reference_motion import ReferenceMotion
from poise.baselines.balance.references.tempo import Pace


@runtime_checkable
class Performer(Protocol):
    """What a controller has that knows the motion whose targets it is given."""

    def perform(self, motion: ReferenceMotion, pace: Pace) -> None:
        """Take the motion, and the pace of its time."""
