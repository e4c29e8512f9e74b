"""Level ground."""

from dataclasses import dataclass
from typing import Literal

from .terrain import Surface, Terrain


@dataclass(frozen=True)
class Flat(Terrain):
    """The plane z = 0: nothing is built, and everything is as if there were no terrain."""

    kind: Literal["flat"] = "flat"

    def nominal(self) -> list[Surface]:
        return []
